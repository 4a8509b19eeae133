"""Parts of a plan, from rest to rest: transits, approaches, pushes, closes and retreats.

Paths and trajectories of segments are those of the plate frame; `load` explains the contact frame.
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
"""Poses (3,) of the bodies' own frames in the world, by name."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of a plan, from rest to rest.

    Attributes:
        kind: Kind of the segment, one of `names.SEGMENT_KINDS`.
        path: Path of the plate frame.
        before: Poses of all bodies at the start.
        after: Poses of all bodies at the end.
        load: Load that the plate approaches, pushes or leaves; None in a transit.
        margin: Lower limit of the margins of a push; 0 for other kinds.
        trajectory: Trajectory of the plate frame, from time 0; None if not timed.
        min_margin: Smallest margin of any contact along the path; None if nothing is pushed.
        min_dynamic_margin: Smallest margin with inertia during the execution.
        onto: Name of the object at which a close ends.
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
            raise PushplanError(f"{self.kind!r} is not a kind of segment; allowed: {', '.join(SEGMENT_KINDS)}")

    def __repr__(self) -> str:
        """Return one line."""
        load = "" if self.load is None else f" of {', '.join(self.load.names)}"
        return f"<Segment: {self.kind}{load}, {self.cost:.3f} m in {self.duration:.2f} s>"

    @classmethod
    def push(cls, load: Load, contact_path: PushPath, before: Poses, margin: float) -> Segment:
        """Return a push of a load along a path of the contact frame; all other bodies rest."""
        path = contact_path.of_frame(load.chain.pusher.plate_pose)
        after = {**before, **load.poses(path.end)}
        return cls(PUSH, path, before, after, load, margin)

    @classmethod
    def close(cls, load: Load, plate: PushPath, before: Poses, margin: float, onto: str) -> Segment:
        """Return a straight push of a load along a path of the plate frame that ends at a resting object."""
        return cls(CLOSE, plate, before, {**before, **load.poses(plate.end)}, load, margin, onto=onto)

    @property
    def pushes(self) -> bool:
        """Whether the load moves."""
        return self.kind in (PUSH, CLOSE)

    @property
    def touched(self) -> tuple[str, ...]:
        """Names of the resting objects that an approach or a close touches."""
        if self.kind == APPROACH and self.load is not None:
            return self.load.names
        return (self.onto,) if self.onto else ()

    @cached_property
    def contact_path(self) -> PushPath:
        """Path of the load's contact frame, or of the plate frame without a load."""
        return self.path if self.load is None else self.path.of_frame(self.load.frame_plate)

    @cached_property
    def contact_trajectory(self) -> Trajectory:
        """Trajectory of the load's contact frame, or of the plate frame without a load.

        Raises:
            PushplanError: If the segment is not timed.
        """
        if self.trajectory is None:
            raise PushplanError(f"the {self.kind} has no trajectory: it is not timed")
        return self.trajectory if self.load is None else self.trajectory.of_frame(self.load.frame_plate)

    @property
    def cost(self) -> float:
        """Cost of the path, m: of the contact frame in a push, else of the plate frame."""
        return self.contact_path.cost if self.pushes else self.path.cost

    @property
    def duration(self) -> float:
        """Duration, s; 0 if not timed."""
        return 0.0 if self.trajectory is None else self.trajectory.duration

    def problem(self, scenario: Scenario) -> Scenario:
        """Return this push as a push problem of its own, with resting bodies as obstacles.

        Args:
            scenario: Scenario of the plan, with its workspace and obstacles.

        Raises:
            PushplanError: If nothing is pushed.
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
        """Names of the pushed objects."""
        return self.load.names if self.pushes and self.load is not None else ()

    @property
    def pushed_load(self) -> Load:
        """The pushed load.

        Raises:
            PushplanError: If nothing is pushed.
        """
        if self.load is None or not self.pushes:
            raise PushplanError(f"the {self.kind} pushes nothing; allowed: push or close")
        return self.load

    def standing(self) -> dict[str, FloatArray]:
        """Return the poses of the bodies that rest during the segment."""
        return {name: pose for name, pose in self.before.items() if name not in self.pushed}


def end_of(scenario: Scenario, segments: tuple[Segment, ...]) -> End:
    """Return the end state of segments for the check of goals; a single load counts as exactly at its goal."""
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
    """Return the objects at poses (3,), by name, as obstacles, except those in `leave_out`."""
    return tuple(
        PolygonObstacle(se2.transform_points(poses[obj.name], obj.outline))
        for obj in scenario.objects
        if obj.name in poses and obj.name not in leave_out
    )


def join(segments: tuple[Segment, ...]) -> Trajectory | None:
    """Return the trajectory of the plate frame through all segments; None if one is not timed."""
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
