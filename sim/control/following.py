"""A timed path that the plate is led along, and back to where it is off it."""

from __future__ import annotations

import numpy as np

from pushplan.geometry.se2 import compose, log, relative
from pushplan.mechanics.chain import Limits
from pushplan.plans.path import cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.follower import Drive, Steering
from pushplan.util.arrays import FloatArray

EXACT = 1e-7
"""Up to here (m, rad) the plate is on its path."""
SHIFT = 0.2
"""Share of a period by which time goes faster or slower where the plate is ahead or behind."""


class Following:
    """Leads the plate along a trajectory by twists of the trajectory's frame.

    Attributes:
        drive: The place on the trajectory.

    Args:
        trajectory: Of the load's contact frame, or of the plate frame.
        limits: Of the pusher.
        rate: Steps per second.
        frame: (3,) pose of the trajectory's frame in the plate frame.
        steering: Corrects errors; None follows a short path as it is.
    """

    def __init__(
        self, trajectory: Trajectory, limits: Limits, rate: float, frame: FloatArray, steering: Steering | None = None
    ) -> None:
        self.drive = Drive(trajectory, limits)
        self._rate, self._frame, self._steering = rate, frame, steering

    def ahead(self) -> tuple[FloatArray, float]:
        """Return poses (m, 3) of the frame from where it is to the end of the path, and the cost of these, m."""
        drive = self.drive
        poses = drive.trajectory.poses_at(np.arange(drive.at, drive.trajectory.duration, 0.02))
        return poses, float(cost_rate(log(relative(poses[:-1], poses[1:]))).sum())

    def twist(self, plate: FloatArray) -> FloatArray:
        """Go on by a period and return the twist (3,) for it, the frame being at a pose (3,) in the world."""
        drive, before = self.drive, self.drive.at
        wanted = drive.advance(1.0 / self._rate)
        off = np.abs(relative(drive.trajectory.poses_at([before])[0], plate))
        if off.max() > EXACT and self._steering is not None:
            return self._steered(self._steering, plate, before, drive.at - before)
        return np.asarray(log(relative(plate, wanted)) * self._rate)

    def _steered(self, steering: Steering, plate: FloatArray, before: float, ahead: float) -> FloatArray:
        """Return the planned twist (3,) and what correction contacts bear; an error along the path is one of time."""
        drive, period = self.drive, 1.0 / self._rate
        error = steering.error(before, compose(plate, drive.trajectory.base))
        twist = steering.corrected(steering.planned(before, ahead, period), error, before)
        if not drive.stopping:
            shift = steering.delay(before, error)
            drive.at += min(max(shift, -SHIFT * period), SHIFT * period)
            drive.at = min(max(drive.at, before), drive.trajectory.duration)
        return steering.of(self._frame, twist)
