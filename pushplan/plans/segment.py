"""Parts of a plan, from rest to rest: transits, approaches, pushes, closes and retreats.

Paths and trajectories of segments are of the plate frame; see `load` for the frame of what is pushed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.goals import End, Goal
from pushplan.scenario.parts import Obstacle, PolygonObstacle
from pushplan.util.arrays import FloatArray
from pushplan.util.names import APPROACH, CLOSE, PUSH, SEGMENT_KINDS

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario

Poses = Mapping[str, FloatArray]
"""Poses (3,) of bodies' own frames in the world, by name."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of a plan, from rest to rest.

    Attributes:
        kind: One of `names.SEGMENT_KINDS`.
        path: Of the plate frame.
        before: Where all bodies are at the beginning.
        after: Likewise at the end.
        load: What the plate comes up to, pushes or leaves; None in a transit.
        margin: That the twists of a push exceed; 0 for others.
        trajectory: Of the plate frame, from time 0; None where it is not timed.
        min_margin: Smallest margin of any contact along the path; None where nothing is pushed.
        min_dynamic_margin: Likewise with inertia, along the execution.
        onto: Name of the object that a close ends at.
    """

    kind: str
    path: PushPath
    before: Poses
    after: Poses
    load: Load | None = None
    margin: float = 0.0
    trajectory: Trajectory | None = None
    min_margin: float | None = None
    min_dynamic_margin: float | None = None
    onto: str = ""

    def __post_init__(self) -> None:
        if self.kind not in SEGMENT_KINDS:
            raise PushplanError(f"no segment is a {self.kind!r}; there are {', '.join(SEGMENT_KINDS)}")

    def __repr__(self) -> str:
        """Say what it is in a line."""
        load = "" if self.load is None else f" of {', '.join(self.load.names)}"
        return f"<Segment: {self.kind}{load}, {self.cost:.3f} m in {self.duration:.2f} s>"

    @classmethod
    def push(cls, load: Load, contact_path: PushPath, before: Poses, margin: float) -> Segment:
        """Return a push of a load along a path (of the contact's frame); all other bodies rest."""
        path = contact_path.of_frame(load.chain.pusher.plate_pose)
        after = {**before, **load.poses(path.end)}
        return cls(PUSH, path, before, after, load, margin)

    @classmethod
    def close(cls, load: Load, plate: PushPath, before: Poses, margin: float, onto: str) -> Segment:
        """Return a straight push of a load, along a path of the plate frame, that ends at an object which rests."""
        return cls(CLOSE, plate, before, {**before, **load.poses(plate.end)}, load, margin, onto=onto)

    @property
    def pushes(self) -> bool:
        """Whether the load moves."""
        return self.kind in (PUSH, CLOSE)

    @property
    def touched(self) -> tuple[str, ...]:
        """Names of the objects at rest that the plate comes up to, or that a close ends at."""
        if self.kind == APPROACH and self.load is not None:
            return self.load.names
        return (self.onto,) if self.onto else ()

    @cached_property
    def contact_path(self) -> PushPath:
        """The path of the load's contact frame; of the plate frame where there is no load."""
        return self.path if self.load is None else self.path.of_frame(self.load.frame_plate)

    @cached_property
    def contact_trajectory(self) -> Trajectory:
        """The trajectory of the load's contact frame; of the plate frame where there is no load.

        Raises:
            PushplanError: When the segment is not timed.
        """
        if self.trajectory is None:
            raise PushplanError(f"the {self.kind} has no trajectory: it is not timed")
        return self.trajectory if self.load is None else self.trajectory.of_frame(self.load.frame_plate)

    @property
    def cost(self) -> float:
        """Of the path: of its contact's frame in a push, else of the plate frame, m."""
        return self.contact_path.cost if self.pushes else self.path.cost

    @property
    def duration(self) -> float:
        """Length in time, s; 0 where it is not timed."""
        return 0.0 if self.trajectory is None else self.trajectory.duration

    def problem(self, scenario: Scenario) -> Scenario:
        """Return this push as a push problem of its own: bodies at rest are among what stands in the room.

        Args:
            scenario: Of the plan: what stands in its room.

        Raises:
            PushplanError: When nothing is pushed.
        """
        own = self.pushed_load.problem
        if own is scenario:
            return own.with_margin(self.margin)
        end = self.contact_path.end
        pushed = replace(own.load, start=self.contact_path.start)
        return replace(
            own.with_margin(self.margin).push_of(pushed, Goal.of_chain(end, own.goal.tolerance)),
            workspace=scenario.workspace,
            obstacles=(*scenario.obstacles, *standing_obstacles(scenario, self.standing(), (self.onto,))),
            clearance=scenario.clearance,
            trajectory=scenario.trajectory,
            name=f"{scenario.name}: {self.pushed_load.face}",
        )

    @property
    def pushed(self) -> tuple[str, ...]:
        """Names of the objects that are pushed."""
        return self.load.names if self.pushes and self.load is not None else ()

    @property
    def pushed_load(self) -> Load:
        """The load that is pushed.

        Raises:
            PushplanError: When nothing is pushed.
        """
        if self.load is None or not self.pushes:
            raise PushplanError(f"a {self.kind} is no push")
        return self.load

    def standing(self) -> dict[str, FloatArray]:
        """Return where the bodies are that rest during the segment."""
        return {name: pose for name, pose in self.before.items() if name not in self.pushed}


def end_of(scenario: Scenario, segments: tuple[Segment, ...]) -> End:
    """Return where segments leave everything, as goals see it: a load that is the only one is exactly at its goal."""
    last = segments[-1] if segments else None
    pushed = {name for segment in segments for name in segment.pushed}
    return End(
        scenario.task.by_name,
        scenario.poses if last is None else last.after,
        float(scenario.plate_start[2] if last is None else last.path.end[2]),
        scenario.workspace,
        scenario.clearance,
        frozenset(load.name for load in scenario.loads if load.name in pushed and len(scenario.loads) == 1),
    )


def standing_obstacles(scenario: Scenario, poses: Poses, leave_out: Collection[str]) -> tuple[Obstacle, ...]:
    """Return objects as obstacles where they stand, at poses (3,) by name, but for those left out."""
    return tuple(
        PolygonObstacle(se2.transform_points(poses[obj.name], obj.outline))
        for obj in scenario.objects
        if obj.name in poses and obj.name not in leave_out
    )


def join(segments: tuple[Segment, ...]) -> Trajectory | None:
    """Return the trajectory of the plate frame through all segments; None where one is not timed."""
    trajectories = [segment.trajectory for segment in segments]
    if not trajectories or any(one is None for one in trajectories):
        return None
    timed = [one for one in trajectories if one is not None]
    if len(timed) == 1:
        return timed[0]
    breaks, arcs, now, before = [np.zeros(1)], [], 0.0, 0
    for segment, trajectory in zip(segments, timed, strict=True):
        breaks.append(now + trajectory.breaks[1:])
        arcs.append(before + trajectory.arc)
        now, before = float(breaks[-1][-1]), before + len(segment.path.lengths)
    coefficients = np.concatenate([one.coefficients for one in timed])
    first = timed[0]
    return Trajectory(first.start, np.concatenate(breaks), coefficients, np.concatenate(arcs), first.rate, first.base)
