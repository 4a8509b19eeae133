"""Execute the missing runs of a suite, one process per run, and store each result at once."""

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
    """Progress of a benchmark.

    Attributes:
        total: Number of selected runs.
        before: Number of them that already had a result.
        counts: Number of new results by status.
        seconds: Wall-clock time of the new results, s.
    """

    total: int
    before: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def done(self) -> int:
        """Number of new results."""
        return sum(self.counts.values())

    @property
    def left(self) -> int:
        """Number of runs without a result."""
        return self.total - self.before - self.done

    @property
    def solved(self) -> int:
        """Number of new results with a valid plan."""
        return self.counts.get(OK, 0)

    @property
    def failed(self) -> int:
        """Number of new results that are neither solved nor without a plan."""
        return self.done - self.solved - self.counts.get(NO_PLAN, 0)

    @property
    def to_end(self) -> float | None:
        """Estimated time until all runs are done, s; None before the first result."""
        return self.seconds / self.done * self.left if self.done else None


@dataclass(frozen=True)
class Selection:
    """Selected runs of a suite.

    Attributes:
        resume: Whether to continue in a folder with results, with the runs that have none.
        filters: Filters that the runs must match; see `suite.select`.
        rerun: Key, or its beginning, of a single run to repeat; empty for none.
        shard: (i, n) for part i, from 1 to n, of n disjoint parts of equal size.
    """

    resume: bool = False
    filters: tuple[str, ...] = ()
    rerun: str = ""
    shard: tuple[int, int] = (1, 1)

    def of(self, suite: Suite, version: str) -> list[RunSpec]:
        """Return the selected runs.

        Raises:
            SelectionError: If a filter or key matches no run.
        """
        runs = list(suite.runs(version))
        if self.rerun:
            return [run_with_key(runs, self.rerun)]
        kept = select(runs, self.filters)
        part, parts = self.shard  # in the order of the keys, which is random: every part has runs of all kinds
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
    """Execute the selected runs without a result, and store each result at once.

    Args:
        suite: Suite to run.
        folder: Folder of the results; the caller holds its lock.
        engine: Engine that executes the runs; see `executor`.
        selection: Selected runs; all by default.
        observer: Function that is called after every run.
        version: Version of the package, part of each run's key.

    Returns:
        The progress at the end.

    Raises:
        StoreError: If the folder has results and `selection.resume` is not set.
        SelectionError: If a filter or key matches no run.
    """
    selection = selection or Selection()
    version = version or package_version()
    wanted = selection.of(suite, version)
    with Store(folder.database) as store:
        done = store.done()
        if done and not (selection.resume or selection.rerun):
            raise StoreError(
                f"{folder.path} has the results of {len(done)} runs; continue with --resume, or name another folder"
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
    """Combine the results of all shards of a suite in one folder. It gets all results or none.

    Args:
        folder: Folder of the combined results; the caller holds its lock.
        shards: Folders of the shards. If several have the same run, the first one counts.
        overwrite: Whether to replace existing results.

    Returns:
        Number of results that were skipped because an earlier folder has the run.

    Raises:
        StoreError: If a shard has no results, or results of another suite or version.
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
