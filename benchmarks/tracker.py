"""A baseline for the closed loop: a linear time-varying tracker inside the stable set, without any estimator.

It follows the plan to its end, with the plan's own contacts, and never stops or plans again. Where the plate is, it
takes from the objects: each that is measured says where the plate is if the object is at its planned place on it;
their mean is filtered (`GAIN`), and led on by what the plate was told since. Errors are corrected by the gains of a
linear-quadratic regulator along the path,

    de/dt = A(t) e + B u,    A = [[0, w, -vy], [-w, 0, vx], [0, 0, 0]],

(vx, vy, w) the planned twist, u what is steered with: turns at the axle of a robot with wheels, turns and
motion across of one that moves to all sides; an error along the path is one of time. A correction is scaled down
until robot and contacts bear it, as `Follower` does.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from pushplan.geometry.se2 import compose, exp, inverse, relative, twist_of, wrap_angle
from pushplan.plans.load import Load
from pushplan.plans.plan import Plan
from pushplan.plans.run import Event, Replan
from pushplan.sim.control.following import Following
from pushplan.sim.control.jobs import Phase
from pushplan.sim.control.settings import ControlSettings
from pushplan.sim.follower import Steering
from pushplan.util.arrays import FloatArray

GAIN = 0.15
"""Share of what a measurement is off by which the plate's pose follows it."""
STEP = 0.1
"""Of the regulator, s."""
ERROR = np.array([5e-3, 5e-3, math.radians(1.0)])
"""Errors (m, m, rad) that cost as much as `EFFORT`."""
EFFORT = np.array([math.inf, 0.02, 0.1])
"""Corrections of the twist, m/s, m/s and rad/s."""


class LinearSteering(Steering):
    """Correction of errors with the gains of a regulator that knows the path ahead."""

    def __init__(self, plan: Plan) -> None:
        super().__init__(plan)
        assert plan.trajectory is not None
        self._at = np.arange(0.0, plan.trajectory.duration + STEP, STEP)
        twists = twist_of(self._frame, plan.trajectory.twists_at(np.minimum(self._at, plan.trajectory.duration)))
        means = np.diag(EFFORT**-2.0 if not self._wheels else [0.0, 0.0, EFFORT[2] ** -2.0])
        steers = np.flatnonzero(np.diag(means) > 0.0)
        b, r = np.eye(3)[:, steers] * STEP, means[np.ix_(steers, steers)]
        cost = np.diag(ERROR**-2.0)
        ahead, self._gains = 10.0 * cost, np.zeros((len(self._at), 3, 3))
        for k in reversed(range(len(self._at))):
            vx, vy, turn = twists[k]
            a = np.eye(3) + STEP * np.array([[0.0, turn, -vy], [-turn, 0.0, vx], [0.0, 0.0, 0.0]])
            gain = np.linalg.solve(r * STEP + b.T @ ahead @ b, b.T @ ahead @ a)
            ahead = cost * STEP + a.T @ ahead @ (a - b @ gain)
            self._gains[k, steers] = gain
        self.time = 0.0

    def _change(self, twist: FloatArray, error: FloatArray) -> FloatArray:
        gain = self._gains[min(int(self.time / STEP), len(self._gains) - 1)]
        return np.asarray(-gain @ error) if np.hypot(*twist[:2]) > 0.0 else np.zeros(3)


class Tracker:
    """Follows a plan of one push by measured poses of its objects; has the interface of `Controller`.

    Args:
        plan: What to follow.
        settings: Of these only the rate matters.
    """

    def __init__(self, plan: Plan, settings: ControlSettings) -> None:
        load = plan.segments[0].load
        assert load is not None
        self.scenario, self.settings, self.segment, self.reason = plan.scenario, settings, 0, ""
        self.load: Load = load
        self.events: list[Event] = []
        self.replans: list[Replan] = []
        at_plate = load.poses(np.zeros(3))
        self._places = np.array([at_plate[name] for name in load.names])
        self._steering = LinearSteering(plan)
        limits, trajectory = plan.scenario.pusher.limits, plan.segments[0].contact_trajectory
        self._following = Following(trajectory, limits, settings.rate, load.frame_plate, self._steering)
        self._plate = np.array(plan.scenario.plate_start)
        self._before: deque[tuple[float, FloatArray]] = deque(maxlen=round(settings.rate))

    @property
    def over(self) -> bool:
        """Whether the plan has ended."""
        return self._following.drive.over

    @property
    def phase(self) -> Phase:
        """State of the tracker, which follows the plan only."""
        return Phase.ARRIVED if self.over else Phase.PUSHING

    def step(
        self,
        now: float,
        object_poses: ArrayLike | None = None,
        measured_at: float | None = None,
        plate_pose: ArrayLike | None = None,
    ) -> FloatArray:
        """Return the twist (3,) of the plate frame until the next step."""
        self._before.append((now, self._plate))
        if object_poses is not None:
            self._see(np.asarray(object_poses), now if measured_at is None else measured_at)
        if self.over:
            return np.zeros(3)
        self._steering.time = self._following.drive.at
        told = self._following.twist(compose(self._plate, self.load.frame_plate))
        twist = twist_of(self.load.chain.pusher.plate_pose, told)
        self._plate = compose(self._plate, exp(twist / self.settings.rate))
        return np.asarray(twist)

    def _see(self, poses: FloatArray, time: float) -> None:
        """Move the plate by a share of its pose error, as measured with the objects."""
        then = next((plate for t, plate in reversed(self._before) if t <= time), self._before[0][1])
        off = relative(then, compose(poses, inverse(self._places)))
        off = off[~np.isnan(off[:, 0])]
        if len(off):
            off[:, 2] = wrap_angle(off[:, 2])
            self._plate = compose(compose(then, GAIN * off.mean(axis=0)), relative(then, self._plate))
