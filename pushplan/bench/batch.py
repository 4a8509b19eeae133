"""Run a suite: what is missing, one process a run, results kept as they come."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass

from pushplan.bench.processes.machine import Machine, package_version
from pushplan.bench.processes.outcome import Outcome, Task
from pushplan.bench.storage.folder import FolderError, ResultsFolder
from pushplan.bench.storage.store import Store
from pushplan.bench.suites.selection import chosen, with_key
from pushplan.bench.suites.suite import RunSpec, Suite
from pushplan.bench.tally import Tally

Engine = Callable[[Iterable[Task]], Generator[Outcome]]
"""Does runs and yields what becomes of them in any order; stops them when the iterator is closed."""


@dataclass(frozen=True)
class Choice:
    """Which runs of a suite are done.

    Attributes:
        resume: Go on in a folder that has results, with the runs that have none.
        filters: Only runs that fit; see `selection.chosen`.
        rerun: Key, or its beginning, of a single run to do again; empty for none.
    """

    resume: bool = False
    filters: tuple[str, ...] = ()
    rerun: str = ""

    def of(self, runs: Sequence[RunSpec]) -> list[RunSpec]:
        """Return the runs that are meant.

        Raises:
            SelectionError: When a filter or key fits nothing.
        """
        return [with_key(runs, self.rerun)] if self.rerun else chosen(runs, self.filters)


def run_suite(
    suite: Suite,
    folder: ResultsFolder,
    engine: Engine,
    choice: Choice | None = None,
    tell: Callable[[Tally], None] | None = None,
    version: str | None = None,
) -> Tally:
    """Do the runs of a suite that are asked for and missing.

    Args:
        suite: What to run.
        folder: Where results go; the caller holds its lock.
        engine: Does the runs.
        choice: Which runs; all by default.
        tell: Called after every run.
        version: Of the package; part of each run's key.

    Returns:
        How the runs ended.

    Raises:
        FolderError: When the folder has results and they are not to be resumed.
        SelectionError: When a filter or key fits nothing.
    """
    choice = choice or Choice()
    version = version or package_version()
    runs = list(suite.runs(version))
    wanted = choice.of(runs)
    with Store(folder.database) as store:
        done = store.done()
        if done and not (choice.resume or choice.rerun):
            raise FolderError(
                f"{folder.path} has the results of {len(done)} runs; go on with --resume, or name another folder"
            )
        folder.keep_suite(suite)
        store.expect(suite, runs, Machine.this(), version)
        missing = wanted if choice.rerun else [run for run in wanted if run.key not in done]
        return _carry_out(missing, len(wanted), (folder, store), engine, tell)


def _carry_out(
    runs: Sequence[RunSpec],
    total: int,
    keep: tuple[ResultsFolder, Store],
    engine: Engine,
    tell: Callable[[Tally], None] | None,
) -> Tally:
    """Do runs, keeping what becomes of each before the next one is looked at."""
    folder, store = keep
    by_key = {run.key: run for run in runs}
    tally = Tally(total=total, before=total - len(by_key))
    began = time.monotonic()
    try:
        with closing(engine(task_of(run) for run in by_key.values())) as outcomes:
            for outcome in outcomes:
                run = by_key[outcome.key]
                store.add(run, outcome, folder.keep_log(run, outcome))
                tally = tally.with_one(outcome, time.monotonic() - began)
                if tell is not None:
                    tell(tally)
    finally:
        store.spent(time.monotonic() - began)
    return tally


def task_of(run: RunSpec) -> Task:
    """Return a run as it is sent to the process that does it."""
    scenario, planner = run.problem.scenario, run.planner
    return Task(
        key=run.key,
        name=run.problem.name,
        source=scenario.source,
        attachments=dict(scenario.attachments),
        planner=planner.name,
        first=planner.first,
        time_limit=planner.time,
        iterations=planner.iterations,
        cost=planner.cost,
        gap=planner.gap,
        stable_set=run.stable_set,
        seed=run.seed,
        seconds=run.seconds,
        megabytes=run.megabytes,
        version=run.version,
        trials=run.trials,
    )
