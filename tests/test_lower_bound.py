"""The lower bound: no path beats it, it knows obstacles, and it is exact where nothing is in the way."""

import math
from dataclasses import replace

import numpy as np
import pytest
from plain import load_plain

from pushplan.planners.infeasible.bounds import lower_bound
from pushplan.planners.planner import plan
from pushplan.planners.problem import Posing
from pushplan.plans.path import TURN_WEIGHT
from pushplan.scenario.file import example_names, scenario_from_text
from pushplan.scenario.model import CircleObstacle, PolygonObstacle, Scenario
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


def blocked_by(obstacle: FloatArray) -> Scenario:
    return replace(scenario_from_text(AHEAD, "ahead.yaml"), obstacles=(PolygonObstacle(obstacle),))


def bound_of(scenario: Scenario, most: float = math.inf) -> float:
    controls = Posing().controls(scenario.with_margin(0.0), scenario.stable_set())
    return lower_bound(scenario, controls.segments, most)


def test_nothing_in_the_way_leaves_straight_travel_and_the_turns_that_the_pushes_need() -> None:
    scenario = scenario_from_text(AHEAD.replace("[2.0, 0.0, 0.0]", "[3.0, 4.0, -90 deg]"), "ahead.yaml")
    result = plan(
        replace(scenario, planner=replace(scenario.planner, cost="travel", arc_price=0.0)), iterations=20_000
    )
    assert result.path is not None
    assert result.lower_bound is not None
    assert 5.0 + TURN_WEIGHT * math.pi / 2.0 < bound_of(scenario) < result.lower_bound
    assert result.lower_bound < result.path.cost < 1.03 * result.lower_bound


def test_a_block_in_the_way_has_to_be_passed_on_its_short_side() -> None:
    """The disc (0.1 m, and 0.01 m of clearance) touches two corners: tangents, an arc at each, an edge between."""
    corners = np.array([[0.9, -0.3], [1.1, -0.3], [1.1, 0.5], [0.9, 0.5]])
    radius = 0.11
    reach = math.hypot(0.9, 0.3)
    tangent = math.sqrt(reach**2 - radius**2)
    turned = math.atan2(0.3, 0.9) + math.asin(radius / reach)
    exact = 2.0 * (tangent + radius * turned) + 0.2
    found = bound_of(blocked_by(corners))
    assert found <= exact
    assert found == pytest.approx(exact, rel=2e-3)


def test_a_known_path_speeds_the_bound_up_and_changes_nothing() -> None:
    rng = np.random.default_rng(5)
    for _ in range(10):
        circles = tuple(
            CircleObstacle(center, 0.1) for center in rng.uniform([0.4, -0.5], [1.6, 0.5], (6, 2))
        )
        scenario = replace(scenario_from_text(AHEAD, "ahead.yaml"), obstacles=circles)
        free = bound_of(scenario)
        assert free >= 2.0
        assert bound_of(scenario, free + 1e-6) == pytest.approx(free, abs=1e-12)


@pytest.mark.parametrize("name", example_names())
def test_no_path_beats_the_bound(name: str) -> None:
    scenario = load_plain(name)
    result = plan(scenario, seed=1, time_limit=60.0, iterations=25_000)
    assert result.path is not None
    assert result.lower_bound is not None
    assert result.lower_bound <= result.path.cost
    assert result.gap == result.path.cost / result.lower_bound - 1.0
    assert result.gap < 0.5


def test_a_gap_that_is_good_enough_ends_the_search() -> None:
    scenario = load_plain("narrow-gap")
    patient = plan(scenario, time_limit=60.0, iterations=20_000)
    hasty = plan(scenario, time_limit=60.0, iterations=20_000, gap=0.15)
    assert hasty.gap is not None
    assert patient.gap is not None
    assert patient.gap <= hasty.gap <= 0.15
    assert hasty.improvements[-1].iterations < patient.improvements[-1].iterations
    stated = replace(scenario, planner=replace(scenario.planner, gap=0.15))
    again = plan(stated, time_limit=60.0, iterations=20_000)
    assert again.path is not None
    assert hasty.path is not None
    np.testing.assert_array_equal(again.path.lengths, hasty.path.lengths)
