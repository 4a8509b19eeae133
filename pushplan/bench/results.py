"""Results of a benchmark, read as pandas tables."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from pushplan.bench.outcome import ATTRIBUTES, OK
from pushplan.bench.store import FORMAT, StoreError
from pushplan.util.files import write_whole

MISSING = "missing"
"""Outcome of a run without a result."""


@dataclass(frozen=True, eq=False)
class Results:
    """All runs of the suite that a folder was last used for.

    Attributes:
        path: Path of the database.
        about: `name`, `version`, `versions`, `machine`, `started`, `seconds` and `source` of the suite.
        runs: Table with a row for each run, in the order of the suite. Its columns are `key`, `problem`, `planner`
            (with the stable set if there are several), `stable_set`, `seed`, `outcome` (of `STATUSES`, or `MISSING`),
            `message`, `log`, `host`, `cpu`, `limit` (planning limit as text) and `ATTRIBUTES` (NaN if unknown).
            `cost` (m), `first` (time of the first path, s), `excess` (ratio of cost to the lowest known cost of the
            problem) and `valid_duration` (s) are infinite for runs that are not valid. `cost_bound` (m) or
            `duration_bound` (s) holds the lower bound of the quantity that ranked the plan; the other is NaN.
        progress: Table with a row for each improvement and regular time: `key`, `time`, `cost`.
        time_limit: Largest planning time, s.
    """

    path: Path
    about: Mapping[str, object]
    runs: pd.DataFrame
    progress: pd.DataFrame
    time_limit: float

    @cached_property
    def planners(self) -> list[str]:
        """Names of the planners, in the order of the suite."""
        return list(dict.fromkeys(self.runs.planner))

    @cached_property
    def done(self) -> pd.DataFrame:
        """Runs with a result."""
        return self.runs[self.runs.outcome != MISSING]

    @property
    def processors(self) -> str:
        """Text of the processor models with their numbers of runs; empty for a single model."""
        counts = self.done.cpu.value_counts()
        return ", ".join(f"{model}: {count}" for model, count in counts.items()) if len(counts) > 1 else ""

    def of(self, planner: str) -> pd.DataFrame:
        """Return the runs of a planner with a result."""
        return self.done[self.done.planner == planner]


def ranked_by_time(runs: pd.DataFrame) -> bool:
    """Return whether there are plans among the runs, and time ranked all of them."""
    known = runs.by_time.dropna()
    return len(known) > 0 and bool(known.all())


def read_results(path: Path) -> Results:
    """Read the results of a database, or of a folder of results.

    Raises:
        StoreError: If there is no such file, or it holds no results of this version.
    """
    path = path / "results.db" if path.is_dir() else path
    if not path.is_file():
        raise StoreError(f"{path}: there are no results")
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
            suite = pd.read_sql("SELECT * FROM pushplan_suite", database)
            if suite.empty:
                raise StoreError(f"{path}: there are no results")
            if suite.format[0] != FORMAT:
                raise StoreError(f"{path} has format {suite.format[0]}; this version reads format {FORMAT}")
            own = pd.read_sql("SELECT * FROM pushplan_runs WHERE number IS NOT NULL ORDER BY number", database)
            measured = pd.read_sql(
                "SELECT r.id AS runid, p.settings, r.* FROM runs r JOIN plannerConfigs p ON p.id = r.plannerid",
                database,
            )
            limit = database.execute("SELECT MAX(timelimit) FROM experiments").fetchone()[0]
            progress = pd.read_sql(
                "SELECT o.key, p.time, p.best_cost AS cost FROM progress p JOIN pushplan_runs o ON o.runid = p.runid "
                "ORDER BY o.number, p.time",
                database,
            )
    except (sqlite3.DatabaseError, pd.errors.DatabaseError) as error:
        raise StoreError(f"{path} is not a file of results: {error}") from error
    runs = own.merge(measured[["runid", "settings", *(set(ATTRIBUTES) - {"seed"})]], on="runid", how="left")
    runs[list(ATTRIBUTES)] = runs[list(ATTRIBUTES)].astype(float)
    runs["seed"] = runs.seed.astype(int)
    runs["outcome"] = runs.outcome.fillna(MISSING)
    runs["limit"] = runs.settings.map(_limit, na_action="ignore")
    if runs.stable_set.nunique() > 1:
        runs["planner"] = runs.planner + " (" + runs.stable_set + ")"
    valid = runs.outcome == OK
    runs["cost"] = runs.solution_length.where(valid, np.inf)
    runs["first"] = runs.first_solution_time.where(valid, np.inf)
    runs["valid_duration"] = runs.duration.where(valid, np.inf)
    runs["cost_bound"] = runs.lower_bound.where(runs.by_time == 0.0)
    runs["duration_bound"] = runs.lower_bound.where(runs.by_time == 1.0)
    runs["excess"] = (runs.cost / runs.groupby("problem").cost.transform("min")).where(valid, np.inf)
    return Results(path, suite.iloc[0].to_dict(), runs, progress, float(limit))


def _limit(settings: str) -> str:
    """Return the planning limit of a planner's settings as text."""
    stated = dict(line.split(" = ", 1) for line in settings.splitlines() if " = " in line)
    seconds, iterations = f"{float(stated['time']):g} s", stated["iterations"]
    return seconds if iterations == "None" else f"{seconds} or {iterations} iterations"


def write_tables(results: Results, folder: Path) -> Iterable[Path]:
    """Write `runs.csv` with a row for each run, and `progress.csv`; return their paths."""
    columns = ["key", "problem", "planner", "stable_set", "seed", "outcome", "message", "log", "host", "cpu"]
    measured = [name for name in ATTRIBUTES if name not in ("seed", "status", "solved")]
    runs = results.runs[[*columns, *measured, "limit"]].assign(machine=results.about["machine"])
    tables = {"runs.csv": runs, "progress.csv": results.progress}
    for name, table in tables.items():
        write_whole(folder / name, table.to_csv(index=False).encode())
    return [folder / name for name in tables]
