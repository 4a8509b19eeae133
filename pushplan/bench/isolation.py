"""One process a run: whatever happens in it ends that run alone, and becomes its outcome.

A fork server, started once, has everything imported and compiled (`preload`). Each run is a fresh process forked from
it within milliseconds, so that no run sees what another one left behind (memory, random numbers of libraries,
caches), its peak memory is its own, and it can be killed at any moment.

Memory counts as what a run takes on top of the code and kernels that it starts with. The supervisor looks at the
resident set a few times a second and kills what has grown too large; a run that grows faster, or asks for a lot
at once, is refused memory by the kernel (RLIMIT_DATA), of which it can still tell. The address space as a whole
(RLIMIT_AS) would say little: compiled code and thread stacks reserve much that they never use.
"""

from __future__ import annotations

import multiprocessing
import shutil
import signal
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext
from pathlib import Path
from threading import Lock
from types import ModuleType

from pushplan.bench import outcome
from pushplan.bench.child import OUTPUT, Ended, guarded, idle, resident_megabytes
from pushplan.bench.outcome import Figures, Outcome, Task
from pushplan.bench.work import LOG, perform

Work = Callable[[Task, Path], Figures]
"""What a run's process does; a function of a module, so that the process finds it by name."""

WATCH = 0.05
"""Seconds between two looks at what runs take."""

MOST_OUTPUT = 4000
"""Characters of what a process that died has written, kept for people."""


@cache
def _context() -> ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["pushplan.bench.preload"])
    return context


@cache
def prepare() -> None:
    """Have the fork server ready: compiling, at the first time on a machine, takes a while that no run shall pay."""
    with _without_main():
        process = _context().Process(target=idle)
        process.start()
    process.join()


_main_hidden = Lock()


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the main program from processes that are started: they do not need it, and would load it one by one."""
    with _main_hidden:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main


class IsolatedRun:
    """A run in a process of its own.

    Attributes:
        task: What it does.
    """

    def __init__(self, task: Task, scratch: Path | None = None, work: Work = perform) -> None:
        """Start the process.

        Args:
            task: What to do.
            scratch: Where the run's folder is made; None for the system's place for temporary files.
            work: What to do with it.
        """
        prepare()
        self.task = task
        self._folder = Path(tempfile.mkdtemp(prefix=f"{task.key}-", dir=scratch))
        self._began = time.monotonic()
        self._reader, writer = _context().Pipe(duplex=False)
        self._process = _context().Process(
            target=guarded, args=(writer, work, task, self._folder), name=task.key, daemon=True
        )
        with _without_main():
            self._process.start()
        writer.close()
        self._base = resident_megabytes(self._process.pid)

    @property
    def handles(self) -> list[Connection | int]:
        """What becomes ready when there is something to `poll` for."""
        return [self._reader, self._process.sentinel]

    def poll(self) -> Outcome | None:
        """Return what became of the run, None while it goes on; a run beyond its limits is killed."""
        ended = self._ended()
        if ended is None:
            return None
        self.stop()
        return ended

    def stop(self) -> None:
        """Kill the process if it lives, leaving nothing behind."""
        self._process.kill()
        self._process.join()
        self._reader.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _ended(self) -> Outcome | None:
        seconds = time.monotonic() - self._began
        alive = self._process.is_alive()  # asked first: a process that has ended has sent all it had to send
        if self._reader.poll():
            return self._outcome(self._received(), seconds)
        if not alive:
            return self._outcome(self._died(), seconds)
        if seconds > self.task.seconds:
            text = f"killed after {self.task.seconds:g} s"
            return self._outcome(Ended(outcome.TIMEOUT, self._with_output(text)), seconds)
        return None if self._fits() else self._outcome(self._too_large(), seconds)

    def _received(self) -> Ended:
        try:
            ended: Ended = self._reader.recv()
        except EOFError:  # the process closed its end without a word
            self._process.join()
            return self._died()
        return ended

    def _died(self) -> Ended:
        return Ended(outcome.CRASH, self._with_output(_death(self._process.exitcode)))

    def _fits(self) -> bool:
        return resident_megabytes(self._process.pid) - self._base <= self.task.megabytes

    def _too_large(self) -> Ended:
        return Ended(outcome.OUT_OF_MEMORY, f"killed with more than {self.task.megabytes:g} MB in use")

    def _outcome(self, ended: Ended, seconds: float) -> Outcome:
        log, whole = self._read_log()
        host = socket.gethostname()
        key = self.task.key
        return Outcome(key, ended.status, ended.message, ended.figures, log, whole, seconds, host)

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


def _death(code: int | None) -> str:
    """Return what an exit code says about the end of a process."""
    if code is None or code >= 0:
        return f"the process ended by itself with exit code {code}"
    name = signal.Signals(-code).name if -code in list(signal.Signals) else f"signal {-code}"
    hint = ", as the system does when memory runs out" if -code == signal.SIGKILL else ""
    return f"killed by {name}{hint}"
