"""Run a suite: what is missing, one process a run, results kept as they come."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from pushplan.bench.executor import Engine
from pushplan.bench.outcome import NO_PLAN, OK
from pushplan.bench.store import Machine, ResultsFolder, Store, StoreError, package_version
from pushplan.bench.suite import RunSpec, Suite, run_with_key, select


@dataclass(frozen=True)
class Tally:
    """How far a benchmark has come.

    Attributes:
        total: Runs asked for.
        before: Of them, those that had a result already.
        counts: How those ended that were done now, by status.
        seconds: Time that they took, s.
    """

    total: int
    before: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def done(self) -> int:
        """Runs done now."""
        return sum(self.counts.values())

    @property
    def left(self) -> int:
        """Runs without a result."""
        return self.total - self.before - self.done

    @property
    def solved(self) -> int:
        """Runs done now that ended with a valid solution."""
        return self.counts.get(OK, 0)

    @property
    def failed(self) -> int:
        """Runs done now that were neither solved nor just without a plan."""
        return self.done - self.solved - self.counts.get(NO_PLAN, 0)

    @property
    def to_end(self) -> float | None:
        """Seconds until all is done if it goes on as so far; None before the first run."""
        return self.seconds / self.done * self.left if self.done else None


@dataclass(frozen=True)
class Selection:
    """Which runs of a suite are done.

    Attributes:
        resume: Go on in a folder that has results, with the runs that have none.
        filters: Only runs that fit; see `suite.select`.
        rerun: Key, or its beginning, of a single run to do again; empty for none.
        shard: (i, n) for part i, from 1 to n, of n parts of equal size that have no run in common.
    """

    resume: bool = False
    filters: tuple[str, ...] = ()
    rerun: str = ""
    shard: tuple[int, int] = (1, 1)

    def of(self, suite: Suite, version: str) -> list[RunSpec]:
        """Return the runs that are meant.

        Raises:
            SelectionError: When a filter or key fits nothing.
        """
        runs = list(suite.runs(version))
        if self.rerun:
            return [run_with_key(runs, self.rerun)]
        kept = select(runs, self.filters)
        part, parts = self.shard  # by key, as if drawn at random: every part has some of everything
        mine = {run.key for run in sorted(kept, key=lambda run: run.key)[part - 1 :: parts]}
        return [run for run in kept if run.key in mine]


def run_suite(
    suite: Suite,
    folder: ResultsFolder,
    engine: Engine,
    selection: Selection | None = None,
    observer: Callable[[Tally], None] | None = None,
    version: str | None = None,
) -> Tally:
    """Do the runs of a suite that are asked for and missing, and keep the result of each before the next one.

    Args:
        suite: What to run.
        folder: Where results go; the caller holds its lock.
        engine: Does the runs; see `executor`.
        selection: Which runs; all by default.
        observer: Called after every run.
        version: Of the package; part of each run's key.

    Returns:
        How the runs ended.

    Raises:
        StoreError: When the folder has results and they are not to be resumed.
        SelectionError: When a filter or key fits nothing.
    """
    selection = selection or Selection()
    version = version or package_version()
    wanted = selection.of(suite, version)
    with Store(folder.database) as store:
        done = store.done()
        if done and not (selection.resume or selection.rerun):
            raise StoreError(
                f"{folder.path} has the results of {len(done)} runs; go on with --resume, or name another folder"
            )
        folder.keep_suite(suite)
        store.expect(suite, list(suite.runs(version)), Machine.this(), version)
        by_key = {run.key: run for run in wanted if selection.rerun or run.key not in done}
        before, counts, began = len(wanted) - len(by_key), dict[str, int](), time.monotonic()
        tally = Tally(len(wanted), before)
        try:
            with closing(engine(by_key.values())) as outcomes:
                for outcome in outcomes:
                    run = by_key[outcome.key]
                    store.add(run, outcome, folder.keep_log(run, outcome))
                    counts[outcome.status] = counts.get(outcome.status, 0) + 1
                    tally = Tally(len(wanted), before, dict(counts), time.monotonic() - began)
                    if observer is not None:
                        observer(tally)
        finally:
            store.spent(time.monotonic() - began)
    return tally


def merge(folder: ResultsFolder, shards: Sequence[Path], overwrite: bool = False) -> int:
    """Make one folder of results of those of a suite's shards. It has all results or none.

    Args:
        folder: Where they go; the caller holds its lock.
        shards: Folders of results. If several have the same run, that of the first counts.
        overwrite: Replace results that the folder has.

    Returns:
        How many results were left out because an earlier folder has the run, too.

    Raises:
        StoreError: When a folder has no results, or those of another suite or version.
    """
    if folder.database.exists() and not overwrite:
        raise StoreError(f"{folder.path} has results; name another folder, or replace them with --overwrite")
    made, keys, double = ResultsFolder(folder.scratch), set[str](), 0
    with Store(made.database) as store:
        for shard in map(ResultsFolder, shards):
            for key, log in store.take(shard.database):
                double += key in keys
                if log is not None and key not in keys:
                    made.copy(shard, log)
                keys.add(key)
    for name in ("problems", "suite.yaml"):
        made.copy(ResultsFolder(shards[0]), name)
    for old in (*folder.path.glob("results.db*"), folder.path / "logs", folder.path / "problems"):
        old.unlink() if old.is_file() else shutil.rmtree(old, ignore_errors=True)
    for path in sorted(made.path.iterdir()):  # results.db comes after the logs
        path.replace(folder.path / path.name)
    return double
