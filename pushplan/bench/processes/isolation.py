"""One process a run: whatever happens in it ends that run alone, and becomes its outcome.

A fork server (`fork_server`) has everything imported and compiled (`preload`). Each run is a fresh process forked
from it within milliseconds, so that no run sees what another one left behind (memory, random numbers of libraries,
caches), its peak memory is its own, and it can be killed at any moment. A run whose process or exit code went with a
lost server is begun anew.

Memory counts as what a run takes on top of the code and kernels that it starts with. The supervisor looks at the
resident set a few times a second and kills what has grown too large; a run that grows faster, or asks for a lot
at once, is refused memory by the kernel (RLIMIT_DATA), of which it can still tell. The address space as a whole
(RLIMIT_AS) would say little: compiled code and thread stacks reserve much that they never use.
"""

from __future__ import annotations

import shutil
import signal
import socket
import tempfile
import time
from multiprocessing.connection import wait
from pathlib import Path

from pushplan.bench.processes import outcome
from pushplan.bench.processes.child import OUTPUT, Ended, Work, order, resident_megabytes
from pushplan.bench.processes.fork_server import supervisor
from pushplan.bench.processes.outcome import Outcome, Task
from pushplan.bench.processes.work import LOG, perform

WATCH = 0.05
"""Seconds between two looks at what runs take."""

ATTEMPTS = 3
"""Times that a run is begun, at most, when it loses its server; a run may be what ends it."""

MOST_OUTPUT = 4000
"""Characters of what a process that died has written, kept for people."""


class IsolatedRun:
    """A run in a process of its own.

    Attributes:
        task: What it does.
    """

    def __init__(self, task: Task, scratch: Path | None = None, work: Work = perform) -> None:
        """Have the process started, without waiting for it.

        Args:
            task: What to do.
            scratch: Where the run's folder is made; None for the system's place for temporary files.
            work: What to do with it.

        Raises:
            ForkServerError: When no process can be started from which runs are forked.
        """
        self.task = task
        self._scratch, self._work = scratch, work
        self._lost = 0
        self._begin()

    def _begin(self) -> None:
        self._base: float | None = None
        self._folder = Path(tempfile.mkdtemp(prefix=f"{self.task.key}-", dir=self._scratch)).absolute()
        try:
            order(self._folder, self._work, self.task)
            self._server, self._forked = supervisor().fork(self._folder)
        except BaseException:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise

    @property
    def handles(self) -> list[int]:
        """What becomes ready when there is something to `poll` for."""
        return self._forked.handles

    @property
    def process(self) -> int | None:
        """Number of the process; None until it is known."""
        return self._forked.number

    def poll(self) -> Outcome | None:
        """Return what became of the run, None while it goes on; a run beyond its limits is killed."""
        self._forked.look()
        ended = self._begun_anew() if self._forked.lost else self._ended()
        if ended is None:
            return None
        result = self._outcome(ended)
        self.stop()
        return result

    def stop(self) -> None:
        """Kill the process if it lives, leaving nothing behind."""
        self._forked.kill()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _begun_anew(self) -> Ended | None:
        """Begin once more with another server, unless the run may be what ends servers."""
        if self._forked.started is not None:
            self._lost += 1
        if self._lost == ATTEMPTS:
            text = f"the process from which runs are forked was lost {ATTEMPTS} times during this run"
            return Ended(outcome.CRASH, self._with_output(text))
        self.stop()
        supervisor().replace(self._server)
        self._begin()
        return None

    def _ended(self) -> Ended | None:
        forked = self._forked
        if forked.ended is not None:
            return forked.ended
        if forked.exit_code is not None:
            return Ended(outcome.CRASH, self._with_output(_death(forked.exit_code)))
        if forked.started is None or forked.died is not None:  # the server will tell
            return None
        if time.monotonic() - forked.started > self.task.seconds:
            return Ended(outcome.TIMEOUT, self._with_output(f"killed after {self.task.seconds:g} s"))
        if self._fits():
            return None
        return Ended(outcome.OUT_OF_MEMORY, f"killed with more than {self.task.megabytes:g} MB in use")

    def _fits(self) -> bool:
        resident = resident_megabytes(self._forked.number)
        if self._base is None:
            self._base = resident
        return resident - self._base <= self.task.megabytes

    def _outcome(self, ended: Ended) -> Outcome:
        log, whole = self._read_log()
        began = self._forked.started
        seconds = 0.0 if began is None else time.monotonic() - began
        host = socket.gethostname()
        return Outcome(self.task.key, ended.status, ended.message, ended.figures, log, whole, seconds, host)

    def _read_log(self) -> tuple[bytes | None, bool]:
        """Return the bytes of the log, or of its part, and whether it is complete."""
        whole, part = self._folder / LOG, self._folder / f"{LOG}.partial"
        if whole.exists():
            return whole.read_bytes(), True
        return (part.read_bytes(), False) if part.exists() else (None, False)

    def _with_output(self, text: str) -> str:
        """Add the end of what the process has written on its standard streams."""
        path = self._folder / OUTPUT
        written = path.read_text(errors="replace").strip()[-MOST_OUTPUT:] if path.exists() else ""
        return f"{text}\n{written}" if written else text


def isolated(task: Task, scratch: Path | None = None, work: Work = perform) -> Outcome:
    """Do a run in a process of its own and return what became of it, whatever that is."""
    run = IsolatedRun(task, scratch, work)
    try:
        while (ended := run.poll()) is None:
            wait(run.handles, timeout=WATCH)
    except BaseException:
        run.stop()
        raise
    return ended


def _death(code: int) -> str:
    """Return what an exit code says about the end of a process."""
    if code >= 0:
        return f"the process ended by itself with exit code {code}"
    name = signal.Signals(-code).name if -code in list(signal.Signals) else f"signal {-code}"
    hint = ", as the system does when memory runs out" if -code == signal.SIGKILL else ""
    return f"killed by {name}{hint}"
