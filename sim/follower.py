"""Guide a robot along a plan of any kind: measured poses of its base in, twists of its base out.

The robot can be slower than the plan, but must stay on its path. An error along the path changes only the time; an
error across the path decays over the driven distance L,

    delta_omega = -v e_y / L^2 - 2 |v| e_theta / L        at the axle of a robot with wheels (critically damped),
    delta_twist = -|v| (e_x, e_y, e_theta) / L            of an omnidirectional robot, e_x and e_y across the path.

The correction is scaled down until the contacts keep half of the plan's margin.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.chain import Limits
from pushplan.plans.plan import Plan
from pushplan.plans.run import Event, Run
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.intake import Intake
from pushplan.util.arrays import BoolArray, FloatArray, plain_number
from pushplan.util.names import FARTHEST, RETREAT

if TYPE_CHECKING:
    from pushplan.logging.recorded import RecordedRun

SLIPPED = (0.005, float(np.radians(2.0)))
"""Largest pose error of an object in the chain (m, rad): five times the error of cameras."""
SAMPLES = 3
"""Number of successive measurements that must exceed a limit; a single one can be wrong."""
SHARE = 0.5
"""Share of its margin that a plan keeps while errors are corrected."""
STEERING_DISTANCE = 0.3
"""L, m: an offset of 2 mm changes the curvature by 0.02 rad/m, a small part of the examples' stable sets."""

PATIENCE = 0.5
"""Time of successive invalid inputs after which a plan is aborted, s."""

_MOST_SHIFT = 5.0
"""Largest correction of the time in a step, periods; a larger error along the path is a measurement error."""
_MOVING = 0.01
"""Speed (m/s) below which an error along the path is not converted to time."""
_SHARES = np.linspace(1.0, 0.0, 9)
"""Shares of a correction that are tried."""
_STEEPEST, _SHARPEST = 1.5, 6.0
"""Largest slope of 1 - 3 x^2 + 2 x^3 from 0 to 1, and its largest curvature."""
_RATIO, _TRIES = 1.25, 24
"""Ratio of successive stopping times that are tried, and their number."""
_CHECKS = 33
"""Number of moments at which the acceleration of a stop is checked."""


class FollowerState(Enum):
    """State of a follower."""

    FOLLOWING = "following"
    ARRIVED = "arrived"
    STOPPED = "stopped"
    ABORTED = "aborted"


@dataclass(frozen=True, eq=False)
class Command:
    """Command to the robot until the next step.

    Attributes:
        twist: Body twist (vx, vy, omega) of the robot's base, m/s and rad/s, (3,); 0 unless it follows the plan.
        state: State of the follower.
        time: Trajectory time, s; with a measured base, the time of the nearest point of the path.
        progress: Elapsed share of the trajectory's duration, in [0, 1].
        off: Error (m, rad) of the measured base from the path; None without a measurement.
        reason: Reason of the abort; empty without one.
    """

    twist: FloatArray
    state: FollowerState
    time: float
    progress: float
    off: tuple[float, float] | None = None
    reason: str = ""


class Follower:
    """Guides a robot along a plan, without any middleware.

    Args:
        run: Plan, run, or run read from its log.
        period: Time for which the robot keeps a twist, s.
        speed: Factor of the plan's speed, in (0, 1]; can be set at any time.
        off: Largest error (m, rad) of the base from the path; None for the goal's tolerance.
        slipped: Largest error (m, rad) of a measured object from its pose in the plan.
        samples: Number of successive measurements of one body beyond these limits that abort the plan. The robot
            ignores fewer of them and goes on by time.

    Attributes:
        plan: Followed plan.
        trajectory: Trajectory of the plate frame.
        events: Dropped inputs, at trajectory times.

    Raises:
        PushplanError: If there is no plan, or a number is out of its range.
    """

    def __init__(
        self,
        run: Plan | Run | RecordedRun,
        *,
        period: float = 0.02,
        speed: float = 1.0,
        off: tuple[float, float] | None = None,
        slipped: tuple[float, float] = SLIPPED,
        samples: int = SAMPLES,
    ) -> None:
        plan = run if isinstance(run, Plan) else getattr(run, "plan", run)
        if not isinstance(plan, Plan | None):
            raise PushplanError(f"there is no plan in {run!r:.40}; allowed: a plan, or a run with a plan")
        if plan is None or plan.trajectory is None:
            raise PushplanError(f"{run.scenario.name}: there is no plan to follow")
        if not 0.0 < period < 1.0:
            raise PushplanError(f"period is {period} s; allowed: above 0 and below 1")
        self.plan, self.trajectory, self.speed = plan, plan.trajectory, speed
        goals = [goals[0] for goals in plan.scenario.goals.values()]
        tolerance = (min(g.position_tolerance for g in goals), min(g.angle_tolerance for g in goals))
        self._period, self._slipped, self._off = period, slipped, tolerance if off is None else off
        self._steering = Steering(plan)
        self._drive = Drive(plan.trajectory, plan.scenario.pusher.limits)
        for name, pair in (("off", self._off), ("slipped", slipped)):
            if np.shape(pair) != (2,) or not all(0.0 <= value <= FARTHEST for value in pair):
                raise PushplanError(f"{name} is {pair}; allowed: a distance (m) and an angle (rad), both >= 0")
        self._samples, self._beyond = plain_number(samples), Counter[str]()
        if type(self._samples) is not int or self._samples < 1:
            raise PushplanError(f"samples is {samples!r:.40}; allowed: a whole number from 1")
        self._ahead, self._reason = 0.0, ""
        self.events: list[Event] = []
        self._intake, self._bad = Intake(self._dropped), 0

    def _dropped(self, words: str) -> None:
        self.events.append(Event(self._drive.at, "dropped", words))

    @property
    def speed(self) -> float:
        """Factor of the plan's speed, in (0, 1]."""
        return self._speed

    @speed.setter
    def speed(self, factor: float) -> None:
        if not 0.0 < factor <= 1.0:
            raise PushplanError(f"speed is {factor}; allowed: a factor above 0 and up to 1 of the plan's speed")
        self._speed = factor

    @property
    def footprint(self) -> FloatArray:
        """Outline of robot, plate and objects in the frame of the base, m, (v, 2); see `Scenario.footprint`."""
        return self.plan.scenario.footprint

    def stop(self) -> None:
        """Start to slow down along the path, within the limits of the robot, to a standstill."""
        self._drive.stop()

    def abort(self, reason: str) -> None:
        """Stop for good: all further commands are 0 and give the first reason."""
        self._reason = self._reason or reason

    def step(
        self,
        base_pose: ArrayLike | None = None,
        object_poses: ArrayLike | None = None,
        *,
        elapsed: float | None = None,
    ) -> Command:
        """Return the command for the next `period`.

        Invalid numbers are dropped with an event. Invalid inputs for longer than `PATIENCE` abort the plan.

        Args:
            base_pose: Measured pose of the base in the world, (3,); None to go on by time alone.
            object_poses: Measured poses of the objects in the world, in the order of `scenario.poses`, (n, 3); None
                or NaN for an object that was not seen. `samples` successive errors above `slipped` abort the plan.
            elapsed: Time since the last step, s; None for `period`, and 0 at the first step. If it is invalid, the
                twist is 0.

        Raises:
            PushplanError: If poses have another shape, or hold text instead of numbers.
        """
        drive, before, duration = self._drive, self._drive.at, self.trajectory.duration
        timed = self._intake.elapsed(self._period if elapsed is None else elapsed)
        if timed:
            drive.advance(self._ahead if elapsed is None else elapsed * self._speed)
        measured = None if base_pose is None else self._intake.pose(base_pose, "pose of the base")
        self._bad = 0 if timed and (measured is None) == (base_pose is None) else self._bad + 1
        if self._bad * self._period > PATIENCE:
            self.abort(f"no valid input for {PATIENCE:g} s: {self.events[-1].text}")
        error, beyond = (None, False) if measured is None else self._located(measured, before)
        if object_poses is not None:
            names = list(self.plan.segments[0].before)
            self._watch_objects(self._intake.poses(object_poses, names, "poses of objects"), measured)
        off = None if error is None else (float(np.hypot(*error[:2])), float(abs(error[2])))
        self._ahead = self._period * self._speed
        ahead = drive.after(self._ahead) - drive.at
        state = FollowerState.FOLLOWING
        if self._reason or ahead == 0.0 or not timed:
            state = FollowerState.ARRIVED if drive.at >= duration else FollowerState.STOPPED
            state = FollowerState.ABORTED if self._reason else state
        twist = np.zeros(3)
        if state is FollowerState.FOLLOWING:
            twist = self._steering.planned(drive.at, ahead, self._period)
            twist = twist if error is None or beyond else self._steering.corrected(twist, error, drive.at)
            twist = self._steering.of(self.trajectory.base, twist)
        else:
            self._ahead = 0.0
        progress = drive.at / duration if duration else 1.0
        return Command(twist, state, drive.at, progress, off, self._reason)

    def _located(self, measured: FloatArray, before: float) -> tuple[FloatArray, bool]:
        """Set the trajectory time to the path point nearest to the robot, unless the error exceeds its limit.

        Returns:
            The remaining error (3,), and whether it exceeds its limit.
        """
        drive, timed = self._drive, self._drive.at
        if not drive.stopping:
            shift = self._steering.delay(drive.at, self._steering.error(drive.at, measured))
            most = _MOST_SHIFT * self._period
            shifted = drive.at + min(max(shift, -most), most)
            drive.at = min(max(shifted, before), self.trajectory.duration)
        error = self._steering.error(drive.at, measured)
        far, turned = float(np.hypot(*error[:2])), float(abs(error[2]))
        beyond = self._check("the base", "off the path", far, turned, self._off)
        if beyond:
            drive.at = timed
        return error, beyond

    def _watch_objects(self, poses: FloatArray, measured: FloatArray | None) -> None:
        trajectory, at = self.trajectory, np.array([self._drive.at])
        base = trajectory.base_poses_at(at)[0] if measured is None else measured
        plate = se2.compose(base, se2.inverse(trajectory.base))
        segment = self.plan.segments[int(self.plan.segment_at(at)[0])]
        wanted = dict(segment.before)
        if segment.pushes and segment.load is not None:
            wanted |= segment.load.poses(plate)
        for (name, place), pose in zip(wanted.items(), poses, strict=True):
            if not np.isnan(pose).any():
                off = se2.pose_error(pose, place)
                self._check(f"'{name}'", "away from its pose in the chain", *off, self._slipped)

    def _check(self, who: str, what: str, far: float, turned: float, allowed: tuple[float, float]) -> bool:
        """Return whether an error exceeds its limit; abort after `samples` successive ones."""
        beyond = far > allowed[0] or turned > allowed[1]
        self._beyond[who] = self._beyond[who] + 1 if beyond else 0
        if self._beyond[who] >= self._samples:
            found, most = (f"{1e3 * m:.3g} mm and {math.degrees(rad):.3g} deg" for m, rad in ((far, turned), allowed))
            times = f", in {self._samples} successive measurements" if self._samples > 1 else ""
            self.abort(f"{who} is {found} {what} after {self._drive.at:.2f} s{times}; allowed: {most}")
        return beyond


class Steering:
    """A plan in the frame of the error correction: the axle frame, or the plate frame without wheels.

    Args:
        plan: Timed plan.
    """

    def __init__(self, plan: Plan) -> None:
        assert plan.trajectory is not None
        self._plan, self._trajectory, self._pusher = plan, plan.trajectory, plan.scenario.pusher
        axle = self._pusher.drive.axle
        self._wheels = axle is not None
        self._frame = np.zeros(3) if axle is None else se2.relative(self._pusher.plate_pose, axle)

    def planned(self, time: float, ahead: float, period: float) -> FloatArray:
        """Return the constant twist (3,) that covers the plan's motion from `time` to `time + ahead` in `period`."""
        begin, end = self._poses(np.array([time, time + ahead]))
        twist = se2.log(se2.relative(begin, end)) / period
        if self._wheels:
            twist[1] = 0.0  # of third order in the period, because the planned twist changes
        return twist

    def of(self, frame: FloatArray, twist: FloatArray) -> FloatArray:
        """Return a twist (3,) of this frame as the twist of `frame`, a pose (3,) in the plate frame."""
        return se2.twist_of(se2.relative(self._frame, frame), twist)

    def error(self, time: float, base_pose: FloatArray) -> FloatArray:
        """Return the measured pose of this frame relative to its planned pose at `time` (3,)."""
        (planned,) = self._poses(np.array([time]))
        measured = se2.compose(base_pose, se2.relative(self._trajectory.base, self._frame))
        error = se2.relative(planned, measured)
        return np.array([*error[:2], float(se2.wrap_angle(error[2]))])

    def delay(self, time: float, error: FloatArray) -> float:
        """Return the delay (s) after `time` at which the plan is nearest to an error (3,); 0 at rest."""
        v = se2.twist_of(self._frame, self._trajectory.twists_at(np.array([time])))[0, :2]
        speed = float(np.hypot(*v))
        return 0.0 if speed < _MOVING else float(error[:2] @ v) / speed**2

    def corrected(self, twist: FloatArray, error: FloatArray, time: float) -> FloatArray:
        """Add the largest share of the correction of an error (3,) to a twist (3,) that robot and contacts allow."""
        tried = twist + _SHARES[:, None] * self._change(twist, error)
        bearable = self._possible(tried) & self._keeps(se2.twist_of(se2.inverse(self._frame), tried), time)
        bearable[-1] = True  # the plan's own
        return np.asarray(tried[int(bearable.argmax())])

    def _keeps(self, twists: FloatArray, time: float) -> BoolArray:
        """Return which twists (k, 3) of the plate frame keep the contacts at a time; rest keeps all.

        Without a load, every twist is allowed, except on a retreat from an object that the plate touches.
        """
        segment = self._plan.segments[int(self._plan.segment_at(np.array([time]))[0])]
        if not segment.pushes or segment.load is None:
            return np.full(len(twists), segment.kind != RETREAT)
        least = segment.margin if segment.min_margin is None else min(segment.margin, segment.min_margin)
        stable = segment.load.stable_set(self._plan.stable_set)
        fine = np.ones(len(twists), dtype=bool)
        moves = np.abs(twists).max(axis=1) > 0.0
        contact_twists = se2.twist_of(segment.load.frame_plate, twists[moves])
        fine[moves] = stable.margin(contact_twists) >= SHARE * max(0.0, least)
        return fine

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
        """Return which twists (k, 3) keep the limits of angular speed and turning radius."""
        least, most = self._pusher.limits.both("angular_speed")
        fine = (twists[:, 2] >= -least) & (twists[:, 2] <= most)
        fine &= np.abs(twists[:, 2]) * self._pusher.drive.min_radius <= np.hypot(*twists[:, :2].T)
        return fine

    def _poses(self, times: FloatArray) -> FloatArray:
        return se2.compose(self._trajectory.poses_at(times), self._frame)


class Drive:
    """Position on a trajectory that advances with time until it stops.

    A stop keeps to the path: the rate of trajectory time falls as 1 - 3 x^2 + 2 x^3, x from 0 to 1, over a stopping
    time that respects the pusher's limits.

    Attributes:
        trajectory: Followed trajectory.
        at: Time on the trajectory, s.
    """

    def __init__(self, trajectory: Trajectory, limits: Limits) -> None:
        """Start at the beginning of the trajectory.

        Args:
            trajectory: Trajectory to follow.
            limits: Limits of the pusher.
        """
        self.trajectory, self.at = trajectory, 0.0
        self._limits = limits
        self._stop_from, self._stop_time, self._stopping_for = 0.0, math.inf, 0.0

    @property
    def stopping(self) -> bool:
        """Whether `stop` was called."""
        return self._stop_time < math.inf

    @property
    def over(self) -> bool:
        """Whether the motion has ended."""
        return self._stopping_for >= self._stop_time or self.at >= self.trajectory.duration

    def stop(self) -> None:
        """Start to slow down."""
        if not self.stopping and not self.over:
            self._stop_from, self._stop_time = self.at, self._time_to_stop()

    def advance(self, dt: float) -> FloatArray:
        """Advance by a time `dt`, s, and return the pose (3,) of the trajectory there."""
        self.at = self.after(dt)
        if self.stopping:
            self._stopping_for = min(self._stopping_for + dt, self._stop_time)
        return np.asarray(self.trajectory.poses_at([self.at])[0])

    def after(self, dt: float) -> float:
        """Return the trajectory time that it reaches after a time `dt`, s."""
        if not self.stopping:
            return min(self.at + dt, self.trajectory.duration)
        stopping_for = min(self._stopping_for + dt, self._stop_time)
        at = self._stop_from + float(_passed(stopping_for, self._stop_time))
        return min(at, self.trajectory.duration)

    def _time_to_stop(self) -> float:
        """Return the shortest stopping time of a geometric series that respects the limits, s."""
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
            time *= _RATIO
        return time

    def _is_too_sudden(self, time: float) -> bool:
        """Return whether a stop in `time` exceeds the acceleration limits; the path's own acceleration counts."""
        ticks = np.linspace(0.0, time, _CHECKS)
        x = ticks / time
        at = self.at + _passed(ticks, time)
        moving = (1.0 - 3.0 * x**2 + 2.0 * x**3) * (at < self.trajectory.duration)
        steps = np.diff(self.trajectory.twists_at(at) * moving[:, None], axis=0) / ticks[1]
        most = self._limits.both("acceleration")[0], self._limits.both("angular_acceleration")[0]
        return bool(np.hypot(steps[:, 0], steps[:, 1]).max() > most[0] or np.abs(steps[:, 2]).max() > most[1])


def _passed(since: FloatArray | float, time: float) -> FloatArray:
    """Return the trajectory time that passes in the first `since` seconds of a stop that lasts `time` seconds."""
    x = np.asarray(since) / time
    return np.asarray(time * (x - x**3 + 0.5 * x**4))
