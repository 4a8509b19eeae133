"""What of a run is shown, whatever draws it: bodies, parts of the path, the rectangle around everything, samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pushplan.drawing.palette import PLATE, ROBOT, object_colours
from pushplan.geometry import se2
from pushplan.mechanics.body import BodyKind
from pushplan.plans.plan import Plan, Poses, Segment
from pushplan.plans.run import Execution
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import CircleObstacle, Obstacle, Scenario
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.names import PUSHER
from pushplan.util.names import ROBOT as ROBOT_NAME

WORLD, CHAIN = "world", "chain"
"""Frames of every run, beside the plate's, `PUSHER`; each object adds one of its own name. `CHAIN` is that of the
contact of a single push, fixed to the plate."""

PATH_SPACING = 0.02
"""Distance of the points of a path in pictures, m of path cost."""

VIEW_RATE = 20.0
"""Samples per second that viewers get of an execution."""

SMOOTHED_RATE = 10.0
"""Poses per second of a timed path in pictures."""

_RIM = 0.03
"""Free rim around everything, as a share of the longer side."""

_CIRCLE_CORNERS = 48
"""Corners of the polygon that is drawn for a circle."""

_SAME = 6
"""Digits of a metre in which outlines are compared."""


@dataclass(frozen=True, eq=False)
class ShownBody:
    """A body as it is drawn.

    Attributes:
        name: `robot`, `pusher` or the object's name.
        kind: What it is.
        outline: (v, 2) in its own frame, which is the plate's for robot and plate, m.
        colour: `#rrggbb`.
    """

    name: str
    kind: BodyKind
    outline: FloatArray
    colour: str


class Way(NamedTuple):
    """Points (k, 2) of a part of a path in the world, and whether the robot drives it alone."""

    points: FloatArray
    alone: bool


class Window(NamedTuple):
    """Sides of a rectangle in the world, m."""

    xmin: float
    ymin: float
    xmax: float
    ymax: float


def bodies_of(scenario: Scenario) -> list[ShownBody]:
    """Return all bodies that move, from behind to the front: the robot's parts, the plate, the objects."""
    pusher = scenario.pusher
    back = se2.inverse(pusher.plate_pose)
    parts = [
        ShownBody(ROBOT_NAME, BodyKind.ROBOT, se2.transform_points(back, part), ROBOT)
        for part in pusher.footprint
    ]
    plate = ShownBody(PUSHER, BodyKind.PLATE, se2.transform_points(back, pusher.outline), PLATE)
    objects = [obj for task in scenario.tasks for obj in task.chain.objects]
    paints = object_colours([obj.name for obj in objects])
    return [
        *parts,
        plate,
        *(
            ShownBody(obj.name, BodyKind.OBJECT, obj.outline, paint)
            for obj, paint in zip(objects, paints, strict=True)
        ),
    ]


def outlines_at(bodies: Sequence[ShownBody], plate: FloatArray, objects: Poses) -> list[FloatArray]:
    """Return the outlines of bodies in the world with the plate frame and the objects at some poses (3,)."""
    return [
        se2.transform_points(objects[body.name] if body.kind is BodyKind.OBJECT else plate, body.outline)
        for body in bodies
    ]


def contact_names(scenario: Scenario) -> list[str]:
    """Return what the contact of each object is called: who pushes whom, or the object where that changes."""
    if scenario.kind == "push":
        chain = scenario.chain
        return [chain.contact_name(k) for k in range(len(chain.contacts))]
    return list(scenario.poses)


def ghosts(scenario: Scenario) -> dict[str, list[FloatArray]]:
    """Return the world outlines of what stands at start and goals, robot and plate at the goal of one push only."""
    bodies = bodies_of(scenario)
    start = outlines_at(bodies, scenario.plate_start, scenario.poses)
    if scenario.kind == "push":
        end = se2.compose(scenario.goal.pose_chain, scenario.chain.pusher.plate_pose)
        poses = scenario.tasks[0].poses(scenario.goal.pose_chain)
        return {"start": start, "goal": outlines_at(bodies, end, poses)}
    goals = [
        se2.transform_points(se2.compose(goal.pose_chain, obj.pose_chain), obj.outline)
        for task in scenario.tasks
        for goal in task.goals
        for obj in task.chain.objects
    ]
    # Turned by its symmetry an object covers itself: once is enough, dashes over dashes make a line.
    different = {frozenset(map(tuple, outline.round(_SAME))): outline for outline in goals}
    return {"start": start, "goal": list(different.values())}


def shown_segments(plan: Plan | None) -> tuple[Segment, ...]:
    """Return the segments of a plan; without any, those that come nearest to the goal."""
    if plan is None:
        return ()
    return plan.segments or (() if plan.nearest is None else plan.nearest.segments)


def shown_ways(plan: Plan | None) -> list[Way]:
    """Return the parts of the plate's path to show, one after the other."""
    return [
        Way(segment.path.sampled(PATH_SPACING)[:, :2], not segment.pushes) for segment in shown_segments(plan)
    ]


def smoothed_times(trajectory: Trajectory) -> FloatArray:
    """Return the times (m,) at which a timed path is drawn, its end included, s."""
    return np.append(np.arange(0.0, trajectory.duration, 1.0 / SMOOTHED_RATE), trajectory.duration)


def window(scenario: Scenario, plan: Plan | None) -> Window:
    """Return the rectangle around workspace, obstacles, start, goals and everything that the robot passes."""
    points = [outline for outlines in ghosts(scenario).values() for outline in outlines]
    points += [obstacle_outline(obstacle) for obstacle in scenario.obstacles]
    bodies = bodies_of(scenario)
    sizes = [float(np.hypot(*np.ptp(b.outline, axis=0))) for b in bodies if b.kind is BodyKind.OBJECT]
    carried = [np.linalg.norm(b.outline, axis=1).max() for b in bodies if b.kind is not BodyKind.OBJECT]
    reach = max(max(carried), sum(sizes) if scenario.kind == "push" else max(sizes))
    for way in shown_ways(plan):
        points += [way.points - reach, way.points + reach]
    if scenario.workspace is not None:
        points.append(scenario.workspace.outline)
    every = np.concatenate(points)
    low, high = every.min(axis=0), every.max(axis=0)
    rim = _RIM * float((high - low).max())
    (xmin, ymin), (xmax, ymax) = low - rim, high + rim
    return Window(float(xmin), float(ymin), float(xmax), float(ymax))


def obstacle_outline(obstacle: Obstacle) -> FloatArray:
    """Return the polygon (v, 2), world frame, that stands for an obstacle in pictures."""
    if isinstance(obstacle, CircleObstacle):
        angle = np.linspace(0.0, 2.0 * np.pi, _CIRCLE_CORNERS, endpoint=False)
        return obstacle.center + obstacle.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return obstacle.outline


def smallest_margins(execution: Execution) -> FloatArray:
    """Return the smallest margin (m,) of any contact at each sample; NaN where nothing is pushed."""
    filled = np.where(np.isnan(execution.margins), np.inf, execution.margins).min(axis=1, initial=np.inf)
    return np.where(np.isinf(filled), np.nan, filled)


def viewed(execution: Execution) -> IntArray:
    """Return the samples to show: the first of each 1/20 s and segment, the last, where each margin is smallest."""
    if len(execution.t) == 0:
        return np.zeros(0, dtype=np.int64)
    frame = np.floor(execution.t * VIEW_RATE + 1e-6)  # t = 0.35 s is in frame 7, whatever its last bits say
    first = np.flatnonzero(np.diff(frame, prepend=-1.0))
    begun = np.flatnonzero(np.diff(execution.segment, prepend=-1))
    margins = np.where(np.isnan(execution.margins), np.inf, execution.margins)
    smallest = np.argmin(margins, axis=0) if margins.size else []
    return np.unique([*first, *begun, *smallest, len(execution.t) - 1]).astype(np.int64)


def worst_contacts(execution: Execution, most: int = 6) -> list[int]:
    """Return the columns of the contacts with the smallest margins, at most so many, in order."""
    least = np.where(np.isnan(execution.margins), np.inf, execution.margins).min(axis=0, initial=np.inf)
    return sorted(np.argsort(least, kind="stable")[:most].tolist())
