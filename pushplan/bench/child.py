"""What surrounds the work in a run's process: limits, a place for its output, and errors as plain words."""

from __future__ import annotations

import faulthandler
import fcntl
import multiprocessing
import os
import resource
import signal
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from pushplan.bench import outcome
from pushplan.bench.outcome import Figures, Task
from pushplan.errors import PushplanError

OUTPUT = "output.txt"
"""File in the run's folder that takes the process's standard streams."""

ROOM = 1000.0
"""MB beyond the memory limit at which the kernel refuses more: what a run may grow by between two looks at it."""


@dataclass(frozen=True)
class Ended:
    """How the work of a run ended, as far as its process can tell."""

    status: str
    message: str
    figures: Figures = field(default_factory=Figures)


def guarded(writer: Connection, work: Callable[[Task, Path], Figures], task: Task, folder: Path) -> None:
    """Do the work within the task's limits and send how it ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the supervisor
    _end_with_parent()
    _write_into(folder / OUTPUT)
    writer.send(_ended(work, task, folder))


def idle() -> None:
    """Do nothing: a process with this work has ended when the fork server is ready."""


def _ended(work: Callable[[Task, Path], Figures], task: Task, folder: Path) -> Ended:
    try:
        limit_memory(task.megabytes + ROOM)
        figures = work(task, folder)
        return Ended(figures.status, figures.reason, figures)
    except MemoryError:
        lift_memory_limit()
        return Ended(outcome.OUT_OF_MEMORY, f"more than {task.megabytes:g} MB were asked for")
    except PushplanError as error:
        return Ended(outcome.ERROR, f"{type(error).__name__}: {error}")
    except BaseException as error:  # SystemExit is a way of ending a run, too
        return Ended(outcome.ERROR, f"{type(error).__name__}: {error}\n{traceback.format_exc()}")


def _end_with_parent() -> None:
    """Let the kernel end this process when the supervisor is gone, whatever runs here and however it went.

    The sentinel is a pipe whose other end only the supervisor holds; its closing raises SIGIO, which ends a process.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None
    fcntl.fcntl(parent.sentinel, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(parent.sentinel, fcntl.F_SETFL, os.O_ASYNC | os.O_NONBLOCK)
    if not parent.is_alive():  # gone before that: no signal will come
        os.kill(os.getpid(), signal.SIGIO)


def _write_into(path: Path) -> None:
    """Send what anything here writes to the standard streams, a crash's traceback above all, into a file."""
    target = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(target, 1)
    os.dup2(target, 2)
    faulthandler.enable(file=2)


def limit_memory(megabytes: float) -> None:
    """Let the kernel refuse allocations of more than `megabytes` on top of what the process has now."""
    lines = Path("/proc/self/status").read_text().splitlines()
    now = next(int(line.split()[1]) for line in lines if line.startswith("VmData"))
    most = now * 1024 + int(megabytes * 1e6)
    resource.setrlimit(resource.RLIMIT_DATA, (most, resource.getrlimit(resource.RLIMIT_DATA)[1]))


def lift_memory_limit() -> None:
    """Allow again what the process may have at most, so that it can report."""
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def resident_megabytes(pid: int | None) -> float:
    """Return the resident set of a process, MB; 0 when it has ended."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
