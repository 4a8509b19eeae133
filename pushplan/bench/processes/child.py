"""What surrounds the work in a run's process: limits, a place for its output, and errors as plain words."""

from __future__ import annotations

import faulthandler
import fcntl
import os
import pickle
import resource
import select
import signal
import struct
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from pushplan.bench.processes import outcome
from pushplan.bench.processes.outcome import Figures, Task
from pushplan.errors import PushplanError

Work = Callable[[Task, Path], Figures]
"""What a run's process does; a function of a module, so that the process finds it by name."""

ORDER = "order.pickle"
"""File in the run's folder that says what to do."""

HEAD = struct.Struct("!Q")
"""What is sent before a result: its length, so that a part of one is not taken for it."""

OUTPUT = "output.txt"
"""File in the run's folder that takes the process's standard streams."""

GROWTH_MEGABYTES = 1000.0
"""MB beyond the memory limit at which the kernel refuses more: what a run may grow by between two looks at it."""


@dataclass(frozen=True)
class Ended:
    """How the work of a run ended, as far as its process can tell."""

    status: str
    message: str
    figures: Figures = field(default_factory=Figures)


def order(folder: Path, work: Work, task: Task) -> None:
    """Leave in a run's folder what its process is to do."""
    what = pickle.dumps((work, task))
    (folder / ORDER).write_bytes(pickle.dumps((sys.path, what)))  # the path comes first, it finds the rest


def carry_out(folder: Path, result: int, sentinel: int) -> NoReturn:
    """Do what is ordered in a folder, within the task's limits, send how it ended, and end the process.

    Args:
        folder: Of the run.
        result: Descriptor to send it to.
        sentinel: Descriptor of a pipe whose closing at the other end ends the process.
    """
    try:
        _end_with(sentinel)
        _write_into(folder / OUTPUT)
        sys.path[:], what = pickle.loads((folder / ORDER).read_bytes())
        work, task = pickle.loads(what)
        ended = pickle.dumps(_ended(work, task, folder))
        with open(result, "wb") as stream:
            stream.write(HEAD.pack(len(ended)) + ended)
        os._exit(0)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
    os._exit(1)


def _ended(work: Work, task: Task, folder: Path) -> Ended:
    try:
        limit_memory(task.megabytes + GROWTH_MEGABYTES)
        figures = work(task, folder)
        return Ended(figures.status, figures.reason, figures)
    except MemoryError:
        lift_memory_limit()
        return Ended(outcome.OUT_OF_MEMORY, f"more than {task.megabytes:g} MB were asked for")
    except PushplanError as error:
        return Ended(outcome.ERROR, f"{type(error).__name__}: {error}")
    except BaseException as error:  # SystemExit is a way of ending a run, too
        return Ended(outcome.ERROR, f"{type(error).__name__}: {error}\n{traceback.format_exc()}")


def _end_with(sentinel: int) -> None:
    """Let the kernel end this process when the supervisor is gone, whatever runs here and however it went.

    The closing of the pipe's other end raises SIGIO, which ends a process.
    """
    fcntl.fcntl(sentinel, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(sentinel, fcntl.F_SETFL, os.O_ASYNC | os.O_NONBLOCK)
    if select.select([sentinel], [], [], 0.0)[0]:  # closed before that: no signal will come
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
