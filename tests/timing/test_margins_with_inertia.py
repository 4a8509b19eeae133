"""Default plans keep half of their margin with inertia, computed from finite differences of poses."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import there

from pushplan.geometry import se2
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.planner import plan
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import example_names, load_scenario
from pushplan.util.arrays import FloatArray

H = 1e-3
"""Step of the differences, s."""

SHARE = 0.5
ROUNDING = 0.005
"""Bound of the error of the differences if the twist changes along a step."""


def motion(trajectory: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return body twists (m, 3) and their rates (m, 3) every millisecond of a motion, by differences of its poses."""
    poses = trajectory.poses_at(np.arange(0.0, trajectory.duration, H))
    steps = np.diff(poses, axis=0)
    middle = 0.5 * (poses[1:, 2] + poses[:-1, 2])
    twists = np.column_stack([se2.rotate(-middle, steps[:, :2]), steps[:, 2]]) / H
    rates = np.diff(twists, axis=0) / H
    between = 0.5 * (twists[1:] + twists[:-1])
    moving = np.abs(between).max(axis=1) > 5e-3
    return between[moving], rates[moving]


@pytest.mark.parametrize(
    ("name", "trajectory"), [*((name, "blended") for name in example_names()), ("hook", "exact"), ("carts", "exact")]
)
def test_packaged_scenarios_keep_half_of_their_margin(name: str, trajectory: str) -> None:
    scenario = replace(load_scenario(name), trajectory=trajectory)
    result = plan(scenario, time_limit=120.0, iterations=1000)
    assert result.solved, result.reason
    assert there(result.min_dynamic_margin) > SHARE * there(result.margin) * (1.0 - 1e-6)
    least = dynamic_margins(scenario.chain, *motion(there(result.trajectory))).min()
    assert least > SHARE * there(result.margin) - ROUNDING
