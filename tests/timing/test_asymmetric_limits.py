"""Limits that differ between the directions: read, kept by every motion, mirrored with the scenario."""

from dataclasses import replace

import numpy as np
import pytest

import pushplan
from pushplan.errors import ScenarioError
from pushplan.mechanics.chain import Limits
from pushplan.planners.clearance import excess
from pushplan.planners.timing.arc_limits import Bounds, arc_limits
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath, cost_rate
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario

ROOM = """
format: pushplan/1
name: sides
floor: {{friction: 0.3}}
objects: [{{name: a, shape: {{box: [0.2, 0.3]}}, mass: 1.0}}]
contacts: {{friction: 0.3}}
pusher: {{width: 0.4, friction: 0.5, limits: {limits}}}
start: [0, 0, 0]
goal: {{pose: {goal}}}
trajectory: {trajectory}
"""
SIDES = Limits(
    speed=(-0.1, 0.4), acceleration=(-0.2, 0.6), angular_speed=(-0.15, 0.5), angular_acceleration=(-0.8, 2.0)
)
MIRRORED = replace(SIDES, angular_speed=(-0.5, 0.15), angular_acceleration=(-2.0, 0.8))
TWISTS = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 2.0], [1.0, 0.1, -2.0], [1.0, -0.1, 1.0]])
TEXT = "{angular_speed: [-0.15, 0.5], angular_acceleration: [-0.8, 2.0], acceleration: [-0.2, 0.6]}"
TEXT_MIRRORED = "{angular_speed: [-0.5, 0.15], angular_acceleration: [-2.0, 0.8], acceleration: [-0.2, 0.6]}"


def _path(twists: np.ndarray) -> PushPath:
    return PushPath(np.zeros(3), twists / cost_rate(twists)[:, None], np.full(len(twists), 0.7))


def _room(limits: str, goal: str, trajectory: str = "blended") -> Scenario:
    return scenario_from_text(ROOM.format(limits=limits, goal=goal, trajectory=trajectory), "sides")


def test_equal_sides_are_the_same_as_a_number() -> None:
    pairs = Limits((-0.2, 0.2), (-0.5, 0.5), 5.0, (-1.0, 1.0), (-2.0, 2.0), 20.0)
    for a, b in zip(arc_limits(TWISTS, pairs), arc_limits(TWISTS, Limits()), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_mirrored_path_with_mirrored_limits_is_driven_in_the_same_time() -> None:
    one = time_path(_path(TWISTS), Bounds(SIDES))
    other = time_path(_path(TWISTS * [1.0, -1.0, -1.0]), Bounds(MIRRORED))
    np.testing.assert_array_equal(one.breaks, other.breaks)
    np.testing.assert_array_equal(one.coefficients, other.coefficients * [1.0, -1.0, -1.0])


def test_an_exact_motion_uses_each_side_of_its_limits_and_no_more() -> None:
    for twist in TWISTS:
        trajectory = time_path(_path(twist[None]), Bounds(SIDES))
        assert excess(trajectory, SIDES) == ""
    left = time_path(_path(TWISTS[1:2]), Bounds(SIDES))
    assert excess(left, MIRRORED).startswith("the motion exceeds the pusher's angular speed: 0.5 after")


@pytest.mark.parametrize("trajectory", ["blended", "exact"])
def test_plans_keep_the_limits_and_the_mirrored_scenario_takes_as_long(trajectory: str) -> None:
    durations = []
    for limits, goal in ((TEXT, "[1.5, 0.8, 60 deg]"), (TEXT_MIRRORED, "[1.5, -0.8, -60 deg]")):
        scenario = _room(limits, goal, trajectory)
        result = pushplan.plan(scenario, iterations=4_000, time_limit=60.0)
        assert result.trajectory is not None
        assert excess(result.trajectory, scenario.chain.pusher.limits) == ""
        durations.append(result.trajectory.duration)
    assert durations[0] == pytest.approx(durations[1], rel=0.05)  # two searches of one room differ by 2 %


@pytest.mark.parametrize(
    "value", ["[0.1, 0.5]", "[-0.1]", "[-0.5, -0.1]", "[-0.1, 0, 1]", "[0, 0.5]", "[-x, 1]"]
)
def test_bad_pairs_are_found(value: str) -> None:
    with pytest.raises(ScenarioError, match="angular_speed"):
        _room(f"{{angular_speed: {value}}}", "[1, 0, 0]")


def test_units_are_read_in_pairs() -> None:
    limits = _room("{angular_speed: [-30 deg/s, 60 deg/s]}", "[1, 0, 0]").chain.pusher.limits
    assert limits.angular_speed == pytest.approx((-np.pi / 6.0, np.pi / 3.0))
