"""Each extension of docs/contributing.md, made by a third-party package, `outside/warehouse`. Its files are the
recipes. They edit nothing here, and only their entry points register them.
"""

import importlib
import json
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Captured, Patch, there
from rough import first_plans

import pushplan
import pushplan.logging.reader as reader
import pushplan.logging.schemas as schemas
import pushplan.verification as verification
from pushplan.cli.main import main
from pushplan.logging.page import render
from pushplan.logging.reader import load_run
from pushplan.logging.signals import SIGNALS, Signal, check_signals
from pushplan.logging.tables import table
from pushplan.logging.writer import RunLogWriter
from pushplan.mechanics.support import FeetSupport
from pushplan.planners.searches import SEARCHES
from pushplan.plans.execution import Execution
from pushplan.plans.segment import end_of
from pushplan.scenario.goals import End, Goal, Poses, TaskGoal
from pushplan.scenario.task import Task, Transport
from pushplan.sim.kinematic import execute
from pushplan.sim.slip import slip
from pushplan.util.arrays import FloatArray
from pushplan.verification import verify_log

OUTSIDE = Path(__file__).with_name("outside")


@pytest.fixture(autouse=True)
def installed(monkeypatch: Patch) -> Iterator[None]:
    """Put the package on the path like an installed one, and remove all traces of it afterwards."""
    monkeypatch.syspath_prepend(OUTSIDE)
    yield
    for name in [name for name in sys.modules if name.partition(".")[0] == "warehouse"]:
        del sys.modules[name]


def test_a_support_model_is_pushed_like_its_points() -> None:
    ring = importlib.import_module("warehouse.supports").RingSupport(0.05)
    scenario = pushplan.load_scenario("one-box")
    plans = []
    for support in (ring, FeetSupport(ring.hull, ring.point_loads.fractions)):
        objects = (replace(scenario.chain.objects[0], support=support),)
        stated = scenario.with_load(chain=replace(scenario.chain, objects=objects))
        plans.append(pushplan.plan(stated, seed=1, iterations=300, time_limit=60.0))
        assert plans[-1].solved
        held = slip(plans[-1], pushplan.World.from_scenario(stated))
        assert held.kept
    first, second = plans
    np.testing.assert_array_equal(there(first.execution).margins, there(second.execution).margins)
    assert vars(there(first.robustness)) == pytest.approx(vars(there(second.robustness)), rel=1e-9)


@pytest.mark.parametrize("given", ["wide-turns", "warehouse.sets:WideTurnsSet"])
def test_a_stable_set_limits_a_plan(given: str, tmp_path: Path, capsys: Captured) -> None:
    log = tmp_path / "run.mcap"
    assert main(["plan", "one-box", "--set", given, "--first", "--json", "-o", str(log)]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["set"] == "wide-turns"
    for arc in plan["arcs"]:
        vx, vy, omega = arc["twist"]
        assert np.hypot(vx, vy) >= 0.5 * abs(omega)
    assert main(["replay", str(log), "--verify"]) == 0


@pytest.mark.parametrize("given", ["patient-rrt", "warehouse.planners:patient_rrt"])
def test_a_planner_plans(given: str, capsys: Captured) -> None:
    assert main(["plan", "one-box", "--planner", given, "--first", "--json", "--no-log"]) == 0
    assert json.loads(capsys.readouterr().out)["planner"] == given


def test_an_exporter_writes_the_contents_of_a_run(tmp_path: Path, capsys: Captured) -> None:
    log, table = tmp_path / "run.mcap", tmp_path / "places.tsv"
    assert main(["plan", "two-crates", "--first", "-o", str(log)]) == 0
    assert main(["replay", str(log), "--export", f"places={table}"]) == 0
    run = pushplan.load_run(log)
    rows = [line.split("\t") for line in table.read_text().splitlines()]
    assert [row[0] for row in rows] == list(there(run.execution).names)
    read = np.array([[float(word) for word in row[1:]] for row in rows])
    np.testing.assert_allclose(read, there(run.execution).objects[-1], atol=1e-4)
    assert main(["replay", str(log), "--export", f"nobody={table}"]) == 2
    assert "'nobody' is unknown; allowed: module:attribute" in capsys.readouterr().err


def test_a_simulator_executes_trials(capsys: Captured) -> None:
    rates = []
    for simulator in ("slip", "wet-floor"):
        with first_plans():
            assert main(["trial", "two-crates", "--samples", "3", "--json", "--simulator", simulator]) == 0
        rates.append(json.loads(capsys.readouterr().out)["held"])
    assert rates[0] > rates[1]


def test_a_command_runs_by_its_name(capsys: Captured) -> None:
    assert main(["distance", "two-crates", "--json"]) == 0
    scenario = pushplan.load_scenario("two-crates")
    far = np.hypot(*(scenario.goal.pose_chain - scenario.start)[:2])
    assert json.loads(capsys.readouterr().out)["distance"] == pytest.approx(far)
    assert main(["distanc", "two-crates"]) == 2


@dataclass(frozen=True, eq=False)
class FreeHeading(TaskGoal):
    """A goal of a load with a free heading."""

    load: str
    place: tuple[float, float]
    off: float = 0.01

    @property
    def names(self) -> tuple[str, ...]:
        return (self.load,)

    def candidates(self, load: str) -> tuple[Goal, ...]:
        poses = [np.array([*self.place, 0.25 * math.pi * k]) for k in range(8)]
        return tuple(Goal.of_chain(pose, (self.off, math.pi)) for pose in poses)

    def shortfall(self, end: End) -> str:
        away = float(np.hypot(*(end.start_of(self.load)[:2] - self.place)))
        return "" if away <= self.off else f"'{self.load}' is {away:.3g} m from its place"

    def document(self) -> dict[str, Any]:
        return {"goals": {self.load: {"place": list(self.place)}}}

    def aim(self, load: str) -> str:
        return "goes to its place, with any heading"


def test_a_goal_type_is_a_class_and_an_entry_in_the_table(monkeypatch: Patch) -> None:
    stated = pushplan.load_scenario(OUTSIDE.parents[2] / "examples" / "bring_it_home.yaml")
    goal = FreeHeading(stated.load.name, (1.35, 1.9))
    kinds: tuple[type[Task], type[TaskGoal]] = (Transport, FreeHeading)
    scenario = stated.with_task(goals=(goal,))
    with pytest.raises(pushplan.PlanningError, match="no search for a Transport with goals of types FreeHeading"):
        pushplan.plan(scenario)
    monkeypatch.setitem(SEARCHES, kinds, SEARCHES[Transport, Poses])
    plan = pushplan.plan(scenario, first=True, time_limit=60.0)
    assert plan.solved, plan.reason
    assert goal.fulfilled(end_of(scenario, plan.segments))
    missed = pushplan.Planner(stated).plan(explain=False)
    assert goal.shortfall(end_of(scenario, missed.segments)).endswith("m from its place")


@dataclass(frozen=True, eq=False)
class Geared(Execution):
    """An execution that records the power of the drive."""

    power: FloatArray | None = None


def _executed_with_power(*args: Any) -> Geared:
    """Return an execution with the power of the drive, W."""
    done = execute(*args)
    power = 20.0 * np.hypot(done.twists[:, 0], done.twists[:, 1]) + 1.5 * np.arange(len(done.t))
    return Geared(**{**vars(done), "power": power})


def _declared(monkeypatch: Patch, **more: Any) -> Signal:
    """Declare the series like an entry of the table at import, and return it."""
    made = Signal("power", "power of the drive", "W", ("power",), "plate", "/drive/power", "pusher", True, **more)
    check_signals(Geared, {**SIGNALS[Execution], made.name: made})
    monkeypatch.setitem(SIGNALS[Execution], made.name, made)
    monkeypatch.setattr(schemas, "TOPICS", (*schemas.TOPICS, schemas.signal_topic(made)))
    monkeypatch.setattr(schemas, "REVISION", made.since)
    monkeypatch.setattr(reader, "Execution", Geared)
    monkeypatch.setitem(SIGNALS, Geared, SIGNALS[Execution])
    monkeypatch.setattr(verification, "execute", _executed_with_power)
    return made


def _log(plan: pushplan.Plan, execution: Execution, path: Path) -> Path:
    with RunLogWriter.create(path, plan.scenario, {"set": plan.stable_set, "seed": plan.seed}) as log:
        log.plan(plan)
        log.execution(execution)
        log.finish("solved")
    return path


def test_a_signal_is_an_array_and_an_entry_in_the_table(tmp_path: Path, monkeypatch: Patch) -> None:
    with pytest.raises(TypeError, match="'power' must be a field of Geared and in logging/signals"):
        check_signals(Geared, SIGNALS[Execution])
    plan = pushplan.plan(pushplan.load_scenario("two-crates"), first=True, time_limit=60.0)
    done = _executed_with_power(plan.scenario, plan.segments, plan.stable_set)
    older = _log(plan, there(plan.execution), tmp_path / "older.mcap")
    signal = _declared(monkeypatch, since=schemas.REVISION + 1)
    run = load_run(_log(plan, done, tmp_path / "run.mcap"), messages=True)
    assert isinstance(run.execution, Geared)
    np.testing.assert_array_equal(run.execution.power, done.power)
    np.testing.assert_array_equal(table(run)["power"], done.power)
    sent = [schemas.signal_topic(signal).message.FromString(m.data) for m in run.messages if m.topic == signal.topic]
    assert (sent[-1].frame_id, sent[-1].power) == ("pusher", there(done.power)[-1])
    assert '"read_out":[["power","power of the drive","W"]]' in render(run)
    report = verify_log(run.path)
    assert report.matches
    assert "power of the drive" in {check.quantity for check in report.checks}
    other = _log(plan, replace(done, power=there(done.power) + 0.1), tmp_path / "other.mcap")
    assert [check.quantity for check in verify_log(other).mismatches] == ["power of the drive"]
    bare = _log(plan, replace(done, power=None), tmp_path / "bare.mcap")
    assert "power of the drive: unknown on one side" in [check.text for check in verify_log(bare).mismatches]
    report = verify_log(older)
    assert [check.text for check in report.mismatches] == []
    lacking = (signal.quantity, f"topic {signal.topic}")
    assert {f"{what} (the log is older)" for what in lacking} <= {*report.not_compared}
    monkeypatch.setitem(SIGNALS[Execution], "power", replace(signal, decided=False, topic="", frame=""))
    monkeypatch.setattr(schemas, "TOPICS", schemas.TOPICS[:-1])
    report = verify_log(_log(plan, replace(done, power=there(done.power) + 0.1), tmp_path / "measured.mcap"))
    assert report.matches
    assert "power of the drive (it does not follow from the plan)" in report.not_compared


@pytest.mark.parametrize(
    ("name", "changes", "error"),
    [
        ("margins", {"since": 1}, "have the default None"),
        ("lambdas", {"since": 1}, "newer series must be last"),
        ("objects", {"frame": "world"}, "only the plate has separate topics"),
        ("needed_forces", {"topic": "/margins"}, "contacts must be on /margins"),
        ("forces", {"topic": "/forces"}, "contacts must be on /margins"),
        ("twists", {"topic": "/plan/plan"}, "a message Plan already exists"),
    ],
)
def test_an_invalid_entry_is_refused(name: str, changes: dict[str, Any], error: str) -> None:
    entry = replace(SIGNALS[Execution][name], **changes)

    def declare() -> None:
        check_signals(Execution, {**SIGNALS[Execution], name: entry})
        schemas.signal_topic(entry)

    with pytest.raises(TypeError, match=error):
        declare()
