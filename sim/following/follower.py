"""A plan, one step of a control loop at a time."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import degrees

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.mechanics.body import outline_of_all
from pushplan.plans.result import Run
from pushplan.sets.stable_set import StableSet
from pushplan.sim.following.contacts import Contacts, OnePush, SeveralPushes
from pushplan.sim.following.steering import Steering
from pushplan.util.arrays import FloatArray, frozen

SLIPPED = (0.005, float(np.radians(2.0)))
"""How far (m, rad) an object may be off its place in the chain: five times what cameras that see markers err by."""

_MOST_SHIFT = 5.0
"""Periods by which time is set at once: an error along the path that asks for more is one of the measurement."""


class FollowerState(Enum):
    """Where a follower is."""

    FOLLOWING = "following"
    ARRIVED = "arrived"
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
        run: A run, or one read from its log.
        period: For how long the robot keeps a twist, s.
        speed: Factor of the plan's speed, in (0, 1]; may be set at any time.
        off: How far (m, rad) the base may be off the path; None for the goal's tolerance.
        slipped: How far (m, rad) a measured object may be off its place in the chain.
        stable_set: The set of a plan of one push, where it is one of the user's; None looks it up by its name.

    Attributes:
        trajectory: What is followed.
        chain: What is pushed, and the robot.

    Raises:
        PushplanError: When the run has no plan, or a number is out of its range.
    """

    def __init__(
        self,
        run: Run | RecordedRun,
        *,
        period: float = 0.02,
        speed: float = 1.0,
        off: tuple[float, float] | None = None,
        slipped: tuple[float, float] = SLIPPED,
        stable_set: StableSet | None = None,
    ) -> None:
        plan, goal = run.plan, run.scenario.goal
        if plan is None or plan.trajectory is None:
            raise PushplanError(f"{run.scenario.name}: there is no plan to follow")
        if not 0.0 < period < 1.0:
            raise PushplanError(f"period is {period} s; allowed: above 0 and below 1")
        self.trajectory, self.chain, self.speed = plan.trajectory, run.scenario.chain, speed
        self._period, self._slipped = period, slipped
        self._off = (goal.position_tolerance, goal.angle_tolerance) if off is None else off
        self._contacts: Contacts
        if plan.segments:
            self._contacts = SeveralPushes(run.scenario, plan.segments, plan.stable_set)
        else:
            stable = run.scenario.stable_set(plan.stable_set) if stable_set is None else stable_set
            self._contacts = OnePush(run.scenario, plan, stable)
        self._steering = Steering(plan.trajectory, self.chain.pusher, self._contacts)
        self._time, self._ahead, self._reason = 0.0, 0.0, ""

    @property
    def speed(self) -> float:
        """Factor of the plan's speed, in (0, 1]."""
        return self._speed

    @speed.setter
    def speed(self, factor: float) -> None:
        if not 0.0 < factor <= 1.0:
            raise PushplanError(
                f"speed is {factor}; allowed: a factor above 0 and up to 1 of the plan's speed"
            )
        self._speed = factor

    @property
    def footprint(self) -> FloatArray:
        """(v, 2) outline of robot, plate and objects in the frame of the base, m, counter-clockwise.

        Without the objects where the plate comes and goes, in plans of several pushes.
        """
        return se2.transform_points(se2.inverse(self.trajectory.base), outline_of_all(self._contacts.carried))

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

        Args:
            base_pose: (3,) measured pose of the base in the world; None goes by time alone.
            object_poses: (n, 3) measured poses of the objects in the world, in the chain's order; one that is off its
                place in the chain by more than `slipped` aborts the plan.
            elapsed: Time since the last step, s; None for `period`, and 0 at the first.
        """
        before, duration = self._time, self.trajectory.duration
        passed = self._ahead if elapsed is None else elapsed * self._speed
        self._time = min(before + passed, duration)
        measured = None if base_pose is None else frozen(base_pose, (3,), "pose of the base")
        error = None if measured is None else self._located(measured, before)
        if object_poses is not None:
            self._watch_objects(
                frozen(object_poses, (len(self.chain.objects), 3), "poses of objects"), measured
            )
        off = None if error is None else (float(np.hypot(*error[:2])), float(abs(error[2])))
        self._ahead = min(self._period * self._speed, duration - self._time)
        state = FollowerState.FOLLOWING
        if self._reason or self._ahead == 0.0:
            state = FollowerState.ABORTED if self._reason else FollowerState.ARRIVED
        twist = np.zeros(3)
        if state is FollowerState.FOLLOWING:
            twist = self._steering.planned(self._time, self._ahead, self._period)
            twist = twist if error is None else self._steering.corrected(twist, error, self._time)
            twist = self._steering.of_base(twist)
        else:
            self._ahead = 0.0
        progress = self._time / duration if duration else 1.0
        return Command(twist, state, self._time, progress, off, self._reason)

    def _located(self, measured: FloatArray, before: float) -> FloatArray:
        """Set the time to when the plan is where the robot is along the path, and return the error (3,) left."""
        shift = self._steering.delay(self._time, self._steering.error(self._time, measured))
        most = _MOST_SHIFT * self._period
        shifted = self._time + min(max(shift, -most), most)
        self._time = min(max(shifted, before), self.trajectory.duration)
        error = self._steering.error(self._time, measured)
        self._check("the base", "off the path", float(np.hypot(*error[:2])), float(abs(error[2])), self._off)
        return error

    def _watch_objects(self, poses: FloatArray, measured: FloatArray | None) -> None:
        base = self.trajectory.base_poses_at(np.array([self._time]))[0] if measured is None else measured
        robot_pose = se2.compose(base, se2.inverse(self.trajectory.base))
        load_pose = self._contacts.load_pose(robot_pose, self._time)
        for obj, pose in zip(self.chain.objects, poses, strict=True):
            far, turned = se2.pose_error(pose, se2.compose(load_pose, obj.pose_chain))
            self._check(f"'{obj.name}'", "off its place in the chain", far, turned, self._slipped)

    def _check(self, who: str, what: str, far: float, turned: float, allowed: tuple[float, float]) -> None:
        if far > allowed[0] or turned > allowed[1]:
            self.abort(
                f"{who} is {1e3 * far:.3g} mm and {degrees(turned):.3g} deg {what} after {self._time:.2f} s; "
                f"allowed: {1e3 * allowed[0]:.3g} mm and {degrees(allowed[1]):.3g} deg"
            )
