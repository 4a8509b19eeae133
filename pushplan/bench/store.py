"""Results of a benchmark on disk: one SQLite file that Planner Arena can open, and a log for each run.

The tables are those of Planner Arena (Moll, Sucan and Kavraki 2015). It reads the columns of `runs` after the third
as attributes, those of `experiments` after the twelfth as parameters of the problem, and those of `progress` after
the second as measurements over time. Two tables of our own hold everything else: `pushplan_suite`, and
`pushplan_runs` with the key, the outcome, the log and the processor of each selected run. All results of a file are
from one version of pushplan.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import platform
import re
import shutil
import socket
import sqlite3
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Self

from pushplan.bench.outcome import ATTRIBUTES, OK, STATUSES, Outcome
from pushplan.bench.suite import Problem, RunSpec, Suite, planner_settings
from pushplan.errors import PushplanError
from pushplan.logging.metadata import git_commit, version_of, versions
from pushplan.util.files import check_output, write_whole


@dataclass(frozen=True)
class Machine:
    """The machine of this process.

    Attributes:
        host: Name of the machine.
        text: Text of the processor, number of usable processors, memory and operating system.
        versions: Versions of Python and of the packages that results depend on.
    """

    host: str
    text: str
    versions: dict[str, str]

    @property
    def words(self) -> str:
        """Text of processor, memory, operating system and Python version."""
        return f"{self.text}, Python {self.versions['python']}"

    @classmethod
    def this(cls) -> Machine:
        """Return this machine."""
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
        parts = f"{len(os.sched_getaffinity(0))} processors, {memory:.0f} GB"
        text = f"{cpu_model()}, {parts}, {platform.system()} {platform.release()}"
        return cls(socket.gethostname(), text, versions())


@cache
def cpu_model() -> str:
    """Return the model of this machine's processor."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())


def package_version() -> str:
    """Return the version of the package and, in a checkout, its commit, because results depend on the code."""
    commit = git_commit()
    return version_of("pushplan") + (f"+g{commit[:10]}" if commit else "")


FORMAT = 4
"""Format number of the file."""

BUSY = 30.0
"""Time to wait for another program that has locked the file, s."""

SAMPLES = 100
"""Number of regular times in the progress of each run, the last one at the end of the search. Planner Arena smooths
over them; improvements alone are too close together at the start."""

PARAMETERS = ("drive", "instance", "objects", "obstacles")
"""Parameters of a problem: drive of the pusher, seed of its generator, numbers of objects and obstacles. Parameters
with the same value in all problems of a generator are NULL, because the progress page of Planner Arena (1.0.1) fails
on them. The order is that of OMPL's reader."""

_KEY = "INTEGER PRIMARY KEY AUTOINCREMENT"
_OF_RUN = "FOREIGN KEY (runid) REFERENCES runs(id) ON DELETE CASCADE"

TABLES = f"""
CREATE TABLE IF NOT EXISTS experiments (id {_KEY}, name VARCHAR(512), totaltime REAL, timelimit REAL,
  memorylimit REAL, runcount INTEGER, version VARCHAR(128), hostname VARCHAR(1024), cpuinfo TEXT, date DATETIME,
  seed VARCHAR(24), setup TEXT, drive TEXT, instance INTEGER, objects INTEGER, obstacles INTEGER);
CREATE TABLE IF NOT EXISTS plannerConfigs (id {_KEY}, name VARCHAR(512) NOT NULL, settings TEXT);
CREATE TABLE IF NOT EXISTS enums (name VARCHAR(512), value INTEGER, description TEXT, PRIMARY KEY (name, value));
CREATE TABLE IF NOT EXISTS runs (id {_KEY}, experimentid INTEGER, plannerid INTEGER,
  {", ".join(f"{name} {kind}" for name, kind in ATTRIBUTES.items())},
  FOREIGN KEY (experimentid) REFERENCES experiments(id) ON DELETE CASCADE,
  FOREIGN KEY (plannerid) REFERENCES plannerConfigs(id) ON DELETE CASCADE);
CREATE TABLE IF NOT EXISTS progress (runid INTEGER, time REAL, best_cost REAL, iterations INTEGER,
  PRIMARY KEY (runid, time), {_OF_RUN});
CREATE TABLE IF NOT EXISTS pushplan_suite (id INTEGER PRIMARY KEY CHECK (id = 1), format INTEGER, name TEXT,
  source BLOB, version TEXT, versions TEXT, machine TEXT, started TEXT, seconds REAL);
CREATE TABLE IF NOT EXISTS pushplan_runs (key TEXT PRIMARY KEY, number INTEGER, problem TEXT, planner TEXT,
  stable_set TEXT, seed INTEGER, runid INTEGER REFERENCES runs(id) ON DELETE SET NULL, outcome TEXT, message TEXT,
  arcs TEXT, log TEXT, host TEXT, cpu TEXT, ended TEXT);
"""

RESULT = "runid, outcome, message, arcs, log, host, cpu, ended"
"""Columns of `pushplan_runs` that hold the result of a run."""

COUNTED = """UPDATE experiments SET runcount = (SELECT COUNT(*) FROM runs WHERE experimentid = experiments.id),
  totaltime = (SELECT SUM(total_time) FROM runs WHERE experimentid = experiments.id)"""

_ALL = "FROM plannerConfigs p JOIN runs r ON p.id = r.plannerid JOIN experiments e ON e.id = r.experimentid"
_MEANS = "AVG(r.solved) AS avg_solved, AVG(r.time) AS avg_total_time"

VIEWS = f"""
CREATE VIEW IF NOT EXISTS bestPlannerConfigsPerExperiment AS
SELECT plannerid, experimentid, MIN(avg_solved) AS avg_solved, avg_total_time FROM (
  SELECT r.plannerid, p.name AS plannerName, r.experimentid, {_MEANS} {_ALL} GROUP BY r.plannerid, r.experimentid
) GROUP BY plannerName, experimentid ORDER BY avg_solved DESC, avg_total_time ASC;
CREATE VIEW IF NOT EXISTS bestPlannerConfigs AS
SELECT plannerid, MIN(avg_solved) AS avg_solved, avg_total_time FROM (
  SELECT r.plannerid, p.name AS plannerName, {_MEANS} {_ALL} GROUP BY r.plannerid
) GROUP BY plannerName ORDER BY avg_solved DESC, avg_total_time ASC;
"""
"""Views that OMPL's reader adds."""


class StoreError(PushplanError, ValueError):
    """A file or folder of results cannot be used."""


# --- writing ----------------------------------------------------------------------------------------------------


class Store:
    """Database of a benchmark, with one writing process and one commit per result.

    Attributes:
        path: Path of the file.
    """

    def __init__(self, path: Path) -> None:
        """Open the file, or create it.

        Raises:
            StoreError: If it is not a file of results of this version, or another program has locked it.
        """
        self.path = path
        if check_output(path).streamed:
            raise StoreError(f"{path} is a pipe or a device; name another folder")
        self._database = sqlite3.connect(path, timeout=BUSY, isolation_level=None)
        try:
            self._prepare()
        except BaseException as error:
            self._database.close()
            if not isinstance(error, sqlite3.DatabaseError):
                raise
            if _is_busy(error):
                raise StoreError(f"another program has locked {path}; close it there") from error
            raise StoreError(f"{path} is not a file of results: {error}") from error

    def _prepare(self) -> None:
        run = self._database.execute
        for pragma in ("foreign_keys = ON", "journal_mode = WAL", "synchronous = NORMAL"):
            run(f"PRAGMA {pragma}")
        with self._transaction():
            for statement in (TABLES + VIEWS).split(";"):
                run(statement)
            self._database.executemany("INSERT OR IGNORE INTO enums VALUES ('status', ?, ?)", enumerate(STATUSES))
        known = [[row[1] for row in run(f"PRAGMA table_info({name})")] for name in ("runs", "pushplan_runs")]
        if known[0][3:] != list(ATTRIBUTES) or "cpu" not in known[1]:
            raise StoreError(
                f"{self.path} is from another version of pushplan, with other quantities; name another folder"
            )

    def close(self) -> None:
        """Close the file and merge its write-ahead log into it.

        The log stays while another program has the file open; SQLite reads both as one.
        """
        with contextlib.suppress(sqlite3.OperationalError):  # file and log together still hold all results
            self._database.execute("PRAGMA journal_mode = DELETE")
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        """Convert database errors to StoreError."""
        try:
            yield
        except sqlite3.Error as error:
            if _is_busy(error):
                raise StoreError(f"another program has locked {self.path}; close it there, then --resume") from error
            raise StoreError(f"cannot write {self.path}: {error}; earlier results are kept") from error

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """Commit everything inside, or nothing."""
        with self._reporting():
            self._database.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._database.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):  # SQLite itself rolls back some failed transactions
                    self._database.execute("ROLLBACK")
                raise

    def expect(self, suite: Suite, runs: Sequence[RunSpec], machine: Machine, version: str) -> None:
        """Store the current runs of the suite; results of earlier runs stay."""
        values = (FORMAT, suite.name, suite.source, version, json.dumps(machine.versions), machine.text, now())
        rows = [(r.key, i, r.problem.name, r.label, r.stable_set, r.seed) for i, r in enumerate(runs)]
        with self._transaction():
            self._database.execute(
                "INSERT INTO pushplan_suite VALUES (1, ?, ?, ?, ?, ?, ?, ?, 0.0) ON CONFLICT (id) DO UPDATE SET "
                "format = excluded.format, name = excluded.name, source = excluded.source, "
                "version = excluded.version, versions = excluded.versions, machine = excluded.machine",
                values,
            )
            self._database.execute("UPDATE pushplan_runs SET number = NULL")
            self._database.executemany(
                "INSERT INTO pushplan_runs (key, number, problem, planner, stable_set, seed) "
                "VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT (key) DO UPDATE SET "
                "number = excluded.number, problem = excluded.problem, planner = excluded.planner",
                rows,
            )
            for problem, parameters in zip(suite.problems, _parameters(suite.problems), strict=True):
                self._expect_problem(problem, parameters, suite, machine, version)

    def _expect_problem(
        self, problem: Problem, parameters: tuple[object, ...], suite: Suite, machine: Machine, version: str
    ) -> None:
        known = self._experiment(problem, version)
        if known is not None:
            self._database.execute(
                f"UPDATE experiments SET ({', '.join(PARAMETERS)}) = (?, ?, ?, ?) WHERE id = ?", (*parameters, known)
            )
            return
        seeds = ",".join(str(seed) for seed in suite.seeds)
        row = (
            problem.family,
            0.0,
            max(planner.time or 0.0 for planner in suite.planners),
            suite.limits.memory,
            0,
            f"pushplan {version}",
            machine.host,
            machine.text,
            now(),
            seeds if len(seeds) <= 24 else f"{seeds[:21]}...",
            _setup(problem),
        )
        self._insert("experiments", (None, *row, *parameters))

    def _experiment(self, problem: Problem, version: str) -> int | None:
        query = "SELECT id FROM experiments WHERE setup = ? AND version = ?"
        return self._single(query, (_setup(problem), f"pushplan {version}"))

    def _single(self, query: str, values: tuple[object, ...]) -> int | None:
        row = self._database.execute(query, values).fetchone()
        return None if row is None else int(row[0])

    def _insert(self, table: str, row: tuple[object, ...]) -> int:
        places = ", ".join("?" * len(row))
        return int(self._database.execute(f"INSERT INTO {table} VALUES ({places})", row).lastrowid or 0)

    def done(self) -> set[str]:
        """Return the keys of all runs with a result."""
        query = "SELECT key FROM pushplan_runs WHERE outcome IS NOT NULL"
        with self._reporting():
            return {key for (key,) in self._database.execute(query)}

    def add(self, run: RunSpec, result: Outcome, log: str | None) -> None:
        """Store the result of an expected run; it replaces an earlier one.

        Args:
            run: The run.
            result: Outcome of the run.
            log: File name of its log relative to the folder of results, or None.
        """
        own = {"solved": int(result.status == OK), "status": STATUSES.index(result.status), "seed": run.seed}
        values = {**result.values, **own}
        with self._transaction():
            experiment = self._experiment(run.problem, run.version)
            self._database.execute(
                "DELETE FROM runs WHERE id = (SELECT runid FROM pushplan_runs WHERE key = ?)", (run.key,)
            )
            settings = {**planner_settings(run.planner), "set": run.stable_set}
            text = "".join(f"{name} = {value}\n" for name, value in settings.items())
            planner = (f"{run.label} ({run.stable_set})", text)
            known = self._single("SELECT id FROM plannerConfigs WHERE name = ? AND settings = ?", planner)
            by = self._insert("plannerConfigs", (None, *planner)) if known is None else known
            number = self._insert("runs", (None, experiment, by, *(values.get(name) for name in ATTRIBUTES)))
            self._database.execute(
                f"UPDATE pushplan_runs SET ({RESULT}) = (?, ?, ?, ?, ?, ?, ?, ?) WHERE key = ?",
                (
                    *(number, result.status, result.message, json.dumps(result.arcs), log),
                    *(result.host, result.cpu, now(), run.key),
                ),
            )
            points = sampled(result.progress, result.values.get("time") or 0.0)
            self._database.executemany(f"INSERT INTO progress VALUES ({number}, ?, ?, ?)", points)
            self._database.execute(f"{COUNTED} WHERE id = ?", (experiment,))

    def take(self, path: Path) -> list[tuple[str, str | None]]:
        """Copy the results of another file that this file lacks; the first file also gives the suite.

        Returns:
            Key and log of every run with a result in the other file.

        Raises:
            StoreError: If the file is from another suite or another version, or cannot be read.
        """
        run, columns = self._database.execute, "key, number, problem, planner, stable_set, seed"
        suite = "SELECT format, version, source FROM {}.pushplan_suite"
        selected = f"SELECT {columns} FROM {{}}.pushplan_runs WHERE number IS NOT NULL ORDER BY number"
        if not path.is_file():
            raise StoreError(f"{path}: there are no results")
        try:
            run("ATTACH ? AS shard", (str(path),))
            run("BEGIN")
            if not run(suite.format("main")).fetchall():
                run("INSERT INTO pushplan_suite SELECT * FROM shard.pushplan_suite WHERE format = ?", (FORMAT,))
                run(f"INSERT INTO pushplan_runs ({columns}) {selected.format('shard')}")
            else:
                run("UPDATE pushplan_suite SET seconds = seconds + (SELECT seconds FROM shard.pushplan_suite)")
                its = "(SELECT machine FROM shard.pushplan_suite)"
                run(f"UPDATE pushplan_suite SET machine = machine || '; ' || {its} WHERE instr(machine, {its}) = 0")
            for query in (suite, selected):
                if run(query.format("shard")).fetchall() != run(query.format("main")).fetchall():
                    raise StoreError(f"{path} is from another suite or another version than the first folder")
            for table, same in (("experiments", "setup, version"), ("plannerConfigs", "name, settings")):
                names = ", ".join(row[1] for row in run(f"PRAGMA table_info({table})").fetchall()[1:])
                new = f"SELECT {names} FROM shard.{table} WHERE ({same}) NOT IN (SELECT {same} FROM main.{table})"
                run(f"INSERT INTO {table} ({names}) {new}")
            new = (
                "FROM shard.pushplan_runs s WHERE outcome IS NOT NULL "
                "AND key IN (SELECT key FROM main.pushplan_runs WHERE outcome IS NULL)"
            )
            more = int(run("SELECT IFNULL(MAX(id), 0) FROM main.runs").fetchone()[0])  # offset of their ids
            run(
                f"INSERT INTO runs SELECT r.id + {more}, e.id, p.id, {', '.join(f'r.{name}' for name in ATTRIBUTES)} "
                "FROM shard.runs r JOIN shard.experiments f ON f.id = r.experimentid "
                "JOIN shard.plannerConfigs q ON q.id = r.plannerid "
                "JOIN main.experiments e ON (e.setup, e.version) = (f.setup, f.version) "
                "JOIN main.plannerConfigs p ON (p.name, p.settings) = (q.name, q.settings) "
                f"WHERE r.id IN (SELECT runid {new})"
            )
            points = f"SELECT runid + {more}, time, best_cost, iterations FROM shard.progress"
            run(f"INSERT INTO progress {points} WHERE runid IN (SELECT runid {new})")
            its = f"SELECT runid + {more}, {RESULT.partition(', ')[2]} FROM shard.pushplan_runs s WHERE s.key = m.key"
            run(f"UPDATE main.pushplan_runs AS m SET ({RESULT}) = ({its}) WHERE key IN (SELECT key {new})")
            run(COUNTED)
            run("COMMIT")
            over = run("SELECT key, log FROM shard.pushplan_runs WHERE outcome IS NOT NULL").fetchall()
            run("DETACH shard")
        except sqlite3.Error as error:
            raise StoreError(f"{path} cannot be merged: {error}") from error
        return over

    def spent(self, seconds: float) -> None:
        """Add to the wall-clock time of the benchmark."""
        with self._reporting():
            self._database.execute("UPDATE pushplan_suite SET seconds = seconds + ?", (seconds,))


def sampled(improvements: Sequence[tuple[float, float, int]], end: float) -> list[tuple[float, float, int]]:
    """Return time (s), best cost and iterations at each improvement, and at `SAMPLES` regular times up to `end`."""
    if not improvements:
        return []
    moments = [point[0] for point in improvements]
    end = max(end, moments[-1])
    times = sorted({*moments, *(end * (i + 1) / SAMPLES for i in range(SAMPLES))})
    known = ((time, bisect_right(moments, time)) for time in times)
    return [(time, *improvements[count - 1][1:]) for time, count in known if count]


def _setup(problem: Problem) -> str:
    """Return the text of a problem in `experiments`, unique by its hash."""
    return f"# {problem.name}, SHA-256 {problem.hash}\n{problem.source.decode('utf-8')}"


def _parameters(problems: Sequence[Problem]) -> list[tuple[object, ...]]:
    """Return the values of `PARAMETERS` for each problem, None if all problems of its family have the same value."""
    rows = [(p.counts[0], p.instance, *p.counts[1:]) for p in problems]
    families: dict[str, list[set[object]]] = {}
    for problem, row in zip(problems, rows, strict=True):
        for values, value in zip(families.setdefault(problem.family, [set() for _ in row]), row, strict=True):
            values.add(value)
    return [
        tuple(value if len(values) > 1 else None for value, values in zip(row, families[p.family], strict=True))
        for p, row in zip(problems, rows, strict=True)
    ]


def _is_busy(error: sqlite3.Error) -> bool:
    """Return whether the error occurred because another program has locked the file."""
    return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY


def now() -> str:
    """Return the current time as ISO text."""
    return datetime.now(UTC).isoformat(timespec="seconds")


# --- the folder -------------------------------------------------------------------------------------------------


class ResultsFolder:
    """Folder of a benchmark: the database, a log for each run, the suite with its problems, and the report."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.database = path / "results.db"
        self.report = path / "report.html"
        self.scratch = path / ".scratch"  # temporary files of running runs

    @contextmanager
    def locked(self, overwrite: bool = False) -> Iterator[None]:
        """Create the folder if it is missing, and lock it against other benchmarks.

        Args:
            overwrite: Whether to accept a folder with other files, and to replace files with the names of results.

        Raises:
            StoreError: If another benchmark writes into it, it is a file, or it has files but no results.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except FileExistsError as error:
            raise StoreError(f"{self.path} is a file; allowed: a folder, or a new name") from error
        strange = {path.name for path in self.path.iterdir()} - {".lock", self.scratch.name}
        if strange and not self.database.exists() and not overwrite:
            what = f"{self.path} contains {sorted(strange)[0]!r} and is not a folder of results"
            raise StoreError(f"{what}; name another one, or use it with --overwrite")
        with os.fdopen(os.open(self.path / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC), "rb") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise StoreError(f"another benchmark is writing into {self.path}") from error
            shutil.rmtree(self.scratch, ignore_errors=True)
            self.scratch.mkdir()
            try:
                yield
            finally:
                shutil.rmtree(self.scratch, ignore_errors=True)

    def keep_suite(self, suite: Suite) -> None:
        """Write the suite and its problems into the folder, as documentation of the runs."""
        write_whole(self.path / "suite.yaml", suite.source)
        (self.path / "problems").mkdir(exist_ok=True)
        for problem in suite.problems:
            write_whole(self.path / "problems" / f"{_plain(problem.name)}.yaml", problem.source)

    def copy(self, other: ResultsFolder, name: str) -> None:
        """Copy a file or a folder from another folder of results, if it is there."""
        source, target = other.path / name, self.path / name
        target.parent.mkdir(exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target, dirs_exist_ok=True)
        elif source.exists():
            shutil.copyfile(source, target)

    def keep_log(self, run: RunSpec, result: Outcome) -> str | None:
        """Write the log of a run, complete or not, over an earlier one; return its name in the folder."""
        (self.path / "logs").mkdir(exist_ok=True)
        stem = f"logs/{'-'.join(_plain(value) for value in run.fields.values())}-{run.key[:8]}.mcap"
        for name in (stem, f"{stem}.partial"):
            with contextlib.suppress(FileNotFoundError):
                (self.path / name).unlink()
        if result.log is None:
            return None
        name = stem if result.whole else f"{stem}.partial"
        write_whole(self.path / name, result.log)
        return name


def _plain(name: str) -> str:
    """Return a name with all characters replaced that file names cannot hold."""
    return re.sub(r"[^\w.+-]+", "_", name, flags=re.ASCII)
