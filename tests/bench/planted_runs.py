"""Runs that fail on purpose, depending on their seed."""

import ctypes
import os
import signal
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pushplan.bench.outcome import Outcome
from pushplan.bench.suite import RunSpec

FATES = (
    "fine", "segfault", "no plan", "raise", "fine", "hang", "invalid", "hog", "fine", "abort", "leave", "fine",
    "exit", "hog in C", "fine", "stubborn hang", "killed", "fine", "lists", "half a log", "ask too much",
)  # fmt: skip

STATUS = {
    "fine": "ok", "no plan": "no plan", "invalid": "invalid", "segfault": "crash", "abort": "crash",
    "leave": "crash", "killed": "crash", "half a log": "crash", "hang": "timeout", "stubborn hang": "timeout",
    "hog": "out of memory", "hog in C": "out of memory", "lists": "out of memory", "ask too much": "out of memory",
    "raise": "error", "exit": "error",
}  # fmt: skip


SECONDS = 15 if "COVERAGE_RUN" in os.environ else 3
"""Time limit of a run; coverage measurement slows the start and end of every process."""


def fate_of(seed: int) -> str:
    """Return the planned outcome of the run with a seed."""
    return FATES[seed % len(FATES)]


def work(spec: RunSpec, folder: Path) -> Outcome:
    """Run until the planned outcome of the seed."""
    fate = fate_of(spec.seed)
    if fate == "half a log":
        (folder / "run.mcap.partial").write_bytes(b"half")
        os._exit(1)
    if fate not in ("fine", "invalid", "no plan"):
        _go_wrong(fate)
        raise AssertionError("nothing has gone wrong")
    values = {} if fate == "no plan" else {"solution_length": spec.seed / 7.0}
    return Outcome(spec.key, STATUS[fate], "" if fate == "fine" else f"it is {fate}", values)


def meet(spec: RunSpec, folder: Path) -> Outcome:
    """End normally once another run has started, too."""
    (folder.parent / f"met-{spec.seed}").touch()
    while len([*folder.parent.glob("met-*")]) < 2:
        time.sleep(0.01)
    return Outcome(spec.key, "ok")


def leave_number(spec: RunSpec, folder: Path) -> Outcome:
    """Write the number of this process and never end."""
    (folder.parent / "number").write_text(str(os.getpid()))
    while True:
        time.sleep(0.1)


def _go_wrong(fate: str) -> None:
    libc = ctypes.CDLL(None)
    hoard: list[object] = []
    match fate:
        case "segfault":
            ctypes.string_at(0)
        case "abort":
            os.abort()
        case "leave":
            os._exit(7)
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            time.sleep(1000.0)
        case "stubborn hang":
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            while True:
                pass
        case "hog":
            while True:
                hoard.append(np.ones(100_000))
        case "lists":
            while True:
                hoard.append([0] * 10_000)
        case "hog in C":
            libc.malloc.restype = ctypes.c_void_p
            while True:
                libc.memset(ctypes.c_void_p(libc.malloc(1 << 20)), 1, 1 << 20)
        case "ask too much":
            hoard.append(np.ones(1_000_000_000))
        case "raise":
            raise ValueError("planted")
        case "exit":
            sys.exit(3)


def suite_text(seeds: Iterable[int], seconds: float = SECONDS) -> str:
    """Return a suite of planted runs."""
    return (
        "format: pushplan-suite/1\nname: planted\nproblems: [one-box]\n"
        f"seeds: {[*seeds]}\nlimits: {{run: {seconds} s, memory: 100 MB}}\n"
    )
