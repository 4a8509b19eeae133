"""Runs that go wrong on purpose, each as its seed says, and runs that wait until they are told to go on.

Servers load this module before they fork, so it imports no planner: `planted_batch` is the program.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from pushplan.bench.processes.outcome import Figures, Task

FATES = (
    "fine",
    "segfault",
    "no plan",
    "raise",
    "fine",
    "hang",
    "invalid",
    "hog",
    "fine",
    "abort",
    "leave",
    "fine",
    "exit",
    "hog in C",
    "fine",
    "stubborn hang",
    "killed",
    "fine",
    "lists",
    "half a log",
    "ask too much",
)

STATUS = {
    "fine": "ok",
    "no plan": "no plan",
    "invalid": "invalid",
    "segfault": "crash",
    "abort": "crash",
    "leave": "crash",
    "killed": "crash",
    "half a log": "crash",
    "hang": "timeout",
    "stubborn hang": "timeout",
    "hog": "out of memory",
    "hog in C": "out of memory",
    "lists": "out of memory",
    "ask too much": "out of memory",
    "raise": "error",
    "exit": "error",
}


SECONDS = 15 if "COVERAGE_RUN" in os.environ else 3
"""Time limit of a run; while coverage is measured, every process takes a while to begin and to end."""


def fate_of(seed: int) -> str:
    """Return what happens to the run of a seed."""
    return FATES[seed % len(FATES)]


def work(task: Task, folder: Path) -> Figures:
    """Meet the fate that the seed says."""
    fate = fate_of(task.seed)
    if fate in ("fine", "invalid", "no plan"):
        return _figures(task.seed, fate)
    if fate == "half a log":
        (folder / "run.mcap.partial").write_bytes(b"half")
        os._exit(1)
    _go_wrong(fate)
    raise AssertionError("nothing has gone wrong")


def meet(task: Task, folder: Path) -> Figures:
    """End well as soon as another run is there at the same time."""
    (folder.parent / f"met-{task.seed}").touch()
    while len(list(folder.parent.glob("met-*"))) < 2:
        time.sleep(0.01)
    return _figures(task.seed, "fine")


def _wait_to_go(folder: Path) -> None:
    (folder.parent / f"waits-{os.getpid()}").touch()
    while not (folder.parent / "go").exists():
        time.sleep(0.01)


def end_well(task: Task, folder: Path) -> Figures:
    """End well as soon as the test says so."""
    _wait_to_go(folder)
    return Figures(found=True, valid=True, path_cost=float(task.seed))


def end_badly(task: Task, folder: Path) -> Figures:
    """End without a word as soon as the test says so."""
    _wait_to_go(folder)
    os._exit(task.seed)


def end_server(task: Task, folder: Path) -> Figures:
    """Take the server along."""
    os.kill(os.getppid(), signal.SIGKILL)
    os._exit(1)


def _figures(seed: int, fate: str) -> Figures:
    if fate == "no plan":
        return Figures(reason="there is none")
    arcs = ((1.0, 0.0, 0.0, 0.1 * seed), (0.9, 0.0, 1.0, 1.0 / (seed + 1)))
    return Figures(
        found=True,
        valid=fate == "fine",
        reason="" if fate == "fine" else "it slips",
        path_cost=seed / 7.0,
        arcs=arcs,
    )


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


def suite_text(seeds: int, first: int = 0) -> str:
    """Return a suite of planted runs."""
    return (
        "format: pushplan-suite/1\nname: planted\nproblems: [one-box]\n"
        f"seeds: {list(range(first, first + seeds))}\nlimits: {{run: {SECONDS} s, memory: 100 MB}}\n"
    )
