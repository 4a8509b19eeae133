"""Lower bounds: no path is below them, they include obstacles and turns, and some paths nearly reach them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import there
from plans_of import load_plain

import pushplan.planners.infeasible.ways as ways
from pushplan.core.problem import find_words, remaining
from pushplan.geometry import se2
from pushplan.planner import plan
from pushplan.planners.controls import control_segments, steering_families
from pushplan.planners.infeasible.bounds import lower_bound, time_bound
from pushplan.planners.infeasible.turn_bound import turn_bound
from pushplan.planners.problem import Posing
from pushplan.plans.path import TURN_WEIGHT, PushPath
from pushplan.scenario.file import example_names, load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.util.arrays import FloatArray

AHEAD = """
format: pushplan/1
floor: {friction: 0.3}
objects:
  - {name: box, shape: {box: [0.1, 0.2]}, mass: 1.0}
pusher: {width: 0.2, thickness: 0.1, friction: 0.4}
goal: {pose: [2.0, 0.0, 0.0]}
clearance: 0.01
"""
"""The chain is a square of 0.2 m; a disc of radius 0.1 m around the chain frame's origin is the largest in it."""


def bound_of(scenario: Scenario) -> float:
    controls = Posing().controls(scenario.with_margin(0.0), scenario.stable_set())
    return lower_bound(scenario, controls.segments)


def test_the_quick_bound_is_straight_travel_plus_the_smaller_turn_of_headings_of_any_size() -> None:
    rng = np.random.default_rng(1)
    for pose, goal in rng.uniform(-12.0, 12.0, (50, 2, 3)):
        away, turn = se2.pose_error(pose, goal)
        assert remaining(pose, goal) == pytest.approx(away + TURN_WEIGHT * turn)


def test_without_obstacles_the_bound_is_straight_travel_plus_the_needed_turns() -> None:
    scenario = scenario_from_text(AHEAD.replace("[2.0, 0.0, 0.0]", "[3.0, 4.0, -90 deg]"), "ahead.yaml")
    result = plan(scenario.with_planner(cost="travel", arc_price=0.0), iterations=20_000, time_limit=600.0)
    bound = there(result.lower_bound)
    assert 5.0 + TURN_WEIGHT * math.pi / 2.0 < bound_of(scenario) < bound < there(result.path).cost < 1.03 * bound


def test_the_bound_passes_a_block_on_its_short_side() -> None:
    """The disc (0.1 m, and 0.01 m of clearance) touches two corners: tangents, an arc at each, an edge between."""
    corners = np.array([[0.9, -0.3], [1.1, -0.3], [1.1, 0.5], [0.9, 0.5]])
    radius = 0.11
    reach = math.hypot(0.9, 0.3)
    tangent = math.sqrt(reach**2 - radius**2)
    turned = math.atan2(0.3, 0.9) + math.asin(radius / reach)
    exact = 2.0 * (tangent + radius * turned) + 0.2
    scenario = scenario_from_text(AHEAD, "ahead.yaml")
    found = bound_of(replace(scenario, obstacles=(PolygonObstacle(corners),)))
    assert found <= exact
    assert found == pytest.approx(exact, rel=2e-3)


def test_bends_on_the_wrong_side_never_shorten_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, scenario, found = np.random.default_rng(5), scenario_from_text(AHEAD, "ahead.yaml"), []
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for _ in range(12):
        poses = rng.uniform([0.3, -0.5, 0.0], [1.7, 0.5, 6.0], (8, 3))
        outlines = [se2.transform_points(pose, rng.uniform(0.03, 0.15) * square) for pose in poses]
        blocked = replace(scenario, obstacles=tuple(map(PolygonObstacle, outlines)))
        with monkeypatch.context() as anywhere:
            anywhere.setattr(ways, "STRAIGHT", math.inf)
            anywhere.setattr(ways, "MOST_SIGHTS", math.inf)
            of_all = bound_of(blocked)
        found.append((bound_of(blocked), of_all))
    own, least = np.array(found).T
    np.testing.assert_allclose(own, least, rtol=1e-9)
    assert np.ptp(found) > 0.1


@pytest.mark.parametrize("name", example_names())
def test_no_path_beats_the_bound(name: str) -> None:
    scenario = load_plain(name)
    result = plan(scenario, seed=1, time_limit=60.0, iterations=20_000)
    assert there(result.lower_bound) <= there(result.path).cost
    assert result.gap == there(result.path).cost / there(result.lower_bound) - 1.0
    assert result.gap < 0.5


ORIGIN = np.zeros(3)
CAR = np.array([[1.0, 0.0, -2.0, 1.0, 0.0, 2.0]])
"""Dubins' car with a turning radius of 0.5 m at the chain frame's origin."""


def random_path(segments: FloatArray, rng: np.random.Generator, longest: float) -> PushPath:
    """Return a few arcs of twists on segments, most of them at their ends, from a random pose."""
    count = int(rng.integers(1, 6))
    rows = segments[rng.integers(0, len(segments), count)]
    share = np.clip(rng.uniform(-0.5, 1.5, (count, 1)), 0.0, 1.0)
    twists = (1.0 - share) * rows[:, :3] + share * rows[:, 3:]
    twists /= (np.hypot(twists[:, 0], twists[:, 1]) + TURN_WEIGHT * np.abs(twists[:, 2]))[:, None]
    return PushPath(rng.uniform(-3.0, 3.0, 3), twists, rng.uniform(0.01, longest, count))


@pytest.mark.parametrize("name", ["one-box", "asymmetric", "carts", "trapezoids", "feet"])
def test_no_path_of_stable_twists_beats_the_bound(name: str) -> None:
    """The paths use finer meridians than the bound, which holds between them, too."""
    stable = load_plain(name).stable_set()
    known, finer = (control_segments(stable, stable.chain.pusher.drive, 0.05, k) for k in (512, 4099))
    rng = np.random.default_rng(7)
    for longest in (2.0, 0.1) * 15:
        path = random_path(finer, rng, longest)
        assert turn_bound(path.start, path.end, known) <= path.cost + 1e-9


@pytest.mark.parametrize("away", [3.0, 0.3])
def test_steering_paths_of_a_car_respect_the_bound_and_some_reach_it(away: float) -> None:
    """For Dubins' car the cheapest steering path is nearly the best path, because turns have a cost, too."""
    rng, family = np.random.default_rng(3), steering_families(CAR)[0]
    shares = []
    for goal in rng.uniform([-away, -away, -math.pi], [away, away, math.pi], (24, 3)):
        best = float(find_words(family, ORIGIN, goal)[:, 0].min())
        shares.append(turn_bound(ORIGIN, goal, CAR) / best)
    assert max(shares) <= 1.0 + 1e-9
    assert np.quantile(shares, 0.5) > 0.97


@pytest.mark.parametrize("goal", [(0.0, 0.02, 0.0), (-0.2, 0.0, 0.0), (0.0, 0.0, 0.3)])
def test_paths_to_near_goals_nearly_reach_the_bound(goal: tuple[float, float, float]) -> None:
    scenario = load_scenario("feet").with_planner(cost="travel", arc_price=0.0)
    near = replace(scenario.goal, pose_chain=se2.compose(scenario.start, np.array(goal)))
    empty = replace(scenario.with_goal(near), obstacles=(), workspace=None)
    result = plan(empty, seed=1, time_limit=60.0, iterations=20_000)
    assert 0.0 <= there(result.gap) < 0.1


@pytest.mark.parametrize("name", ["free-space", "narrow-gap", "carts"])
def test_plans_ranked_by_time_have_a_gap_in_time_and_by_margin_none(name: str) -> None:
    scenario = load_plain(name)
    by = {cost: plan(scenario, cost=cost, time_limit=300.0, iterations=300, seed=1) for cost in ("time", "margin")}
    assert by["margin"].gap is None
    duration, bound = there(by["time"].duration), there(by["time"].lower_bound)
    assert 0.5 * duration < bound < duration
    assert by["time"].gap == duration / bound - 1.0


@pytest.mark.parametrize("goal", ["[0.6, 0.5, 80 deg]", "[0.6, -0.5, -80 deg]"])
def test_a_time_bound_holds_for_limits_that_differ_by_direction(goal: str) -> None:
    limits = (
        "limits: {speed: 0.5, acceleration: [-0.2, 0.8], angular_speed: [-0.2, 2.0], angular_acceleration: [-1, 3]}"
    )
    text = AHEAD.replace("[2.0, 0.0, 0.0]", goal).replace("friction: 0.4}", f"friction: 0.4, {limits}}}")
    scenario = scenario_from_text(text, "ahead.yaml")
    result = plan(scenario, iterations=2_000)
    segments = Posing().controls(scenario.with_margin(0.0), scenario.stable_set()).segments
    bound = time_bound(scenario, segments, there(result.duration))
    assert 0.2 * there(result.duration) < bound < there(result.duration)


def test_the_largest_disc_around_a_point_outside_has_no_radius() -> None:
    bodies = scenario_from_text(AHEAD, "ahead.yaml").chain.bodies
    assert ways.disc_at(bodies, np.array([0.3, 0.0])).radius == 0.0
    assert ways.disc_at(bodies, np.array([0.04, 0.0])).radius == pytest.approx(0.06, abs=1e-5)
