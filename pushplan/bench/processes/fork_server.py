"""The supervisor of the fork server: it starts it, asks it for processes, and replaces it when it is lost.

A server that was killed closes its connections, and one that was stopped does not answer. Either is replaced; the
runs that it had go on, only their exit codes nobody will know.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from functools import cache
from multiprocessing.connection import wait
from pathlib import Path
from threading import RLock

from pushplan.bench.processes.fork_loop import READY
from pushplan.bench.processes.forked import Forked
from pushplan.errors import PushplanError

PRELOAD = "pushplan.bench.processes.preload"
"""Module that a server imports before it forks."""

ANSWER = 10.0
"""Seconds within which a server that is ready tells the beginning or end of a process; it takes milliseconds."""

START = 900.0
"""Seconds within which it gets ready: at the first time on a machine everything is compiled."""

ATTEMPTS = 5
"""Servers in a row that may be lost before they are ready."""

KILLED = 120.0
"""Seconds from the first loss for which more may be lost by signals: what kills runs may hit servers as they load."""

_SCRIPT = """\
import socket, sys
sys.path[:] = {paths!r}
from pushplan.bench.processes.fork_loop import serve
serve(socket.socket(fileno={control}), {preload!r})
"""


class ForkServerError(PushplanError, RuntimeError):
    """The process from which runs are forked cannot be started."""


class ForkServer:
    """One server.

    Attributes:
        process: Its process.
        ready: When it was ready, s of the monotonic clock; None before.
    """

    def __init__(self, preload: str) -> None:
        """Start it, without waiting for it."""
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            script = _SCRIPT.format(paths=sys.path, control=theirs.fileno(), preload=preload)
            self.process = subprocess.Popen(
                [sys.executable, "-c", script],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                process_group=0,  # Ctrl-C and Ctrl-Z are for the supervisor
            )
        self._control.setblocking(False)
        self._began = time.monotonic()
        self.ready: float | None = None

    def ask(self, folder: Path) -> Forked:
        """Ask for a process that does what is ordered in a folder.

        Raises:
            OSError: When the server is not there to be asked.
        """
        life, theirs = socket.socketpair()
        (result, writer), (reader, sentinel) = os.pipe(), os.pipe()
        asked = Forked(life, result, sentinel, self.silent)
        try:
            with theirs:
                socket.send_fds(self._control, [os.fsencode(folder)], [theirs.fileno(), writer, reader])
        except BaseException:
            asked.kill()
            raise
        finally:
            os.close(writer)
            os.close(reader)
        return asked

    def silent(self, since: float) -> bool:
        """Tell whether an answer that is due since a time, s of the monotonic clock, will not come any more."""
        self._hear()
        if self.process.poll() is not None:
            return True
        limit = START if self.ready is None and not self._stopped() else ANSWER
        return time.monotonic() - max(since, self.ready or self._began) > limit

    def wait(self, seconds: float) -> None:
        """Wait for a word of the server, but not longer than that."""
        wait([self._control], timeout=seconds)

    def end(self) -> None:
        """End the server, whatever state it is in; its runs go on."""
        self._hear()
        self._control.close()
        self.process.kill()
        self.process.wait()

    def _hear(self) -> None:
        if self.ready is None and self._control.fileno() >= 0:
            try:
                if self._control.recv(len(READY)):
                    self.ready = time.monotonic()
            except (BlockingIOError, ConnectionError):
                pass

    def _stopped(self) -> bool:
        """Tell whether the process was stopped, by a signal or a debugger."""
        try:
            words = Path(f"/proc/{self.process.pid}/stat").read_text()
        except (FileNotFoundError, ProcessLookupError):
            return False
        return words.rpartition(")")[2].split()[0] in "Tt"


class Supervisor:
    """Always has a server to ask; safe to be used by several threads."""

    def __init__(self, preload: str) -> None:
        """Start a first server with what a module loads."""
        self._preload = preload
        self._lock = RLock()
        self._failed = 0
        self._failing_since = 0.0
        self.server = ForkServer(preload)

    def fork(self, folder: Path) -> tuple[ForkServer, Forked]:
        """Ask for a process that does what is ordered in a folder; return it with the server that was asked.

        Raises:
            ForkServerError: When no server can be started.
        """
        with self._lock:
            while True:
                if self.server.process.poll() is not None:
                    self.replace(self.server)
                try:
                    return self.server, self.server.ask(folder)
                except (BlockingIOError, ConnectionError):
                    self.replace(self.server)

    def replace(self, server: ForkServer) -> None:
        """Start another server if that one is still the one to ask.

        Raises:
            ForkServerError: When servers are lost again and again before they are ready: `ATTEMPTS` times, by signals
                for `KILLED` seconds.
        """
        with self._lock:
            if server is not self.server:
                return
            code = server.process.poll()
            server.end()
            if server.ready or not self._failed:
                self._failing_since = time.monotonic()
            self._failed = 0 if server.ready else self._failed + 1
            by_signal = code is not None and code < 0
            bearable = by_signal and time.monotonic() - self._failing_since < KILLED
            if self._failed >= ATTEMPTS and not bearable:
                failed, self._failed = self._failed, 0
                raise ForkServerError(
                    f"the process from which runs are forked was lost {failed} times before it was ready, the last "
                    f"time with exit code {server.process.returncode}"
                )
            self.server = ForkServer(self._preload)

    def prepare(self) -> None:
        """Wait until a server is ready.

        Raises:
            ForkServerError: As `replace`.
        """
        while (server := self.server).ready is None:
            if server.silent(0.0):
                self.replace(server)
            else:
                server.wait(1.0)


def supervisor() -> Supervisor:
    """Return the supervisor of this process; one that was forked from it has its own."""
    return _supervisor_of(os.getpid())


@cache
def _supervisor_of(process: int) -> Supervisor:
    return Supervisor(PRELOAD)
