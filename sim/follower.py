"""Lead a robot along a plan of any kind: measured poses of its base in, twists of its base out.

A plan is driven as it is: slower is fine, off its path is not. An error along the path is an error of time; one aside
decays over the distance L that is driven,

    delta_omega = -v e_y / L^2 - 2 |v| e_theta / L        at the axle of a robot with wheels (critically damped),
    delta_twist = -|v| (e_x, e_y, e_theta) / L            of one that moves to all sides, e_x and e_y across the path,

scaled down until the twist keeps the contacts with half of the margin that the plan keeps.
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
"""How far (m, rad) an object may be away from its pose in the chain: five times what cameras err by."""
SAMPLES = 3
"""Measurements one after the other that have to be beyond a limit: one may be wrong."""
SHARE = 0.5
"""Of its margin that a plan keeps while errors are corrected."""
STEERING_DISTANCE = 0.3
"""L, m: a robot 2 mm aside changes its turn by 0.02 rad/m, a small part of what the sets of the examples bear."""

PATIENCE = 0.5
"""Time of inputs that cannot be, one after the other, after which a plan is aborted, s."""

_MOST_SHIFT = 5.0
"""Periods by which time is set at once: an error along the path that asks for more is one of the measurement."""
_MOVING = 0.01
"""Speed (m/s) below which an error along the path says nothing about time."""
_SHARES = np.linspace(1.0, 0.0, 9)
"""Shares of a correction that are tried."""
_STEEPEST, _SHARPEST = 1.5, 6.0
"""Largest slope of 1 - 3 x^2 + 2 x^3 from 0 to 1, and its largest curvature."""
_LONGER, _TRIES = 1.25, 24
"""Factor from one time to stop in to the next that is tried, and how many are."""
_LOOKS = 33
"""Moments of a stop at which its acceleration is looked at."""


class FollowerState(Enum):
    """Where a follower is."""

    FOLLOWING = "following"
    ARRIVED = "arrived"
    STOPPED = "stopped"
    ABORTED = "aborted"


@dataclass(frozen=True, eq=False)
class Command:
    """What the robot is to do until the next step.

    Attributes:
        twist: (3,) body twist (vx, vy, omega) of the robot's base, m/s and rad/s; 0 when there is nothing to do.
        state: Whether there is.
        time: Time of the trajectory, s; with a measured base, when the plan is where that is along the path.
        progress: Share of the trajectory's duration that is over, in [0, 1].
        off: How far (m, rad) the measured base is off the path; None where it was not measured.
        reason: Why the plan was aborted; empty if it was not.
    """

    twist: FloatArray
    state: FollowerState
    time: float
    progress: float
    off: tuple[float, float] | None = None
    reason: str = ""


class Follower:
    """Leads a robot along a plan, without any middleware.

    Args:
        run: A plan, a run, or one read from its log.
        period: For how long the robot keeps a twist, s.
        speed: Factor of the plan's speed, in (0, 1]; may be set at any time.
        off: How far (m, rad) the base may be off the path; None for the goal's tolerance.
        slipped: How far (m, rad) a measured object may be away from its pose in the plan.
        samples: So many measurements of one body, one after the other, have to be beyond these limits to abort the
            plan. The robot does not steer by fewer, and goes on by time.

    Attributes:
        plan: What is followed.
        trajectory: Of the plate frame.
        events: What was dropped of what came in, at the trajectory's times.

    Raises:
        PushplanError: When there is no plan, or a number is out of its range.
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
            raise PushplanError(f"there is nothing to follow in {run!r:.40}; allowed: a plan, or a run that has one")
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
        """(v, 2) outline of robot, plate and objects in the frame of the base, m; see `Scenario.footprint`."""
        return self.plan.scenario.footprint

    def stop(self) -> None:
        """Slow down along the path from now on, within the limits of the robot, and stand still."""
        self._drive.stop()

    def abort(self, reason: str) -> None:
        """Stop for good: all commands from now on are 0 and give the first reason."""
        self._reason = self._reason or reason

    def step(
        self,
        base_pose: ArrayLike | None = None,
        object_poses: ArrayLike | None = None,
        *,
        elapsed: float | None = None,
    ) -> Command:
        """Return what the robot is to do for the next `period`.

        Numbers that cannot be are dropped with an event; where that goes on for `PATIENCE`, the plan is aborted.

        Args:
            base_pose: (3,) measured pose of the base in the world; None goes by time alone.
            object_poses: (n, 3) measured poses of the objects in the world, in the order of `scenario.poses`, None or
                NaN where one was not seen; one that is off its planned pose by more than `slipped`, `samples` times
                in a row, aborts the plan.
            elapsed: Time since the last step, s; None for `period`, and 0 at the first. Where it is none, the twist
                is 0.

        Raises:
            PushplanError: When poses have another shape, or there are words instead of numbers.
        """
        drive, before, duration = self._drive, self._drive.at, self.trajectory.duration
        timed = self._intake.elapsed(self._period if elapsed is None else elapsed)
        if timed:
            drive.advance(self._ahead if elapsed is None else elapsed * self._speed)
        measured = None if base_pose is None else self._intake.pose(base_pose, "pose of the base")
        self._bad = 0 if timed and (measured is None) == (base_pose is None) else self._bad + 1
        if self._bad * self._period > PATIENCE:
            self.abort(f"for {PATIENCE:g} s nothing has come in that can be: {self.events[-1].text}")
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
        """Set the time to when the plan is where the robot is along the path, unless that is too far from there.

        Returns:
            The error (3,) left, and whether it is beyond its limit.
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
        """Return whether a measurement is beyond what is allowed; abort once several have been."""
        beyond = far > allowed[0] or turned > allowed[1]
        self._beyond[who] = self._beyond[who] + 1 if beyond else 0
        if self._beyond[who] >= self._samples:
            found, most = (f"{1e3 * m:.3g} mm and {math.degrees(rad):.3g} deg" for m, rad in ((far, turned), allowed))
            times = f", {self._samples} measurements one after the other" if self._samples > 1 else ""
            self.abort(f"{who} is {found} {what} after {self._drive.at:.2f} s{times}; allowed: {most}")
        return beyond


class Steering:
    """A plan as seen from the frame in which errors are corrected: the axle's, or the plate frame without wheels.

    Args:
        plan: What to follow, timed.
    """

    def __init__(self, plan: Plan) -> None:
        assert plan.trajectory is not None
        self._plan, self._trajectory, self._pusher = plan, plan.trajectory, plan.scenario.pusher
        axle = self._pusher.drive.axle
        self._wheels = axle is not None
        self._frame = np.zeros(3) if axle is None else se2.relative(self._pusher.plate_pose, axle)

    def planned(self, time: float, ahead: float, period: float) -> FloatArray:
        """Return the constant twist (3,) that leads in `period` from where the plan is to where it is `ahead`, s."""
        begin, end = self._poses(np.array([time, time + ahead]))
        twist = se2.log(se2.relative(begin, end)) / period
        if self._wheels:
            twist[1] = 0.0  # of the third order of the period: the planned twist changes meanwhile
        return twist

    def of(self, frame: FloatArray, twist: FloatArray) -> FloatArray:
        """Return a twist (3,) of this frame as one of another, which is at a pose (3,) in the plate frame."""
        return se2.twist_of(se2.relative(self._frame, frame), twist)

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
        bearable = self._possible(tried) & self._keeps(se2.twist_of(se2.inverse(self._frame), tried), time)
        bearable[-1] = True  # the plan's own
        return np.asarray(tried[int(bearable.argmax())])

    def _keeps(self, twists: FloatArray, time: float) -> BoolArray:
        """Tell which twists (k, 3) of the plate frame keep the contacts that there are at a time; rest keeps all.

        Alone the robot may move as it likes, but for backing off a load that it touches.
        """
        segment = self._plan.segments[int(self._plan.segment_at(np.array([time]))[0])]
        if not segment.pushes or segment.load is None:
            return np.full(len(twists), segment.kind != RETREAT)
        least = segment.margin if segment.min_margin is None else min(segment.margin, segment.min_margin)
        stable = segment.load.stable_set(self._plan.stable_set)
        fine = np.ones(len(twists), dtype=bool)
        moves = np.abs(twists).max(axis=1) > 0.0
        asked = se2.twist_of(segment.load.frame_plate, twists[moves])
        fine[moves] = stable.margin(asked) >= SHARE * max(0.0, least)
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
        """Tell which twists (k, 3) keep the angular speed and a car's radius."""
        least, most = self._pusher.limits.both("angular_speed")
        fine = (twists[:, 2] >= -least) & (twists[:, 2] <= most)
        fine &= np.abs(twists[:, 2]) * self._pusher.drive.min_radius <= np.hypot(*twists[:, :2].T)
        return fine

    def _poses(self, times: FloatArray) -> FloatArray:
        return se2.compose(self._trajectory.poses_at(times), self._frame)


class Drive:
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
        """Go on by a time, s, and return the pose (3,) of the trajectory there."""
        self.at = self.after(dt)
        if self.stopping:
            self._stopping_for = min(self._stopping_for + dt, self._stop_time)
        return np.asarray(self.trajectory.poses_at([self.at])[0])

    def after(self, dt: float) -> float:
        """Return the time on the trajectory that it goes on to in a time, s."""
        if not self.stopping:
            return min(self.at + dt, self.trajectory.duration)
        stopping_for = min(self._stopping_for + dt, self._stop_time)
        at = self._stop_from + float(_passed(stopping_for, self._stop_time))
        return min(at, self.trajectory.duration)

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
