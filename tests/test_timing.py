"""Timed trajectories: limits by finite differences in the world, exact ends, poses by an ODE solver."""

import numpy as np
import pytest

from pushplan.mechanics.chain import Limits
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.path import PushPath, cost_rate


def _path(rng: np.random.Generator, arcs: int) -> PushPath:
    twists = rng.normal(size=(arcs, 3)) * [1.0, 0.3, 3.0]
    twists[::3, 2] = 0.0
    twists[1::4, :2] *= 0.01
    return PushPath(rng.normal(size=3), twists / cost_rate(twists)[:, None], rng.uniform(0.05, 1.0, arcs))


def _within(values: np.ndarray, limit: float) -> bool:
    return float(np.abs(values).max()) <= limit * (1.0 + 1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_speed_acceleration_and_jerk_in_the_world_stay_within_the_limits(seed: int) -> None:
    trajectory = time_path(
        _path(np.random.default_rng(seed), 6), Bounds(Limits(0.2, 0.5, 5.0, 1.0, 2.0, 20.0))
    )
    h = 1e-3
    for begin, end in zip(trajectory.breaks[:-1], trajectory.breaks[1:], strict=True):
        if end - begin < 5 * h:
            continue
        t = np.arange(begin, end, h)
        poses = trajectory.poses_at(t)
        for columns, bounds in ((poses[:, :2], (0.2, 0.5, 5.0)), (poses[:, 2:], (1.0, 2.0, 20.0))):
            for order, bound in enumerate(bounds, start=1):
                derivative = np.diff(columns, n=order, axis=0) / h**order
                assert _within(np.linalg.norm(derivative, axis=1), bound)


@pytest.mark.parametrize("seed", range(5))
def test_a_timed_path_ends_where_the_path_ends_and_stops_at_every_corner(seed: int) -> None:
    path = _path(np.random.default_rng(seed), 7)
    trajectory = time_path(path, Bounds(Limits()))
    np.testing.assert_allclose(trajectory.poses[-1], path.end, atol=1e-11)
    corners = trajectory.breaks[np.flatnonzero(np.diff(trajectory.arc)) + 1]
    assert len(corners) == 6
    assert np.abs(trajectory.twists_at(corners)).max() < 1e-9
    assert np.abs(trajectory.twists[[0, -1]]).max() < 1e-9


def test_a_long_straight_push_takes_the_time_of_the_textbook() -> None:
    """Length/v + v/a + a/j for a profile that reaches its speed and its acceleration."""
    path = PushPath(np.zeros(3), np.array([[1.0, 0.0, 0.0]]), np.array([2.0]))
    assert time_path(path, Bounds(Limits())).duration == pytest.approx(
        2.0 / 0.2 + 0.2 / 0.5 + 0.5 / 5.0, abs=1e-9
    )
