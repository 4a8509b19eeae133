"""Runs that go wrong on purpose, each in the way that its seed says; and a batch of them as a program of its own."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from pushplan.bench.batch import Choice, run_suite
from pushplan.bench.processes import fork_server
from pushplan.bench.processes.cluster import cluster_outcomes
from pushplan.bench.processes.local import local_outcomes
from pushplan.bench.processes.machine import package_version
from pushplan.bench.processes.outcome import Figures, Task
from pushplan.bench.processes.work import perform
from pushplan.bench.storage.folder import ResultsFolder
from pushplan.bench.suites.file import load_suite

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


def main(folder: str, suite: str, kind: str, address: str = "") -> None:
    """Do the runs of a suite file, planted or real, here or on a cluster, or go on with them; say so run by run."""
    if kind == "planted":
        fork_server.PRELOAD = "planted_runs"  # no planner is needed here
    results = ResultsFolder(Path(folder))
    does = work if kind == "planted" else perform
    with results.locked():
        run_suite(
            load_suite(Path(suite)),
            results,
            lambda tasks: (
                cluster_outcomes(tasks, address, does)
                if address
                else local_outcomes(tasks, 2, results.scratch, does)
            ),
            Choice(resume=True),
            tell=lambda tally: print(tally.done, flush=True),
            version=package_version() if address else "test",  # workers look at it
        )


if __name__ == "__main__":
    import planted_runs  # type: ignore[import-not-found]  # the processes find the work by the module's name, not as part of the main program

    planted_runs.main(*sys.argv[1:])
