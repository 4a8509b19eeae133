"""Packaged scenarios planned once by travel, without margin and inertia, for the tests of timing."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from conftest import there
from plans_of import load_plain

from pushplan.mechanics.chain import Limits
from pushplan.planner import plan
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

MARGINS = {"carts": 0.02, "feet": 0.01}
"""Margin of paths that are not planned with a margin of 0."""

SEEDS = {"three-boxes-clutter": 2, "one-box": 3, "parallel-stacks": 2}
"""Seeds to use instead of 1, with which paths are so close to obstacles that blends stop at nearly all corners, or
have so short arcs between two turns that less than a fifth of the time is saved."""

Planned = Callable[[str], tuple[Scenario, PushPath]]


@cache
def _planned(name: str) -> tuple[Scenario, PushPath]:
    scenario = load_plain(name).with_margin(MARGINS.get(name, 0.0))
    path = there(plan(scenario, seed=SEEDS.get(name, 1), time_limit=60.0, iterations=20_000).path)
    return scenario, path


@pytest.fixture(scope="session")
def planned() -> Planned:
    """Return the planner of packaged scenarios."""
    return _planned


def use_by_differences(trajectory: Trajectory, limits: Limits, h: float = 2e-3) -> FloatArray:
    """Return the largest share (3,) of the limits on speed, acceleration and jerk in the world. It includes the
    breaks: with a continuous acceleration, the third difference is a mean of the jerk.
    """
    poses = trajectory.poses_at(np.arange(0.0, trajectory.duration, h))
    linear = (limits.speed, limits.acceleration, limits.jerk)
    angular = (limits.angular_speed, limits.angular_acceleration, limits.angular_jerk)
    use = []
    for order, (a, b) in enumerate(zip(linear, angular, strict=True), start=1):
        rates = np.diff(poses, n=order, axis=0) / h**order
        use.append(max(np.hypot(rates[:, 0], rates[:, 1]).max() / a, np.abs(rates[:, 2]).max() / b))
    return np.array(use)
