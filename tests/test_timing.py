"""Timed trajectories: limits by finite differences in the world, exact ends, poses by an ODE solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pushplan.mechanics.chain import Limits
from pushplan.planners.timing.arc_limits import Bounds, arc_limits
from pushplan.planners.timing.exact_timing import rest_to_rest, time_path
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.trajectory import Trajectory


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
        for columns, bounds in (
            (poses[:, :2], (0.2, 0.5, 5.0)),
            (poses[:, 2:], (1.0, 2.0, 20.0)),
        ):
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


def test_one_limit_is_always_reached() -> None:
    """The bounds of a straight or a pivoting arc are the pusher's own: nothing is given away."""
    straight = arc_limits(np.array([1.0, 0.0, 0.0]), Limits())
    assert tuple(straight) == pytest.approx((0.2, 0.5, 0.5, 5.0))
    pivot = arc_limits(np.array([0.0, 0.0, 10.0]), Limits())
    assert tuple(pivot) == pytest.approx((0.1, 0.2, 0.2, 2.0))


def test_phases_cover_the_length() -> None:
    for length in (1e-6, 1e-3, 0.1, 10.0):
        durations, phases = rest_to_rest(length, arc_limits(np.array([1.0, 0.0, 0.0]), Limits()))
        covered = sum(float(phases[:, k] @ durations ** (k + 1)) / (k + 1) for k in range(3))
        assert covered == pytest.approx(length, rel=1e-9)


def test_poses_of_a_twist_that_changes_direction_agree_with_an_ode_solver() -> None:
    coefficients = np.array([[[0.1, 0.0, 0.2], [0.05, 0.1, 0.5], [0.02, -0.1, -0.3]]])
    trajectory = Trajectory(np.array([0.3, -0.2, 0.5]), np.array([0.0, 0.2]), coefficients, np.zeros(1))

    def rate(t: float, pose: np.ndarray) -> np.ndarray:
        vx, vy, omega = coefficients[0, 0] + t * coefficients[0, 1] + t * t * coefficients[0, 2]
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return np.array([c * vx - s * vy, s * vx + c * vy, omega])

    solved = solve_ivp(rate, (0.0, 0.2), trajectory.start, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(trajectory.poses_at([0.2])[0], solved.y[:, -1], atol=1e-7)


def test_a_path_of_no_arcs_takes_no_time() -> None:
    path = PushPath(np.ones(3), np.zeros((0, 3)), np.zeros(0))
    trajectory = time_path(path, Bounds(Limits()))
    assert trajectory.duration == 0.0
    np.testing.assert_array_equal(trajectory.poses, np.ones((1, 3)))
