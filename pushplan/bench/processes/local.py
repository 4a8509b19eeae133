"""Runs on this machine, several at a time."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from itertools import islice
from multiprocessing.connection import wait
from pathlib import Path

from pushplan.bench.processes.child import Work
from pushplan.bench.processes.isolation import WATCH, IsolatedRun
from pushplan.bench.processes.outcome import Outcome, Task
from pushplan.bench.processes.work import perform


def local_outcomes(
    tasks: Iterable[Task], jobs: int, scratch: Path | None = None, work: Work = perform
) -> Generator[Outcome]:
    """Do runs and yield what becomes of them, in the order in which they end.

    Closing the iterator kills what still runs.

    Args:
        tasks: What to do; taken when there is a place for it.
        jobs: Runs at a time.
        scratch: See `IsolatedRun`.
        work: See `IsolatedRun`.
    """
    waiting = iter(tasks)
    live: list[IsolatedRun] = []
    ended: list[Outcome] = []
    try:
        while True:
            for task in islice(waiting, jobs - len(live)):
                live.append(IsolatedRun(task, scratch, work))  # noqa: PERF401  a started run must be in the list at once
            yield from ended
            if not live:
                return
            wait([handle for run in live for handle in run.handles], timeout=WATCH)
            ended = _collect(live)
    finally:
        for run in live:
            run.stop()


def _collect(live: list[IsolatedRun]) -> list[Outcome]:
    """Take the runs that have ended out of the list and return what became of them."""
    ended = []
    for run in live.copy():
        outcome = run.poll()
        if outcome is not None:
            live.remove(run)
            ended.append(outcome)
    return ended
