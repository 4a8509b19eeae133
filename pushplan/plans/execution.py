"""What executing a trajectory comes to; kept apart from the simulators, which are slow to load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pushplan.geometry.se2 import transform_points
from pushplan.util.arrays import FloatArray

if TYPE_CHECKING:
    from pushplan.mechanics.chain import Chain
    from pushplan.scenario.model import Scenario


@dataclass(frozen=True)
class StabilityLoss:
    """Where an execution lost a contact; what happens after it is not predicted.

    Attributes:
        time: s.
        contact: Index of the contact (0 touches the plate).
        margin: The margin found there, <= 0.
        pose: (3,) pose of the chain frame in the world.
    """

    time: float
    contact: int
    margin: float
    pose: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Execution:
    """What happened, sampled at the trajectory's rate.

    Attributes:
        t: (m,) times, s; ends early when stability was lost.
        poses: (m, 3) integrated pose of the chain frame in the world.
        twists: (m, 3) executed body twists in the chain frame.
        margins: (m, n) margin of each contact; where the pusher rests, that of the twist it is about to take (at
            the end: has just taken).
        friction_margins: (m, n) angle of the contact force to the nearer edge of its friction cone, rad; like
            `lambdas` and `forces`, None where the loads on the floor are not known.
        lambdas: (m, n) where the force passes through the segment, 0 at the right end, 1 at the left end.
        forces: (m, n, 2) contact force on the pushed object, chain frame, N.
        loss: The first loss of stability, or None.
        goal_error: (position m, angle rad) of the final pose against the goal.
        dynamic_margins: (m, n) margin of each contact with inertia; None where it was not looked at.
        loads: (m, 3) pose of the objects' frame in the world where the robot is not always in contact: `poses` are
            then those of the robot's frame (see `plans.segment`), and margins are 1 where nothing is pushed. None
            stands for `poses`.
        object_poses: (m, n, 3) poses of the objects' own frames in the world where contacts may slip; margins are
            then those that the twists would have if nothing had. None where the objects keep their places.
        wrenches: (m, 3) with which the plate pushes on all that it touches, in the chain frame, about
            its origin: N, N, N m. None where contacts may not slip: it is then that of `forces`.
    """

    t: FloatArray
    poses: FloatArray
    twists: FloatArray
    margins: FloatArray
    friction_margins: FloatArray | None
    lambdas: FloatArray | None
    forces: FloatArray | None
    loss: StabilityLoss | None
    goal_error: tuple[float, float]
    dynamic_margins: FloatArray | None = None
    loads: FloatArray | None = None
    object_poses: FloatArray | None = None
    wrenches: FloatArray | None = None

    @property
    def load_poses(self) -> FloatArray:
        """(m, 3) pose in the world of the frame that the objects are fixed to."""
        return self.poses if self.loads is None else self.loads

    def place_at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return the pose (3,) of the chain frame, or robot's frame, and of the objects' frame at a time, s."""
        pose, load = (
            np.array([np.interp(time, self.t, column) for column in poses.T])
            for poses in (self.poses, self.load_poses)
        )
        return pose, load

    def outlines_at(self, chain: Chain, time: float) -> list[FloatArray]:
        """Return the outlines of all bodies of the chain, in the world, at a time, s."""
        pose, load = self.place_at(time)
        if self.object_poses is None:
            return chain.outlines_at(pose, load)
        places = [
            [np.interp(time, self.t, column) for column in self.object_poses[:, k].T]
            for k in range(len(chain.objects))
        ]
        return [
            *(transform_points(pose, body.outline) for body in chain.carried),
            *(transform_points(place, obj.outline) for place, obj in zip(places, chain.objects, strict=True)),
        ]

    @property
    def min_margin(self) -> float:
        """Smallest margin of any contact, without inertia; 1 where nothing was executed."""
        return float(self.margins.min(initial=1.0))

    @property
    def min_dynamic_margin(self) -> float | None:
        """Smallest margin of any contact with inertia, None where it was not looked at."""
        return None if self.dynamic_margins is None else float(self.dynamic_margins.min(initial=1.0))


def inertia_warning(scenario: Scenario, execution: Execution) -> str:
    """Return that inertia, which the scenario leaves out, would make a contact slip; empty where it would not."""
    least = execution.min_dynamic_margin
    if scenario.chain.pusher.limits.contact == "dynamic" or least is None or least > 0.0:
        return ""
    return (
        f"inertia was left out (limits.contact: quasi-static), and at this speed a contact slips "
        f"(margin {least:.2g}): push more slowly, or use dynamic limits"
    )
