"""Plans end to end: packaged scenarios, planners, several queries in one room, checking sets and pickles."""

import pickle
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import ChainMaker, Patch, there
from kinds import GAP
from plans_of import load_plain, push_of

import pushplan
from pushplan.bench.outcome import validation_error
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Limits
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.mechanics.intervals import IntervalChain
from pushplan.planner import Planner, plan
from pushplan.planners.clearance import find_collision
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.blending import time_segments
from pushplan.planners.timing.exact_timing import time_path
from pushplan.planners.validator import Validator
from pushplan.plans.execution import Execution
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Segment
from pushplan.plans.settings import Observer
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import load_scenario, scenario_from_text
from pushplan.scenario.goals import Goal
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.sets.named import stable_set, stable_set_over
from pushplan.sim.kinematic import execute
from pushplan.util.names import APPROACH, PLANNERS

PATIENT = 60.0
"""Time limit that no test reaches, so that results do not depend on the machine."""


def _check(scenario: Scenario, result: Plan) -> None:
    assert result.solved, result.reason
    execution = there(result.execution)
    assert execution.loss is None
    assert execution.margins.min() > 0.0
    assert max(execution.goal_error) < 1e-6
    pushed = se2.compose(execution.poses, se2.inverse(scenario.chain.pusher.plate_pose))
    assert find_collision(scenario, pushed) is None
    np.testing.assert_allclose(pushed[-1], there(result.path).end, atol=1e-9)


@pytest.mark.parametrize("planner", sorted(PLANNERS))
def test_every_planner_solves_and_shortens(planner: str) -> None:
    scenario = (
        scenario_from_text(GAP).with_margin(0.01).with_planner(cost="travel")
        if planner == "bottlenecks"
        else load_plain("narrow-gap")
    )
    first = plan(scenario, planner=planner, time_limit=PATIENT, first=True)
    result = plan(scenario, planner=planner, time_limit=PATIENT, iterations=2 * first.iterations + 5_000)
    _check(scenario, result)
    assert there(result.path).cost <= there(first.path).cost + 1e-9
    assert result.improvements[0].cost == pytest.approx(first.improvements[0].cost)
    assert there(first.path).cost <= first.improvements[0].cost
    assert result.improvements[-1].cost == pytest.approx(there(result.path).cost, abs=1e-9)


def test_improvements_are_reported_as_they_happen() -> None:
    heard: list[float] = []
    observer = Observer(improved=lambda better: heard.append(better.cost))
    result = plan(load_scenario("one-box"), observer=observer, time_limit=PATIENT, iterations=2000)
    assert heard == [point.cost for point in result.improvements]
    assert len(heard) > 1


@pytest.mark.parametrize("planner", ["auto", "rrt"])
@pytest.mark.parametrize("name", ["two-crates", "free-space"])
def test_a_plan_counts_the_iterations_that_the_setting_limits(name: str, planner: str) -> None:
    found = plan(load_scenario(name), planner=planner, iterations=2_000, time_limit=PATIENT)
    assert 2_000 <= found.iterations < 2_500  # they are counted in rounds of up to 500
    assert found.improvements[-1].iterations <= found.iterations
    assert found.to_dict()["iterations"] == found.iterations


def test_a_time_limit_during_preparation_is_an_ordinary_failure() -> None:
    scenario = load_scenario("one-box")
    corner = np.array([[9.0, 9.0], [9.9, 9.0], [9.9, 9.3], [9.3, 9.3], [9.3, 9.9], [9.0, 9.9]])
    result = plan(replace(scenario, obstacles=(PolygonObstacle(corner),)), time_limit=1e-6)
    assert not result.solved
    assert "the time limit was reached during preparation" in result.reason
    assert [item.cause for item in result.diagnosis] == ["time"]
    assert (result.path, result.trajectory, result.improvements) == (None, None, ())


START, GOAL = np.array([0.3, 0.3, 0.8]), np.array([3.5, 3.4, 0.5])


@pytest.fixture(scope="module")
def clutter() -> Scenario:
    return load_scenario("three-boxes-clutter")


@pytest.fixture(scope="module")
def planner(clutter: Scenario) -> Planner:
    return Planner(clutter)


def _between(scenario: Scenario, start: np.ndarray, goal: np.ndarray) -> Scenario:
    return scenario.with_load(start=start).with_goal(Goal.of_chain(goal, (0.002, 0.003)))


def test_a_plan_is_the_first_plan_of_its_own_scenario(planner: Planner, clutter: Scenario) -> None:
    asked = planner.plan(START, GOAL, seed=3, time_limit=60.0)
    own = plan(_between(clutter, START, GOAL), seed=3, first=True, time_limit=60.0)
    assert asked.solved, asked.reason
    np.testing.assert_array_equal(there(asked.path).twists, there(own.path).twists)
    np.testing.assert_array_equal(there(asked.trajectory).poses, there(own.trajectory).poses)
    assert asked.robustness == own.robustness
    assert asked.lower_bound == own.lower_bound


def test_other_obstacles_change_the_room_and_nothing_else(planner: Planner) -> None:
    free = planner.with_obstacles([])
    ((cost,),) = free.reach([START], [GOAL])
    wall = PolygonObstacle(np.array([[0.0, 2.0], [4.0, 2.0], [4.0, 2.1], [0.0, 2.1]]))
    walled = free.with_obstacles([wall])
    assert np.isinf(walled.reach([START], [GOAL])).all()
    assert not walled.plan(START, GOAL, time_limit=0.3).solved
    assert there(free.plan(START, GOAL).path).cost <= cost * (1.0 + 1e-9)
    assert cost < 1.5 * there(free.plan(START, GOAL).cost)


def test_invalid_and_blocked_poses_are_refused(planner: Planner) -> None:
    with pytest.raises(PlanningError, match=r"start: an array of shape \(1, 2\); allowed: poses \(k, 3\)"):
        planner.plan([0.0, 0.0], GOAL)
    with pytest.raises(PlanningError, match="goals: a pose with nan; allowed: numbers"):
        planner.reach([START], [[np.nan, 0.0, 0.0]])
    with pytest.raises(PlanningError, match="at the goal, 'third'"):
        planner.plan(START, [1.0, 0.45, 0.0])
    with pytest.raises(PlanningError, match="nothing to push"):
        planner.plan(START, START)


ITERATIONS = 4000
FAST = Limits(5.0, 50.0, 2000.0, 50.0, 500.0, 2e4)


def test_a_plan_in_cof_is_stable_in_ecof_too() -> None:
    scenario = load_scenario("one-box")
    result = plan(scenario, stable_set="cof", time_limit=60.0, iterations=ITERATIONS)
    assert result.solved, result.reason
    assert result.stable_set == "cof"
    assert there(result.execution).loss is None
    for name in ("ecof", "cof"):
        assert stable_set(scenario.chain, name).margin(there(result.path).twists).min() > there(result.margin)
    own = result.segments[0].contact_trajectory
    found = dynamic_margins(scenario.chain, own.directions, own.rates_at(own.t))
    assert found.min() == pytest.approx(result.min_dynamic_margin)
    assert found.min() > 0.0


def test_the_plan_is_faster_to_drive_than_the_cheapest_path() -> None:
    scenario, own, alone = load_scenario("two-crates"), 0.0, 0.0
    for seed in range(1, 7):
        found = plan(scenario, seed=seed, time_limit=60.0, iterations=10_000)
        own += there(found.duration)
        alone += sum(each.duration for each in time_segments(found.scenario, found.improvements[-1].segments))
    assert own < 0.99 * alone


def test_a_path_too_fast_for_its_contacts_is_not_a_plan(monkeypatch: Patch) -> None:
    def too_fast(scenario: Scenario, path: PushPath, *_: object) -> SimpleNamespace:
        return SimpleNamespace(trajectory=time_path(path, Bounds(FAST)))

    monkeypatch.setattr("pushplan.planners.timing.blending.blend_path", too_fast)
    result = plan(load_scenario("two-crates"), time_limit=60.0, iterations=ITERATIONS)
    assert not result.solved
    assert result.reason.startswith("the plan does not hold when it is executed: ")


@cache
def good() -> tuple[Plan, Execution]:
    found = plan(load_scenario("free-space"), time_limit=60.0, first=True)
    assert found.solved
    return found, there(found.execution)


def path() -> PushPath:
    return there(good()[0].path)


def flaw(scenario: Scenario, segment: Segment) -> str:
    return Validator(scenario).flaw((segment,), good()[1])


def test_a_margin_equal_to_the_required_one_is_too_small() -> None:
    found, execution = good()
    smallest = there(execution.min_margin)
    said = validation_error(replace(found, margin=smallest), execution)
    assert said == f"the smallest margin is {smallest:.3g}; it must be above {smallest:g}"
    (push,) = found.segments
    smallest = float(found.scenario.stable_set().margin(path().twists).min())
    said = flaw(found.scenario, replace(push, margin=smallest))
    assert said.endswith(f"the path's smallest margin is {smallest:.3g}; it must be above {smallest:g}")


@pytest.fixture(scope="module")
def crates() -> pushplan.Plan:
    return pushplan.plan(pushplan.load_scenario("two-crates"), first=True, time_limit=60.0)


def test_a_pickled_plan_keeps_its_lazy_fields(crates: pushplan.Plan) -> None:
    back = pickle.loads(pickle.dumps(crates))
    assert back.metrics() == crates.metrics()
    assert back.robustness == crates.robustness
    np.testing.assert_array_equal(there(back.trajectory).poses, there(crates.trajectory).poses)


def test_pickled_sets_planners_and_controllers_give_the_same_answers(crates: pushplan.Plan) -> None:
    twists, chain = np.array([[1.0, 0.0, 0.0], [1.0, 0.1, 0.5]]), crates.scenario.chain
    uneven = IntervalChain.from_ranges(chain, pressures={"near": 0.1})
    for stable in (stable_set(chain), stable_set(chain, "robust"), stable_set_over(uneven)):
        margins = stable.margin(twists)  # lazy fields are pickled, too
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(stable)).margin(twists), margins)
    planner = pickle.loads(pickle.dumps(pushplan.Planner(crates.scenario)))
    assert planner.plan(time_limit=60.0).cost == pytest.approx(crates.cost)
    assert pickle.loads(pickle.dumps(pushplan.Controller(crates))).step(0.0).any()


def test_the_loss_lies_between_the_samples_around_the_exact_end_of_the_set(make_chain: ChainMaker) -> None:
    """The twist turns steadily out of the set; bisection gives the exact time at which the margin ends."""
    chain = make_chain.boxes(2, size=(0.1, 0.2))
    limits = replace(chain.pusher.limits, contact="quasi-static")
    stable = stable_set(replace(chain, pusher=replace(chain.pusher, limits=limits)))
    coefficients = np.array([[[0.1, 0.0, 0.0], [0.0, 0.0, 0.2], [0.0, 0.0, 0.0]]])
    trajectory = Trajectory(np.zeros(3), np.array([0.0, 10.0]), coefficients, np.zeros(1))
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        inside = stable.margin(trajectory.twists_at(np.array([middle])))[0] > 0.0
        low, high = (middle, high) if inside else (low, middle)
    pushed = push_of(stable.chain, trajectory)
    loss = there(execute(pushed.scenario, pushed.segments, "ecof").loss)
    assert low <= loss.time <= low + 1.0 / trajectory.rate + 1e-9


@pytest.mark.parametrize("turns", [1, -2])
def test_a_full_turn_of_the_robot_does_not_turn_the_pushed_object(turns: int) -> None:
    plain = pushplan.plan(load_scenario("one-box"), seed=1, first=True, time_limit=PATIENT)
    (push,) = plain.segments
    spin = PushPath(
        push.path.start, np.array([[0.0, 0.0, 10.0 * np.sign(turns)]]), np.array([0.2 * np.pi * abs(turns)])
    )
    spun = time_segments(plain.scenario, (Segment("transit", spin, push.before, push.before), push))
    found, alone = execute(plain.scenario, spun, "ecof"), there(plain.execution)
    np.testing.assert_allclose(found.poses[-1] - alone.poses[-1], [0.0, 0.0, 2.0 * np.pi * turns], atol=1e-6)
    np.testing.assert_allclose(found.objects[-1], alone.objects[-1], atol=1e-6)
    later = np.interp(alone.t + spun[0].duration, found.t, found.margins[:, 0])
    assert np.nanmedian(np.abs(later - alone.margins[:, 0])) < 1e-6  # contacts are checked at times of the push


def test_a_sampled_path_has_every_knot_and_no_longer_gap_than_asked() -> None:
    poses = path().sampled(0.05)
    for knot in (*path().knots, path().end):
        assert np.abs(poses - knot).max(axis=1).min() < 1e-12
    steps = se2.log(se2.relative(poses[:-1], poses[1:]))
    assert np.hypot(steps[:, 0], steps[:, 1]).max() < 0.05 + 1e-9


def test_only_an_approach_and_a_close_touch_resting_objects(crates: pushplan.Plan) -> None:
    (push,) = crates.segments
    assert push.load is not None
    assert push.touched == ()
    assert replace(push, kind=APPROACH).touched == ("near", "far")
    assert replace(push, kind=APPROACH, load=None).touched == ()
    assert replace(push, onto="box").touched == ("box",)
