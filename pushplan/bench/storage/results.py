"""Read results back: the runs of a suite as it was asked for last, with what has become of each."""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from pushplan.bench.processes.outcome import OK
from pushplan.bench.storage.arena import ATTRIBUTES
from pushplan.bench.storage.store import FORMAT, StoreError
from pushplan.util.arrays import FloatArray

MISSING = "missing"
"""Outcome of a run without a result."""


@dataclass(frozen=True, eq=False)
class RunRow:
    """One run of a suite.

    Attributes:
        key: Of the run.
        problem: Name of the problem.
        planner: Label of the planner, with the stable set when the suite has several.
        stable_set: Name of the stable set.
        seed: Of the random numbers.
        outcome: One of `outcome.STATUSES`, or `MISSING`.
        message: What there is to say about it.
        log: Name of the log in the folder, or None.
        host: Machine that did it.
        values: What `arena.ATTRIBUTES` hold, NaN where there is nothing.
        arcs: (k, 4) twists and lengths of the path.
        progress: (m, 2) times and costs of the improvements, s and m.
    """

    key: str
    problem: str
    planner: str
    stable_set: str
    seed: int
    outcome: str
    message: str
    log: str | None
    host: str
    values: Mapping[str, float]
    arcs: FloatArray
    progress: FloatArray

    @property
    def solved(self) -> bool:
        """Whether it ended with a valid solution."""
        return self.outcome == OK

    @property
    def cost(self) -> float:
        """Cost of the valid path, m; infinite without one."""
        return self.values["solution_length"] if self.solved else math.inf

    @property
    def first_time(self) -> float:
        """Time to the first path, s; infinite when the run has not ended with a valid one."""
        return self.values["first_solution_time"] if self.solved else math.inf


@dataclass(frozen=True, eq=False)
class Results:
    """All runs of a suite.

    Attributes:
        path: The database.
        about: `name`, `version`, `versions`, `machine`, `started`, `seconds` and `source` of the suite.
        runs: In the order of the suite.
        time_limit: Largest planning time allowed, s.
    """

    path: Path
    about: Mapping[str, object]
    runs: tuple[RunRow, ...]
    time_limit: float

    @cached_property
    def planners(self) -> tuple[str, ...]:
        """Names of the planners, in the order of the suite."""
        return tuple(dict.fromkeys(run.planner for run in self.runs))

    @cached_property
    def problems(self) -> tuple[str, ...]:
        """Names of the problems, in the order of the suite."""
        return tuple(dict.fromkeys(run.problem for run in self.runs))

    @cached_property
    def best_costs(self) -> Mapping[str, float]:
        """Lowest cost of a valid path by problem, m; infinite where there is none."""
        return {name: min(run.cost for run in self.runs if run.problem == name) for name in self.problems}

    def of(self, planner: str) -> list[RunRow]:
        """Return the runs of a planner that have a result."""
        return [run for run in self.runs if run.planner == planner and run.outcome != MISSING]

    def excess(self, run: RunRow) -> float:
        """Return a run's cost as a multiple of the lowest one known of its problem; infinite if not solved."""
        return run.cost / self.best_costs[run.problem] if run.solved else math.inf


def read_results(path: Path) -> Results:
    """Read the results in a database or in a folder of results.

    Raises:
        StoreError: When there is no such file, or it holds no results.
    """
    path = path / "results.db" if path.is_dir() else path
    if not path.is_file():
        raise StoreError(f"{path}: there are no results")
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
            database.row_factory = sqlite3.Row
            return _read(path, database)
    except sqlite3.DatabaseError as error:
        raise StoreError(f"{path} is no file of results: {error}") from error


def _read(path: Path, database: sqlite3.Connection) -> Results:
    about = database.execute("SELECT * FROM pushplan_suite").fetchone()
    if about is None:
        raise StoreError(f"{path}: there are no results")
    if about["format"] != FORMAT:
        raise StoreError(f"{path} has format {about['format']}; this version reads format {FORMAT}")
    rows = database.execute(
        "SELECT p.*, r.*, o.*, p.key AS key, p.seed AS seed FROM pushplan_plan p "
        "LEFT JOIN pushplan_runs o ON o.key = p.key LEFT JOIN runs r ON r.id = o.runid ORDER BY p.number"
    ).fetchall()
    progress: dict[int, list[tuple[float, float]]] = {}
    for number, time, cost in database.execute(
        "SELECT runid, time, best_cost FROM pushplan_progress ORDER BY runid, time"
    ):
        progress.setdefault(number, []).append((time, cost))
    several = len({row["stable_set"] for row in rows}) > 1
    limit = database.execute("SELECT MAX(timelimit) FROM experiments").fetchone()[0]
    runs = tuple(_run(row, progress.get(row["runid"], []), several) for row in rows)
    return Results(path, dict(about), runs, float(limit))


def _run(row: sqlite3.Row, progress: Sequence[tuple[float, float]], several: bool) -> RunRow:
    known = set(row.keys())  # an older version did not measure everything
    values = {
        name: math.nan if name not in known or row[name] is None else float(row[name])
        for name, _ in ATTRIBUTES
    }
    return RunRow(
        key=row["key"],
        problem=row["problem"],
        planner=f"{row['planner']} ({row['stable_set']})" if several else row["planner"],
        stable_set=row["stable_set"],
        seed=row["seed"],
        outcome=row["outcome"] or MISSING,
        message=row["message"] or "",
        log=row["log"],
        host=row["host"] or "",
        values=values,
        arcs=np.array(json.loads(row["arcs"] or "[]"), dtype=np.float64).reshape(-1, 4),
        progress=np.array(progress, dtype=np.float64).reshape(-1, 2),
    )
