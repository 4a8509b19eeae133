"""How far a blended motion gets from the constant twists between its samples."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from pushplan.geometry import se2
from pushplan.planners.planner import plan
from pushplan.planners.timing.sweep import off_chords
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import load_scenario


@pytest.fixture(scope="module")
def motion() -> Trajectory:
    trajectory = plan(load_scenario("two-crates"), first=True).trajectory
    assert trajectory is not None
    return trajectory


def test_half_way_between_samples_the_body_is_no_farther_from_the_constant_twist(motion: Trajectory) -> None:
    reach, rate = 0.4, 20.0
    trajectory = replace(motion, rate=rate)
    turn = 2.0 * np.pi * np.arange(8) / 8
    points = np.vstack([[0.0, 0.0], reach * np.stack([np.cos(turn), np.sin(turn)], axis=1)])
    poses, between = trajectory.poses, trajectory.poses_at(trajectory.t[:-1] + 0.5 / rate)
    worst = 0.0
    for begin, middle, end in zip(poses[:-2], between, poses[1:-1], strict=False):
        chord = se2.log(se2.relative(begin, end))
        there = se2.transform_points(middle, points)

        def away(share: float, begin=begin, chord=chord, there=there) -> float:  # type: ignore[no-untyped-def]
            pose = se2.compose(begin, se2.exp(share * chord))
            return float(np.hypot(*(se2.transform_points(pose, points) - there).T).max())

        found = minimize_scalar(away, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-7})
        worst = max(worst, float(found.fun))
    assert 1e-6 < worst < off_chords(trajectory, reach)
