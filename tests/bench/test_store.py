"""The database against OMPL's own reader, validated outcomes, and random problems."""

import importlib.util
import sqlite3
from collections.abc import Generator, Iterable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import shapely
from conftest import Patch, there

import pushplan
import pushplan.bench.batch as batch
import pushplan.bench.store as store
from pushplan.bench.batch import run_suite
from pushplan.bench.outcome import ATTRIBUTES, STATUSES, Outcome, clearance, validated, validation_error
from pushplan.bench.random_problems import DRIVES, LEAST_MARGIN, generate, tightest_turn
from pushplan.bench.schema import ProblemParameters
from pushplan.bench.store import PARAMETERS, ResultsFolder
from pushplan.bench.suite import RunSpec, suite_from_text
from pushplan.plans.plan import Plan
from pushplan.plans.run import Run
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle
from pushplan.sets.named import stable_set
from pushplan.util.stopwatch import Stopwatch

SUITE = """\
format: pushplan-suite/1
problems: [one-box, {name: random, generate: {objects: 2, obstacles: [5, 9]}, count: 2, seed: 2}]
planners: [auto, {name: rrt, first: true}]
seeds: 4
"""
TABLES = ("experiments", "plannerConfigs", "enums", "runs", "progress")
VIEWS = ("bestPlannerConfigsPerExperiment", "bestPlannerConfigs")


def _engine(specs: Iterable[RunSpec]) -> Generator[Outcome]:
    """Return every status now and then, with its values."""
    for spec in specs:
        status = STATUSES[(spec.seed + len(spec.problem.name)) % len(STATUSES)]
        values = {"total_time": 1.0}
        if status in ("ok", "invalid"):
            values |= {"time": 0.1 * spec.seed, "solution_length": 1.0 + spec.seed, "min_margin": 0.1}
            progress = ((0.01, 2.0, 5), (0.02, 1.5, 9), (0.02, 1.4, 9), (0.1, 1.0 + spec.seed, 20))
            yield Outcome(spec.key, status, "", values, ((1.0, 0.0, 0.0, 2.0),), progress, b"log", True, "here")
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
    specification = there(importlib.util.spec_from_file_location("reader", f"{folder}/_benchmark_statistics.py"))
    module = importlib.util.module_from_spec(specification)
    there(specification.loader).exec_module(module)
    return module


def _columns(database: sqlite3.Connection, table: str) -> list[tuple[str, str]]:
    return [(row[1], row[2]) for row in database.execute(f"PRAGMA table_info({table})")]


def _ompl_log(database: sqlite3.Connection, experiment: tuple[Any, ...]) -> str:
    """Return one experiment in the format of OMPL's benchmarks."""
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
    query = "SELECT DISTINCT p.* FROM plannerConfigs p JOIN runs r ON r.plannerid = p.id WHERE r.experimentid = ?"
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
            sorted(map(str, db.execute(f"SELECT * FROM {table} ORDER BY 1, 2").fetchall())) for db in (ours, theirs)
        )
        if table not in ("runs", "progress"):
            assert (table, first) == (table, second)
        assert len(first) == len(second) > 0
    ours.close()
    theirs.close()


# A run of a batch counts as solved only with the margin that its plan kept, and only if it holds with inertia.


@pytest.fixture(scope="module")
def done() -> Run:
    """Return a run with all defaults."""
    return pushplan.run(pushplan.load_scenario("one-box"), iterations=2000, time_limit=600.0)


def quasi_static(plan: Plan) -> Plan:
    """Return the plan with inertia left out of its scenario."""
    chain = plan.scenario.chain
    still = replace(chain.pusher, limits=replace(chain.pusher.limits, contact="quasi-static"))
    return replace(plan, scenario=plan.scenario.with_load(chain=replace(chain, pusher=still)))


@pytest.mark.parametrize("fate", ["locked", "full"])
def test_a_full_database_is_reported_and_the_rest_is_run_later(fate: str, tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setattr(store, "BUSY", 0.1)
    folder, suite = ResultsFolder(tmp_path), suite_from_text(SUITE)
    others: list[sqlite3.Connection] = []

    def failing(specs: Iterable[RunSpec]) -> Generator[Outcome]:
        for k, outcome in enumerate(_engine(specs)):
            if k == 3 and fate == "locked":
                others.append(sqlite3.connect(folder.database, isolation_level=None))
                others[0].execute("BEGIN IMMEDIATE")
            elif k == 3:
                opened[0]._database.execute("PRAGMA max_page_count = 1")  # the database is now full
            yield replace(outcome, message="x" * 100_000)

    class Noted(store.Store):
        def __init__(self, path: Path) -> None:
            super().__init__(path)
            opened.append(self)

    opened: list[store.Store] = []
    monkeypatch.setattr(batch, "Store", Noted)
    words = {"locked": "another program has locked .*", "full": "cannot write .*full"}
    with folder.locked(), pytest.raises(store.StoreError, match=words[fate]):
        run_suite(suite, folder, failing, version="1")
    for other in others:
        other.close()
    with folder.locked():
        tally = run_suite(suite, folder, _engine, batch.Selection(resume=True), version="1")
    assert tally.before == 3
    assert tally.left == 0


def test_an_execution_that_slips_with_inertia_is_not_a_solution(done: Run) -> None:
    plan, execution = done.plan, there(done.execution)
    assert validation_error(plan, execution) == ""
    values = there(execution.dynamic_margins).copy()
    values[len(values) // 2, 0] = 0.0
    slipping = replace(execution, dynamic_margins=values)
    assert validation_error(plan, slipping) == "the smallest margin with inertia is 0; it must be above 0"
    assert validation_error(quasi_static(plan), slipping) == ""
    unseen = replace(execution, dynamic_margins=None)
    assert validation_error(plan, unseen) == "the execution has no margins with inertia"
    assert validation_error(quasi_static(plan), unseen) == ""


def test_the_outcome_of_a_run_has_its_margins(done: Run) -> None:
    found = validated("", done.scenario, done, Stopwatch())
    assert (found.status, found.message) == ("ok", "")
    execution, margins = there(done.execution), there(there(done.execution).dynamic_margins)
    assert found.values["margin"] == done.plan.margin
    assert found.values["min_margin"] == execution.margins.min()
    assert found.values["min_dynamic_margin"] == margins.min()
    slipping = replace(execution, dynamic_margins=np.full_like(margins, -0.1))
    lost = validated("", done.scenario, replace(done, execution=slipping), Stopwatch())
    assert (lost.status, lost.values["min_dynamic_margin"]) == ("invalid", -0.1)


def test_an_execution_is_validated_with_the_actual_object_poses() -> None:
    """An obstacle at the poses of a chain that the robot would hold all the time does not count."""
    rooms = ProblemParameters(objects=(1, 1), obstacles=(0, 0), drives=DRIVES, robot=(0.5, 1.0))
    scenario = scenario_from_text(generate(rooms, 1))
    result = pushplan.plan(scenario, first=True, time_limit=60.0)
    execution = there(result.execution)
    assert validation_error(result, execution) == ""
    assert (clearance(scenario, execution) or 0.0) > 0.0
    middle = execution.objects[len(execution.t) // 2, 0, :2]
    hit = replace(result, scenario=replace(scenario, obstacles=(CircleObstacle(middle, 0.02),)))
    assert str(hit.scenario.obstacles[0]) in validation_error(hit, execution)


VARIED = ProblemParameters(drives=DRIVES, supports=("uniform", "feet"))


def _scenario(parameters: ProblemParameters, seed: int) -> Scenario:
    return scenario_from_text(generate(parameters, seed))


@pytest.mark.parametrize("seed", range(6))
def test_problems_pass_the_loader_and_their_chains_can_be_pushed(seed: int) -> None:
    scenario = _scenario(VARIED, seed)
    chain = scenario.chain
    assert 1 <= len(chain.objects) <= 5
    assert len(scenario.obstacles) <= 30
    assert stable_set(chain, "ecof").margin([[1.0, 0.0, 0.0]])[0] > LEAST_MARGIN
    assert np.isfinite(tightest_turn(chain, VARIED.turning_radius))


def test_the_same_seed_gives_the_same_text_and_another_one_another() -> None:
    texts = [generate(VARIED, seed) for seed in (3, 3, 4)]
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.parametrize("seed", range(2))
def test_a_wall_with_a_gap_separates_start_and_goal(seed: int) -> None:
    parameters = ProblemParameters(gap=(1.5, 2.0), obstacles=(0, 0))
    scenario = _scenario(parameters, seed)
    assert len(scenario.obstacles) == 2
    assert not any(isinstance(piece, CircleObstacle) for piece in scenario.obstacles)
    sides = [shapely.Polygon(piece.outline) for piece in scenario.obstacles]  # type: ignore[union-attr]
    chain, pusher = scenario.chain, scenario.chain.pusher.outline
    width = np.ptp(np.concatenate([pusher, *(obj.outline_chain for obj in chain.objects)])[:, 1])
    assert 1.49 * width <= sides[0].distance(sides[1]) <= 2.01 * width
    way = shapely.LineString([scenario.start[:2], scenario.goal.pose_chain[:2]])
    assert way.intersects(shapely.union_all(sides).convex_hull)
