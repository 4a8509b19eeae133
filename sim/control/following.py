"""Guidance of the plate along a trajectory, with correction of its errors."""

from __future__ import annotations

import numpy as np

from pushplan.geometry.se2 import compose, log, relative
from pushplan.mechanics.chain import Limits
from pushplan.plans.path import cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.follower import Drive, Steering
from pushplan.util.arrays import FloatArray

EXACT = 1e-7
"""Largest error of a plate that counts as on its path, m and rad."""
SHIFT = 0.2
"""Largest correction of the trajectory time in a step, as a share of the period."""


class Following:
    """Guides the plate along a trajectory by twists of the trajectory's frame.

    Attributes:
        drive: Position on the trajectory.

    Args:
        trajectory: Trajectory of the load's contact frame, or of the plate frame.
        limits: Limits of the pusher.
        rate: Steps per second, Hz.
        frame: Pose of the trajectory's frame in the plate frame, (3,).
        steering: Correction of errors that keeps the contacts; None for a short path without one.
    """

    def __init__(
        self, trajectory: Trajectory, limits: Limits, rate: float, frame: FloatArray, steering: Steering | None = None
    ) -> None:
        self.drive = Drive(trajectory, limits)
        self._rate, self._frame, self._steering = rate, frame, steering

    def ahead(self) -> tuple[FloatArray, float]:
        """Return the poses (m, 3) of the frame on the rest of the path, and the cost of the rest, m."""
        drive = self.drive
        poses = drive.trajectory.poses_at(np.arange(drive.at, drive.trajectory.duration, 0.02))
        return poses, float(cost_rate(log(relative(poses[:-1], poses[1:]))).sum())

    def twist(self, plate: FloatArray) -> FloatArray:
        """Advance by a period and return its twist (3,), for the pose (3,) of the frame in the world."""
        drive, before = self.drive, self.drive.at
        wanted = drive.advance(1.0 / self._rate)
        off = np.abs(relative(drive.trajectory.poses_at([before])[0], plate))
        if off.max() > EXACT and self._steering is not None:
            return self._steered(self._steering, plate, before, drive.at - before)
        return np.asarray(log(relative(plate, wanted)) * self._rate)

    def _steered(self, steering: Steering, plate: FloatArray, before: float, ahead: float) -> FloatArray:
        """Return the planned twist (3,) with the correction that contacts allow; shift time by an error along it."""
        drive, period = self.drive, 1.0 / self._rate
        error = steering.error(before, compose(plate, drive.trajectory.base))
        twist = steering.corrected(steering.planned(before, ahead, period), error, before)
        if not drive.stopping:
            shift = steering.delay(before, error)
            drive.at += min(max(shift, -SHIFT * period), SHIFT * period)
            drive.at = min(max(drive.at, before), drive.trajectory.duration)
        return steering.of(self._frame, twist)
