"""Results of a benchmark in an SQLite file that Planner Arena opens, a commit a run."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from pushplan.bench.processes.machine import Machine
from pushplan.bench.processes.outcome import OK, STATUSES, Figures, Outcome
from pushplan.bench.storage import arena
from pushplan.bench.storage.arena_parameters import parameter_values
from pushplan.bench.storage.arena_progress import sampled
from pushplan.bench.suites.suite import Problem, RunSpec, Suite
from pushplan.errors import PushplanError
from pushplan.util.files import check_output

FORMAT = 1
"""Version of our own tables."""

BUSY = 30.0
"""Seconds to wait for another program that has the file locked."""


class StoreError(PushplanError, ValueError):
    """A file of results cannot be used."""


class Store:
    """The results of a benchmark; one process writes.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, or create it."""
        self.path = path
        if check_output(path).streamed:
            raise StoreError(f"{path} is a pipe or a device; name another folder")
        self._database = sqlite3.connect(path, timeout=BUSY, isolation_level=None)
        try:
            self._prepare()
        except sqlite3.DatabaseError as error:
            self._database.close()
            if _is_busy(error):
                raise StoreError(f"another program has {path} locked; close it there") from error
            raise StoreError(f"{path} is no file of results: {error}") from error

    def _prepare(self) -> None:
        run = self._database.execute
        run("PRAGMA foreign_keys = ON")
        run("PRAGMA journal_mode = WAL")
        run("PRAGMA synchronous = NORMAL")
        with self._transaction():
            for statement in (arena.TABLES + arena.VIEWS + arena.OWN).split(";"):
                run(statement)
            self._database.executemany("INSERT OR IGNORE INTO enums VALUES (?, ?, ?)", arena.STATUS_ROWS)
        columns = [row[1] for row in run("PRAGMA table_info(runs)")]
        if columns != [name for name, _ in arena.RUNS + arena.ATTRIBUTES]:
            self._database.close()
            raise StoreError(
                f"{self.path} is of another version of pushplan, which measured other things; name another folder"
            )

    def close(self) -> None:
        """Close the file, whole in itself again: without a write-ahead log beside it.

        The log stays while another program has the file open, say to look at results; SQLite reads both as one.
        """
        try:
            self._database.execute("PRAGMA journal_mode = DELETE")
        except sqlite3.OperationalError as error:
            if not _is_busy(error):
                raise
        finally:
            self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """Write all inside, or nothing."""
        self._database.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._database.execute("ROLLBACK")
            raise
        self._database.execute("COMMIT")

    def expect(self, suite: Suite, runs: Iterable[RunSpec], machine: Machine, version: str) -> None:
        """Note which runs the suite consists of now; results of earlier ones stay."""
        runs = list(runs)
        words = (FORMAT, suite.name, suite.source, version, json.dumps(machine.versions), machine.text, now())
        rows = [(r.key, i, r.problem.name, r.planner.label, r.stable_set, r.seed) for i, r in enumerate(runs)]
        with self._transaction():
            self._database.execute(
                "INSERT INTO pushplan_suite VALUES (1, ?, ?, ?, ?, ?, ?, ?, 0.0) ON CONFLICT (id) DO UPDATE SET "
                "format = excluded.format, name = excluded.name, source = excluded.source, "
                "version = excluded.version, versions = excluded.versions, machine = excluded.machine",
                words,
            )
            self._database.execute("DELETE FROM pushplan_plan")
            self._database.executemany("INSERT INTO pushplan_plan VALUES (?, ?, ?, ?, ?, ?)", rows)
            for problem in suite.problems:
                self._experiment(problem, suite, machine, version)
            assignments = ", ".join(f"{name} = ?" for name, _ in arena.PARAMETERS)
            self._database.executemany(
                f"UPDATE experiments SET {assignments} WHERE id = ?",
                [
                    (*values, self._experiment_id(digest, version))
                    for digest, values in parameter_values(suite.problems).items()
                ],
            )

    def _experiment(self, problem: Problem, suite: Suite, machine: Machine, version: str) -> None:
        if self._experiment_id(problem.hash, version) is not None:
            return
        seeds = ",".join(str(seed) for seed in suite.seeds)
        row = (
            problem.family,
            0.0,
            max(planner.time for planner in suite.planners),
            suite.megabytes,
            0,
            f"pushplan {version}",
            machine.host,
            machine.text,
            now(),
            seeds if len(seeds) <= 24 else f"{seeds[:21]}...",
            problem.scenario.source.decode("utf-8"),
        )
        added = self._insert("experiments", (None, *row, *[None] * len(arena.PARAMETERS)))
        self._insert("pushplan_problems", (added, problem.name, problem.hash, version))

    def _experiment_id(self, digest: str, version: str) -> int | None:
        query = "SELECT experimentid FROM pushplan_problems WHERE hash = ? AND version = ?"
        return self._single(query, (digest, version))

    def _single(self, query: str, values: tuple[object, ...]) -> int | None:
        row = self._database.execute(query, values).fetchone()
        return None if row is None else int(row[0])

    def _insert(self, table: str, row: tuple[object, ...]) -> int:
        places = ", ".join("?" * len(row))
        return int(self._database.execute(f"INSERT INTO {table} VALUES ({places})", row).lastrowid or 0)

    def done(self) -> set[str]:
        """Return the keys of all runs that have a result."""
        return {key for (key,) in self._database.execute("SELECT key FROM pushplan_runs")}

    def add(self, run: RunSpec, result: Outcome, log: str | None) -> None:
        """Write the result of a run, in place of an earlier one of the same key.

        Args:
            run: Which run.
            result: What became of it.
            log: Name of its log's file, relative to the results' folder, or None.
        """
        experiment = self._experiment_id(run.problem.hash, run.version)
        with self._transaction():
            self._database.execute(
                "DELETE FROM runs WHERE id IN (SELECT runid FROM pushplan_runs WHERE key = ?)", (run.key,)
            )
            number = self._insert("runs", (None, experiment, self._planner(run), *_attributes(run, result)))
            arcs = json.dumps(result.figures.arcs)
            own = (number, run.key, result.status, result.message, arcs, log, result.host, now())
            self._insert("pushplan_runs", own)
            self._insert_progress(number, result.figures)
            self._database.execute(
                "UPDATE experiments SET runcount = (SELECT COUNT(*) FROM runs WHERE experimentid = ?1), "
                "totaltime = (SELECT SUM(total_time) FROM runs WHERE experimentid = ?1) WHERE id = ?1",
                (experiment,),
            )

    def _insert_progress(self, run: int, figures: Figures) -> None:
        improvements = figures.progress
        regular = sampled(improvements, figures.seconds.get("search", 0.0))
        for table, points in (("pushplan_progress", improvements), ("progress", regular)):
            last = {point[0]: (run, *point) for point in points}
            self._database.executemany(f"INSERT INTO {table} VALUES (?, ?, ?, ?)", last.values())

    def _planner(self, run: RunSpec) -> int:
        """Return the id of a planner with its settings and stable set."""
        settings = "".join(f"{name} = {value}\n" for name, value in run.planner.settings.items())
        row = (f"{run.planner.label} ({run.stable_set})", f"{settings}set = {run.stable_set}\n")
        known = self._single("SELECT id FROM plannerConfigs WHERE name = ? AND settings = ?", row)
        return self._insert("plannerConfigs", (None, *row)) if known is None else known

    def spent(self, seconds: float) -> None:
        """Add to the wall-clock time that the benchmark has taken."""
        self._database.execute("UPDATE pushplan_suite SET seconds = seconds + ?", (seconds,))


def _is_busy(error: sqlite3.Error) -> bool:
    """Tell whether something failed because of another program that has the file open."""
    return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY


def _attributes(run: RunSpec, result: Outcome) -> tuple[object, ...]:
    """Return the values of `arena.ATTRIBUTES`."""
    figures = result.figures
    seconds = figures.seconds
    values = {
        "time": seconds.get("search"),
        "solved": int(result.status == OK),
        "status": STATUSES.index(result.status),
        "correct_solution": int(figures.valid) if figures.found else None,
        "seed": run.seed,
        "first_solution_time": figures.first_solution_s,
        "solution_length": figures.path_cost,
        "lower_bound": figures.lower_bound,
        "solution_segments": len(figures.arcs) if figures.path_cost is not None else None,
        "solution_clearance": figures.clearance,
        "solution_difference": figures.goal_position_error,
        "goal_angle_error": figures.goal_angle_error,
        "margin": figures.margin,
        "min_margin": figures.min_margin,
        "min_dynamic_margin": figures.min_dynamic_margin,
        "trial_success": figures.trial_success,
        "duration": figures.duration,
        "extensions": figures.extensions,
        "memory": figures.memory,
        "posing_time": seconds.get("posing"),
        "timing_time": seconds.get("timing"),
        "execution_time": seconds.get("execution"),
        "logging_time": seconds.get("logging"),
        "validation_time": seconds.get("validation"),
        "trials_time": seconds.get("trials"),
        "overhead_time": result.seconds - sum(seconds.values()) if seconds else None,
        "total_time": result.seconds,
    }
    return tuple(values[name] for name, _ in arena.ATTRIBUTES)


def now() -> str:
    """Return the time of day."""
    return datetime.now(UTC).isoformat(timespec="seconds")
