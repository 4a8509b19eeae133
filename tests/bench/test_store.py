"""The database: the same tables as OMPL's own reader makes of a benchmark log, opened by Planner Arena itself."""

import importlib.util
import sqlite3
from collections.abc import Generator, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from pushplan.bench.batch import run_suite
from pushplan.bench.outcome import ATTRIBUTES, STATUSES, Outcome
from pushplan.bench.store import PARAMETERS, ResultsFolder, Store, StoreError, read_results
from pushplan.bench.suite import RunSpec, suite_from_text

SUITE = """\
format: pushplan-suite/1
problems: [one-box, {name: random, generate: {objects: 2, obstacles: [5, 9]}, count: 2, seed: 2}]
planners: [auto, {name: rrt, first: true}]
seeds: 4
"""

TABLES = ("experiments", "plannerConfigs", "enums", "runs", "progress")
VIEWS = ("bestPlannerConfigsPerExperiment", "bestPlannerConfigs")


def _engine(specs: Iterable[RunSpec]) -> Generator[Outcome]:
    """Every status once in a while, with values where there are any."""
    for spec in specs:
        status = STATUSES[(spec.seed + len(spec.problem.name)) % len(STATUSES)]
        values = {"total_time": 1.0}
        if status in ("ok", "invalid"):
            values |= {"time": 0.1 * spec.seed, "solution_length": 1.0 + spec.seed, "min_margin": 0.1}
            progress = ((0.01, 2.0, 5), (0.02, 1.5, 9), (0.02, 1.4, 9), (0.1, 1.0 + spec.seed, 20))
            yield Outcome(
                spec.key, status, "", values, ((1.0, 0.0, 0.0, 2.0),), progress, b"log", True, "here"
            )
        else:
            yield Outcome(spec.key, status, status, values)


@pytest.fixture
def database(tmp_path: Path) -> Path:
    folder = ResultsFolder(tmp_path)
    with folder.locked():
        run_suite(suite_from_text(SUITE), folder, _engine, version="1")
    return folder.database


def _ompl_reader() -> ModuleType:
    (folder,) = importlib.util.find_spec("ompl").submodule_search_locations or []  # type: ignore[union-attr]
    specification = importlib.util.spec_from_file_location("reader", f"{folder}/_benchmark_statistics.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def _columns(database: sqlite3.Connection, table: str) -> list[tuple[str, str]]:
    return [(row[1], row[2]) for row in database.execute(f"PRAGMA table_info({table})")]


def _ompl_log(database: sqlite3.Connection, experiment: tuple[Any, ...]) -> str:
    """Return one experiment as OMPL's benchmarks write it."""
    columns = _columns(database, "experiments")
    fixed = dict(zip([name for name, _ in columns], experiment, strict=True))
    measured = _columns(database, "progress")[2:]
    lines = [
        f"OMPL version {fixed['version']}",
        f"Experiment {fixed['name']}",
        f"{len(PARAMETERS)} experiment properties",
        *(f"{name} {kind} = {fixed[name]}" for name, kind in columns[12:]),
        f"Running on {fixed['hostname']}",
        f"Starting at {fixed['date']}",
        f"<<<|\n{fixed['setup']}\n|>>>\n<<<|\n{fixed['cpuinfo']}\n|>>>",
        "1 is the random seed",
        f"{fixed['timelimit']} seconds per run\n{fixed['memorylimit']} MB per run\n4 runs per planner",
        f"{fixed['totaltime']} seconds spent to collect the data",
        f"1 enum type\nstatus|{'|'.join(STATUSES)}",
    ]
    query = (
        "SELECT DISTINCT p.* FROM plannerConfigs p JOIN runs r ON r.plannerid = p.id WHERE r.experimentid = ?"
    )
    planners = database.execute(query, (fixed["id"],)).fetchall()
    lines.append(f"{len(planners)} planners")
    for number, name, settings in planners:
        runs = database.execute(
            "SELECT * FROM runs WHERE experimentid = ? AND plannerid = ?", (fixed["id"], number)
        ).fetchall()
        lines += [name, f"{settings.count(chr(10))} common properties", settings.rstrip()]
        lines += [f"{len(ATTRIBUTES)} properties for each run"]
        lines += [f"{column} {kind}" for column, kind in ATTRIBUTES.items()]
        lines += [f"{len(runs)} runs"]
        lines += ["".join(f"{'' if value is None else value}; " for value in run[3:]) for run in runs]
        lines += ["3 progress properties for each run", "time REAL"]
        lines += [f"{column} {kind}" for column, kind in measured]
        lines += [f"{len(runs)} runs"]
        for run in runs:
            points = database.execute("SELECT * FROM progress WHERE runid = ?", (run[0],)).fetchall()
            lines.append("".join("".join(f"{value}," for value in point[1:]) + ";" for point in points))
        lines.append(".")
    return "\n".join(lines) + "\n"


def test_tables_columns_and_views_are_those_that_ompls_reader_makes(database: Path, tmp_path: Path) -> None:
    ours = sqlite3.connect(database)
    logs = []
    for experiment in ours.execute("SELECT * FROM experiments").fetchall():
        logs.append(tmp_path / f"{experiment[0]}.log")
        logs[-1].write_text(_ompl_log(ours, experiment))
    reader, made = _ompl_reader(), tmp_path / "ompl.db"
    reader.readBenchmarkLog(str(made), [str(log) for log in logs], False)
    reader.computeViews(str(made), False)
    theirs = sqlite3.connect(made)
    for table in TABLES:
        assert (table, _columns(ours, table)) == (table, _columns(theirs, table))
    for table in ("runs", "progress", "enums", *VIEWS):
        first, second = (
            sorted(map(str, db.execute(f"SELECT * FROM {table} ORDER BY 1, 2").fetchall()))
            for db in (ours, theirs)
        )
        if table not in ("runs", "progress"):
            assert (table, first) == (table, second)
        assert len(first) == len(second) > 0
    ours.close()
    theirs.close()


def test_only_what_differs_within_a_family_is_a_parameter(database: Path) -> None:
    ours = sqlite3.connect(database)
    for name in PARAMETERS:
        counts = dict(ours.execute(f"SELECT name, COUNT(DISTINCT {name}) FROM experiments GROUP BY name"))
        assert (name, counts["one-box"]) == (name, 0)
        assert (name, counts["random"]) == (name, 2 if name in ("instance", "obstacles") else 0)
    ours.close()


def test_what_is_no_file_of_results_is_refused(tmp_path: Path, database: Path) -> None:
    other = tmp_path / "other.db"
    other.write_text("this is no database, and long enough to be taken for one by its size " * 20)
    with pytest.raises(StoreError, match=r"other\.db is no file of results: file is not a database"):
        Store(other)
    with pytest.raises(StoreError, match=r"results\.db: there are no results"):
        read_results(tmp_path / "problems")
    ours = sqlite3.connect(database)
    ours.execute("ALTER TABLE runs DROP COLUMN margin")
    ours.execute("UPDATE pushplan_suite SET format = 1")
    ours.commit()
    ours.close()
    with pytest.raises(StoreError, match=r"of another version of pushplan, .*; name another folder$"):
        Store(database)
    with pytest.raises(StoreError, match=r"has format 1; this version reads format 2"):
        read_results(database)


def test_a_run_in_the_middle_of_being_written_is_not_there(database: Path) -> None:
    """A commit holds a run with its progress, or nothing of it."""
    before = read_results(database)
    run = next(suite_from_text(SUITE).runs("1"))
    broken = Outcome(run.key, "crash", "", progress=((0.0, object(), 1),))  # type: ignore[arg-type]
    with Store(database) as store, pytest.raises(sqlite3.ProgrammingError):
        store.add(run, broken, None)
    after = read_results(database)
    assert after.runs.equals(before.runs)
    assert after.progress.equals(before.progress)
