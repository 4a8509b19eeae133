"""Each extension of docs/contributing.md, made by a package outside this one: `outside/warehouse`.

Its files are the recipes; none of them edits anything here, and what it adds is found by its entry points alone.
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
from pushplan.cli.main import main
from pushplan.mechanics.support import FeetSupport
from pushplan.planners.searches import SEARCHES
from pushplan.plans.segment import end_of
from pushplan.scenario.goals import End, Goal, Poses, TaskGoal
from pushplan.scenario.task import Task, Transport
from pushplan.sim.slip import slip

OUTSIDE = Path(__file__).with_name("outside")


@pytest.fixture(autouse=True)
def installed(monkeypatch: Patch) -> Iterator[None]:
    """The package is on the path as an installed one is; nothing of it is left over."""
    monkeypatch.syspath_prepend(OUTSIDE)
    yield
    for name in [name for name in sys.modules if name.partition(".")[0] == "warehouse"]:
        del sys.modules[name]


def test_a_support_model_is_pushed_like_the_points_that_it_stands_for() -> None:
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


def test_an_exporter_writes_what_a_run_holds(tmp_path: Path, capsys: Captured) -> None:
    log, table = tmp_path / "run.mcap", tmp_path / "places.tsv"
    assert main(["plan", "two-crates", "--first", "-o", str(log)]) == 0
    assert main(["replay", str(log), "--export", f"places={table}"]) == 0
    run = pushplan.load_run(log)
    rows = [line.split("\t") for line in table.read_text().splitlines()]
    assert [row[0] for row in rows] == list(there(run.execution).names)
    read = np.array([[float(word) for word in row[1:]] for row in rows])
    np.testing.assert_allclose(read, there(run.execution).objects[-1], atol=1e-4)
    assert main(["replay", str(log), "--export", f"nobody={table}"]) == 2
    assert "'nobody' is not known; allowed: module:attribute" in capsys.readouterr().err


def test_a_simulator_executes_trials(capsys: Captured) -> None:
    rates = []
    for simulator in ("slip", "wet-floor"):
        with first_plans():
            assert main(["trial", "two-crates", "--samples", "3", "--json", "--simulator", simulator]) == 0
        rates.append(json.loads(capsys.readouterr().out)["held"])
    assert rates[0] > rates[1]


def test_a_command_is_called_by_its_name(capsys: Captured) -> None:
    assert main(["distance", "two-crates", "--json"]) == 0
    scenario = pushplan.load_scenario("two-crates")
    far = np.hypot(*(scenario.goal.pose_chain - scenario.start)[:2])
    assert json.loads(capsys.readouterr().out)["distance"] == pytest.approx(far)
    assert main(["distanc", "two-crates"]) == 2


@dataclass(frozen=True, eq=False)
class FreeHeading(TaskGoal):
    """A place for a load, whose heading is free."""

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
