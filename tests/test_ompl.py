"""A push as an OMPL problem: exact chart and propagator, collision checks, and paths of any planner."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import there
from kinds import GAP
from ompl import base as ob
from ompl import control as oc
from ompl import util as ou

import pushplan
from pushplan.core.problem import Problem, arcs_at, controls_of
from pushplan.errors import ExtensionError, PlanningError
from pushplan.geometry import se2
from pushplan.ompl import pose, push_path
from pushplan.planners.clearance import find_collision
from pushplan.planners.search.form import leave_path, pose_of, state_at
from pushplan.planners.search.planners import planner_named
from pushplan.plans.path import PushPath, cost_rate
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import PLANNERS

STOCK = {"ompl.control:RRT": oc.RRT, "ompl.control:EST": oc.EST, "ompl.control:KPIECE1": oc.KPIECE1}


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    ou.setLogLevel(ou.LOG_NONE)
    return pushplan.load_scenario("two-crates")


def _solved(scenario: Scenario, planner: str) -> tuple[Any, Any]:
    information, definition = pose(scenario)
    made = planner_named(planner)[1](information)
    made.setProblemDefinition(definition)
    made.setup()
    ou.RNG.setSeed(3)
    end = ob.timedPlannerTerminationCondition(60.0)
    first = ob.PlannerTerminationCondition(lambda: end() or information.session.solved)
    assert made.solve(first).getStatus() == ob.PlannerStatus.EXACT_SOLUTION
    return information, definition


def _drawn_arcs(problem: Problem, count: int) -> FloatArray:
    """Return arcs from the ends and the inside of segments, and of random controls; some are longer than the
    longest.
    """
    rng = np.random.default_rng(0)
    share = rng.choice([0.0, 1.0, 0.3, 0.8], (count, 1))
    segments = problem.segments[rng.integers(len(problem.segments), size=count)]
    between = (1.0 - share) * segments[:, :3] + share * segments[:, 3:]
    controls = np.column_stack([rng.uniform(0.0, 1.0, (count, 3)), np.ones(count)])
    twists = np.concatenate([between / cost_rate(between)[:, None], arcs_at(problem, controls)[:, :3]])
    return np.column_stack([twists, rng.uniform(1e-6, 4.0 * problem.longest, len(twists))])


@pytest.mark.parametrize("name", ["two-crates", "carts", "feet"])
def test_coordinates_of_every_arc_are_invertible(name: str) -> None:
    problem = pose(pushplan.load_scenario(name))[0].session.problem
    arcs = _drawn_arcs(problem, 200)
    controls = controls_of(problem, arcs)
    assert ((controls[:, :3] >= 0.0) & (controls[:, :3] <= 1.0)).all()
    np.testing.assert_array_equal(controls[:, 3], np.ceil(arcs[:, 3] / problem.longest))
    np.testing.assert_allclose(arcs_at(problem, controls), arcs, atol=1e-12)


def test_propagation_is_exact_and_stable_and_marks_collisions(scenario: Scenario) -> None:
    information, _ = pose(scenario)
    stable, rng = scenario.stable_set(), np.random.default_rng(1)
    state, result = state_at(information, scenario.start), information.allocState()
    control = information.allocControl()
    outcomes = {True: 0, False: 0}
    for u in rng.uniform(0.0, 1.0, (400, 3)):
        control[0], control[1], control[2] = u
        information.propagate(state, control, 1, result)
        arc = arcs_at(information.session.problem, np.append(u, 1.0)[None])[0]
        assert stable.margin(arc[None, :3])[0] > 0.0
        path = PushPath(scenario.start, arc[None, :3], arc[3:])
        valid = information.isValid(result)
        outcomes[valid] += 1
        assert valid == information.satisfiesBounds(result)
        if valid:
            apart = pose_of(result) - path.end
            np.testing.assert_allclose([*apart[:2], math.remainder(apart[2], 2 * math.pi)], 0.0, atol=1e-12)
            assert find_collision(scenario, path.sampled(0.01)) is None
    assert min(outcomes.values()) > 20


@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_solves_the_problem_and_leaves_controls(planner: str, scenario: Scenario) -> None:
    if planner == "bottlenecks":  # it handles narrow gaps only
        scenario = pushplan.scenario_from_text(GAP).with_margin(0.02)
    _information, definition = _solved(scenario, planner)  # it owns its states
    solution = definition.getSolutionPath()
    assert isinstance(solution, oc.PathControl)
    assert solution.check()
    path = push_path(definition, scenario)
    assert max(se2.pose_error(path.end, scenario.goal.pose_chain)) < 1e-9
    assert find_collision(scenario, path.sampled(0.01)) is None
    assert scenario.stable_set().margin(path.twists).min() > 0.0


def test_an_invalid_path_of_a_planner_is_refused(scenario: Scenario) -> None:
    information, definition = pose(scenario)
    with pytest.raises(PlanningError, match="no exact solution"):
        push_path(definition)
    ahead = np.tile([1.0, 0.0, 0.0, 30.0], (1, 1))
    leave_path(definition, ahead, "mine")
    with pytest.raises(PlanningError, match="arc 1 of 1 is not free"):
        push_path(definition)
    with pytest.raises(PlanningError, match="on no segment of the stable set"):
        leave_path(definition, np.array([[1.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.1]]), "mine")
    with pytest.raises(PlanningError, match="posed from another scenario"):
        push_path(definition, pushplan.load_scenario("narrow-gap"))
    foreign = ob.ProblemDefinition(ob.SpaceInformation(information.getStateSpace()))
    with pytest.raises(PlanningError, match="is not of a push"):
        push_path(foreign)


@pytest.mark.parametrize("planner", STOCK)
def test_plans_of_stock_planners_are_executed_and_logged_like_ours(planner: str, tmp_path: Path) -> None:
    scenario = pushplan.load_scenario("one-box")
    run = pushplan.run(scenario, planner=planner, iterations=3_000, time_limit=60.0, log=tmp_path / "run.mcap")
    assert run.plan.solved
    assert run.plan.planner == planner
    assert len(run.plan.tree) > 0
    assert there(run.execution).loss is None
    recorded = there(pushplan.load_run(tmp_path / "run.mcap").plan)
    assert recorded.planner == planner
    by_class = pushplan.plan(scenario, planner=STOCK[planner], iterations=3_000, time_limit=60.0)
    np.testing.assert_array_equal(there(by_class.path).twists, there(run.plan.path).twists)


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("name", ["two-crates", "free-space"])
def test_an_object_that_is_not_a_planner_is_refused(name: str, first: bool) -> None:
    """Also in free space, where a steering path solves the problem before the planner is called."""
    scenario = pushplan.load_scenario(name)
    with pytest.raises(PlanningError, match=r"a list is not a planner; allowed: an ompl\.base\.Planner"):
        pushplan.plan(scenario, planner=lambda information: [information.getStateDimension()], first=first)
    failure = r"the planner \S+ fails in \S+test_ompl\.py, line \d+: ZeroDivisionError: division by zero"
    with pytest.raises(ExtensionError, match=failure):
        pushplan.plan(scenario, planner=lambda information: 1 / 0, first=first)


SEARCHED = (
    "asymmetric", "carts", "feet", "five-objects", "hook", "narrow-gap", "one-box", "three-boxes-clutter",
    "two-crates",
)  # fmt: skip
"""Packaged scenarios in which no free steering path leads from the start to the goal."""


@pytest.mark.parametrize("name", [*pushplan.example_names()])
def test_rrts_of_ompl_grow_the_trees_of_auto(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted at OMPL's own calls: `solve` of its classes, and its propagator."""
    counts = {"solve": 0, "propagate": 0}
    solve, set_propagator = oc.RRT.solve, oc.SpaceInformation.setStatePropagator

    def counted_solve(planner: Any, *arguments: Any) -> Any:
        counts["solve"] += type(planner).__module__.partition(".")[0] == "ompl"
        return solve(planner, *arguments)

    def counted_propagator(information: Any, propagate: Any) -> None:
        def counted(*arguments: Any) -> None:
            counts["propagate"] += 1
            propagate(*arguments)

        set_propagator(information, counted)

    monkeypatch.setattr(oc.RRT, "solve", counted_solve)
    monkeypatch.setattr(oc.SpaceInformation, "setStatePropagator", counted_propagator)
    plan = pushplan.plan(pushplan.load_scenario(name), seed=1, iterations=3_000, time_limit=60.0)
    assert plan.solved
    assert (counts["solve"] > 0) == (counts["propagate"] > 0) == (len(plan.tree) > 0) == (name in SEARCHED)
