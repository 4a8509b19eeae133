"""Driving along a trajectory in ticks, and stopping on it."""

from __future__ import annotations

import math

import numpy as np

from pushplan.mechanics.chain import Limits
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray

_STEEPEST, _SHARPEST = 1.5, 6.0
"""Largest slope of 1 - 3 x^2 + 2 x^3 from 0 to 1, and its largest curvature."""
_LONGER, _TRIES = 1.25, 24
"""Factor from one time to stop in to the next that is tried, and how many are."""
_LOOKS = 33
"""Moments of a stop at which its acceleration is looked at."""


class Driving:
    """A place on a trajectory that goes on with time, until it stops.

    Stopping keeps to the path: trajectory time slows down by 1 - 3 x^2 + 2 x^3, x from 0 to 1. The time that takes is
    chosen so that the pusher's limits hold.

    Attributes:
        trajectory: What is followed.
        at: Time on the trajectory, s.
    """

    def __init__(self, trajectory: Trajectory, limits: Limits) -> None:
        """Begin at the trajectory's beginning.

        Args:
            trajectory: What to follow.
            limits: Of the pusher.
        """
        self.trajectory, self.at = trajectory, 0.0
        self._limits = limits
        self._stop_from, self._stop_time, self._stopping_for = 0.0, math.inf, 0.0

    @property
    def stopping(self) -> bool:
        """Whether it was told to stop."""
        return self._stop_time < math.inf

    @property
    def over(self) -> bool:
        """Whether the plate stands still from now on."""
        return self._stopping_for >= self._stop_time or self.at >= self.trajectory.duration

    def stop(self) -> None:
        """Slow down from now on."""
        if not self.stopping and not self.over:
            self._stop_from, self._stop_time = self.at, self._time_to_stop()

    def advance(self, dt: float) -> FloatArray:
        """Go on by a time, s, and return the pose (3,) of the chain frame in the world."""
        if self.stopping:
            self._stopping_for = min(self._stopping_for + dt, self._stop_time)
            at = self._stop_from + float(_passed(self._stopping_for, self._stop_time))
        else:
            at = self.at + dt
        self.at = min(at, self.trajectory.duration)
        return np.asarray(self.trajectory.poses_at([self.at])[0])

    def _time_to_stop(self) -> float:
        """Return the shortest time to stop in, of a geometric series, for which the limits hold."""
        vx, vy, omega = self.trajectory.twists_at([self.at])[0]
        limits, time = self._limits, 0.02
        for speed, acceleration, jerk in (
            (math.hypot(vx, vy), limits.both("acceleration")[0], limits.jerk),
            (abs(omega), limits.both("angular_acceleration")[0], limits.angular_jerk),
        ):
            time = max(time, _STEEPEST * speed / acceleration, math.sqrt(_SHARPEST * speed / jerk))
        for _ in range(_TRIES):
            if not self._is_too_sudden(time):
                break
            time *= _LONGER
        return time

    def _is_too_sudden(self, time: float) -> bool:
        """Tell whether stopping in a time asks for more acceleration than there may be, the path's own included."""
        ticks = np.linspace(0.0, time, _LOOKS)
        x = ticks / time
        at = self.at + _passed(ticks, time)
        moving = (1.0 - 3.0 * x**2 + 2.0 * x**3) * (at < self.trajectory.duration)
        steps = np.diff(self.trajectory.twists_at(at) * moving[:, None], axis=0) / ticks[1]
        most = self._limits.both("acceleration")[0], self._limits.both("angular_acceleration")[0]
        return bool(np.hypot(steps[:, 0], steps[:, 1]).max() > most[0] or np.abs(steps[:, 2]).max() > most[1])


def _passed(since: FloatArray | float, time: float) -> FloatArray:
    """Return the trajectory time that passes in the first `since` seconds of stopping in `time` seconds."""
    x = np.asarray(since) / time
    return np.asarray(time * (x - x**3 + 0.5 * x**4))
