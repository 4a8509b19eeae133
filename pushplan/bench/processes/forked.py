"""A process that was forked for a run, as its supervisor sees it; nothing here waits for the server or the run."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import socket
import time
from collections.abc import Callable
from multiprocessing.connection import wait

from pushplan.bench.processes.child import HEAD, Ended
from pushplan.bench.processes.fork_loop import WORD

CHUNK = 1 << 20
"""Bytes of a result that are read at a time."""


class Forked:
    """A process that a server was asked for.

    Attributes:
        number: Of the process; None until the server has told it.
        started: When that was, s of the monotonic clock.
        died: When its end was seen, likewise.
        exit_code: As `subprocess` gives it; None as long as the server has not told it.
        ended: What its work has sent, or None.
    """

    def __init__(
        self, life: socket.socket, result: int, sentinel: int, silent: Callable[[float], bool]
    ) -> None:
        """Take what the supervisor keeps of a request.

        Args:
            life: The server's word on the process.
            result: The reading end of a pipe, what its work sends.
            sentinel: The writing end of a pipe; its closing ends the process.
            silent: Whether the server owes an answer since a time for longer than it may.
        """
        self.number: int | None = None
        self.started: float | None = None
        self.died: float | None = None
        self.exit_code: int | None = None
        self.ended: Ended | None = None
        self._life, self._result, self._sentinel, self._silent = life, result, sentinel, silent
        self._asked = time.monotonic()
        self._process: int | None = None
        self._open = {life.fileno(), result}  # what there is still something to hear from
        self._bytes = bytearray()
        self._closed = False
        life.setblocking(False)
        os.set_blocking(result, False)

    @property
    def handles(self) -> list[int]:
        """What becomes ready when there is something to `look` at."""
        if self._process is None or self.died is not None:
            return [*self._open]
        return [*self._open, self._process]

    @property
    def lost(self) -> bool:
        """Whether the server, killed or stopped, will not tell any more what is wanted of it."""
        since = self._asked if self.started is None else self.died
        if since is None or self.exit_code is not None or self.ended is not None:
            return False
        return self._life.fileno() not in self._open or self._silent(since)

    def look(self) -> None:
        """Take in what has happened."""
        # Its end is asked for first: a process that has ended has sent all it had to send.
        if self._process is not None and self.died is None and wait([self._process], timeout=0):
            self.died = time.monotonic()
        self._hear()
        self._read()

    def _hear(self) -> None:
        while self._life.fileno() in self._open:
            try:
                word, descriptors, _, _ = socket.recv_fds(self._life, WORD.size, 1)
            except BlockingIOError:
                return
            except ConnectionError:
                word, descriptors = b"", []
            if not word:
                self._open.discard(self._life.fileno())
            elif descriptors:
                (self.number,), (self._process,) = WORD.unpack(word), descriptors
                self.started = time.monotonic()
            else:
                (self.exit_code,) = WORD.unpack(word)

    def _read(self) -> None:
        while self._result in self._open:
            try:
                data = os.read(self._result, CHUNK)
            except BlockingIOError:
                return
            self._bytes += data
            if not data:
                self._open.discard(self._result)
            if self.ended is None and len(self._bytes) >= HEAD.size:
                (size,) = HEAD.unpack_from(self._bytes)
                if len(self._bytes) >= HEAD.size + size:
                    self.ended = pickle.loads(self._bytes[HEAD.size :])

    def kill(self) -> None:
        """End the process if it lives, however far it has come, and let go of everything; again, do nothing."""
        if self._closed:
            return
        self._closed = True
        os.close(self._sentinel)
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(self._process, signal.SIGKILL)
            wait([self._process])
            os.close(self._process)
        os.close(self._result)
        self._life.close()
