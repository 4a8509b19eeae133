"""Bounds on speed, acceleration and jerk in the world against finite differences of the poses."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

import pushplan.core.timing as timing
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Limits
from pushplan.planners.timing.exact_timing import Pieces, limit_use
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray

LIMITS = Limits(0.3, 0.7, 3.0, 1.5, 2.5, 30.0)


def _pieces(durations: ArrayLike, coefficients: FloatArray) -> Pieces:
    return Pieces(np.array(durations), coefficients, np.zeros(len(coefficients), dtype=np.int64))


def _differences(poses: FloatArray, h: float) -> list[FloatArray]:
    """Share (m,) of the limits used by the first three derivatives of sampled poses."""
    shares = []
    linear = (LIMITS.speed, LIMITS.acceleration, LIMITS.jerk)
    angular = (LIMITS.angular_speed, LIMITS.angular_acceleration, LIMITS.angular_jerk)
    for order, (a, b) in enumerate(zip(linear, angular, strict=True), start=1):
        rates = np.diff(poses, n=order, axis=0) / h**order
        shares.append(np.maximum(np.hypot(rates[:, 0], rates[:, 1]) / a, np.abs(rates[:, 2]) / b))
    return shares


@pytest.mark.parametrize("seed", range(30))
def test_bounds_hold_and_are_tight_on_short_pieces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(1, 3, 3)) * [[1.0, 1.0, 3.0]] * [[1.0], [2.0], [5.0]]
    duration = 0.02
    trajectory = Trajectory(np.zeros(3), np.array([0.0, duration]), coefficients, np.zeros(1))
    use = limit_use(_pieces([duration], coefficients), LIMITS)[0]
    h = 1e-3
    for bound, share in zip(
        use, _differences(trajectory.poses_at(np.arange(0, duration, h)), h), strict=True
    ):
        assert share.max() <= bound * (1.0 + 1e-3)
        assert share.max() >= bound * 0.9


def test_bounds_hold_on_long_pieces() -> None:
    rng = np.random.default_rng(3)
    coefficients = rng.normal(size=(20, 3, 3))
    durations = rng.uniform(0.05, 1.0, 20)
    use = limit_use(_pieces(durations, coefficients), LIMITS)
    for duration, c, bounds in zip(durations, coefficients, use, strict=True):
        ticks = np.linspace(0.0, duration, 2001)
        breaks = np.linspace(0.0, duration, 51)
        pieces = np.stack(
            [np.stack([c[0] + b * (c[1] + b * c[2]), c[1] + 2 * b * c[2], c[2]]) for b in breaks[:-1]]
        )
        fine = Trajectory(np.zeros(3), breaks, pieces, np.zeros(50))
        shares = _differences(fine.poses_at(ticks), ticks[1])
        for bound, share in zip(bounds[:2], shares[:2], strict=True):
            assert share.max() <= bound * (1.0 + 1e-3)


@pytest.mark.parametrize("seed", range(10))
def test_no_point_of_the_body_is_faster_than_its_top_rate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    coefficients, duration, reach = rng.normal(size=(1, 3, 3)), 0.3, 0.4
    trajectory = Trajectory(np.zeros(3), np.array([0.0, duration]), coefficients, np.zeros(1))
    poses = trajectory.poses_at(np.linspace(0.0, duration, 3001))
    angle = rng.uniform(0.0, 2.0 * np.pi, 8)
    bound = timing.top_rates(np.array([duration]), coefficients, reach)[0]
    for point in reach * np.column_stack([np.cos(angle), np.sin(angle)]):
        path = np.array([transform_points(pose, point) for pose in poses])
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() / 1e-4 <= bound * (1.0 + 1e-6)
