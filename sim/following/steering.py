"""Twists that follow a trajectory with the robot's base, and steer errors aside away without losing a contact.

A plan is driven as it is: slower is fine, off its path is not. An error along the path is an error of time; one aside
decays over the distance L that is driven,

    delta_omega = -v e_y / L^2 - 2 |v| e_theta / L        at the axle of a robot with wheels (critically damped),
    delta_twist = -|v| (e_x, e_y, e_theta) / L            of one that moves to all sides, e_x and e_y across the path,

scaled down until the twist keeps the contacts with half of the margin that the plan keeps.
"""

from __future__ import annotations

import numpy as np

from pushplan.geometry import se2
from pushplan.mechanics.chain import Pusher
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.following.contacts import Contacts
from pushplan.util.arrays import BoolArray, FloatArray

STEERING_DISTANCE = 0.3
"""L, m: a robot 2 mm aside changes its turn by 0.02 rad/m, a small part of what the sets of the examples bear."""

_MOVING = 0.01
"""Speed (m/s) below which an error along the path says nothing about time."""

_SHARES = np.linspace(1.0, 0.0, 9)
"""Shares of a correction that are tried."""


class Steering:
    """A trajectory as seen from the frame in which errors are corrected: the axle's, or the robot's without wheels.

    Args:
        trajectory: What to follow.
        pusher: The robot.
        contacts: That corrected twists have to keep.
    """

    def __init__(self, trajectory: Trajectory, pusher: Pusher, contacts: Contacts) -> None:
        axle = pusher.drive.axle
        self._trajectory, self._pusher, self._contacts = trajectory, pusher, contacts
        self._wheels = axle is not None
        self._frame = np.zeros(3) if axle is None else axle

    def planned(self, time: float, ahead: float, period: float) -> FloatArray:
        """Return the constant twist (3,) that leads in `period` from where the plan is to where it is `ahead`, s."""
        begin, end = self._poses(np.array([time, time + ahead]))
        twist = se2.log(se2.relative(begin, end)) / period
        if self._wheels:
            twist[1] = 0.0  # of the third order of the period: the planned twist changes meanwhile
        return twist

    def of_base(self, twist: FloatArray) -> FloatArray:
        """Return a twist (3,) of this frame as one of the robot's base."""
        return se2.twist_of(se2.relative(self._frame, self._trajectory.base), twist)

    def error(self, time: float, base_pose: FloatArray) -> FloatArray:
        """Return where a measured base (3,) puts this frame, seen from where the plan has it at a time (3,)."""
        (planned,) = self._poses(np.array([time]))
        measured = se2.compose(base_pose, se2.relative(self._trajectory.base, self._frame))
        error = se2.relative(planned, measured)
        return np.array([*error[:2], float(se2.wrap_angle(error[2]))])

    def delay(self, time: float, error: FloatArray) -> float:
        """Return by how much (s) the plan passes nearest to an error (3,) later than at `time`; 0 at rest."""
        v = se2.twist_of(self._frame, self._trajectory.twists_at(np.array([time])))[0, :2]
        speed = float(np.hypot(*v))
        return 0.0 if speed < _MOVING else float(error[:2] @ v) / speed**2

    def corrected(self, twist: FloatArray, error: FloatArray, time: float) -> FloatArray:
        """Return a planned twist (3,) with as much of the correction of an error (3,) as robot and contacts bear."""
        tried = twist + _SHARES[:, None] * self._change(twist, error)
        bearable = self._possible(tried) & self._contacts.keep(
            se2.twist_of(se2.inverse(self._frame), tried), time
        )
        bearable[-1] = True  # the plan's own
        return np.asarray(tried[int(bearable.argmax())])

    def _change(self, twist: FloatArray, error: FloatArray) -> FloatArray:
        speed, distance = float(np.hypot(*twist[:2])), STEERING_DISTANCE
        if speed == 0.0:
            return np.zeros(3)
        if self._wheels:
            turn = -twist[0] * error[1] / distance**2 - 2.0 * speed * error[2] / distance
            return np.array([0.0, 0.0, turn])
        ahead = twist[:2] / speed
        across = error[:2] - (error[:2] @ ahead) * ahead
        return -speed / distance * np.array([*across, error[2]])

    def _possible(self, twists: FloatArray) -> BoolArray:
        """Tell which twists (k, 3) keep the angular speed and a car's radius."""
        least, most = self._pusher.limits.both("angular_speed")
        fine = (twists[:, 2] >= -least) & (twists[:, 2] <= most)
        fine &= np.abs(twists[:, 2]) * self._pusher.drive.min_radius <= np.hypot(*twists[:, :2].T)
        return fine

    def _poses(self, times: FloatArray) -> FloatArray:
        return se2.compose(self._trajectory.poses_at(times), self._frame)
