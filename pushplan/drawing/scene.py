"""Scene: the visible content of a scenario, a plan or an execution, independent of the viewer.

A scene holds the room, the bodies with their poses over time, the goals, and the path of the plate with its margins.
Pictures, the page, the film, the window and the logs all draw this scene in the colours of the palette.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import shapely

from pushplan.drawing import palette
from pushplan.geometry import se2
from pushplan.mechanics.chain import BodyKind
from pushplan.scenario.parts import Obstacle, PolygonObstacle
from pushplan.util.arrays import FloatArray, IntArray, distinct
from pushplan.util.names import CLOSE, PUSH, PUSHER, ROBOT, TRANSIT

if TYPE_CHECKING:
    from pushplan.plans.execution import Execution
    from pushplan.plans.plan import Plan
    from pushplan.plans.run import Event
    from pushplan.plans.segment import Poses, Segment
    from pushplan.scenario.model import Scenario

PATH_SPACING = 0.01
"""Distance between the drawn points of a path, m of path cost."""

CIRCLE_CORNERS = 48
"""Number of corners of the polygon that approximates a circle."""

_SAME = 6
"""Decimals (in m) to which goal outlines are compared: identical goals are drawn once."""

_AIR, _ACTION, _CROPPED = 0.03, 0.15, 0.4
"""Rims around the whole scene and around the moving bodies, as shares of the longer side; third, a share of the area.
If the moving bodies cover less than that share of the whole scene, the window shows only them."""


class Window(NamedTuple):
    """Sides of a rectangle in the world, m."""

    xmin: float
    ymin: float
    xmax: float
    ymax: float

    @property
    def size(self) -> FloatArray:
        """(2,) width and height, m."""
        return np.array([self.xmax - self.xmin, self.ymax - self.ymin])


@dataclass(frozen=True, eq=False)
class Body:
    """A moving body: part of the robot, the plate or an object.

    Attributes:
        name: `robot`, `pusher` (the plate) or the object's name.
        kind: Robot, plate or object.
        outline: (v, 2) m, in the plate frame for the robot and the plate, else in the object's own frame.
        colour: Fill colour.
    """

    name: str
    kind: BodyKind
    outline: FloatArray
    colour: str

    def at(self, pose: FloatArray) -> FloatArray:
        """Return its outline (v, 2) in the world for the pose (3,) of its frame."""
        return se2.transform_points(pose, self.outline)


@dataclass(frozen=True, eq=False)
class Fixed:
    """A fixed outline: an obstacle, or the goal of an object.

    Attributes:
        name: Name of the object whose goal this is; empty for an obstacle.
        outline: (v, 2) in the world, m.
        colour: Colour of the obstacle or of the object.
        unknown: Whether this is an unknown area of a map, drawn hatched.
    """

    name: str
    outline: FloatArray
    colour: str
    unknown: bool = False


@dataclass(frozen=True, eq=False)
class Line:
    """A part of the plate's path.

    Attributes:
        kind: One of `names.SEGMENT_KINDS`.
        points: (k, 2) in the world, m.
        margins: (k,) smallest margin of any contact; NaN if nothing is pushed or the margin is unknown.
        load: Names of the pushed objects; empty if the robot drives alone.
    """

    kind: str
    points: FloatArray
    margins: FloatArray
    load: tuple[str, ...] = ()

    @property
    def pushes(self) -> bool:
        """Whether something is pushed."""
        return self.kind in (PUSH, CLOSE)


@dataclass(frozen=True, eq=False)
class Rest:
    """Poses of the bodies after a push.

    Attributes:
        number: Number of the push, starting at 1.
        names: Names of the objects that this push has moved.
        poses: (b, 3) poses of all bodies after it.
    """

    number: int
    names: tuple[str, ...]
    poses: FloatArray


@dataclass(frozen=True, eq=False)
class Mark:
    """Place of an event of a closed loop.

    Attributes:
        time: Time of the event, s.
        kind: Kind of the event, one of `plans.run.KINDS`.
        place: (2,) position of the plate frame at that time, in the world, m.
    """

    time: float
    kind: str
    place: FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """Visible content of a scenario, a plan or an execution.

    Attributes:
        name: Name of the scenario.
        walls: (4, 2) corners of the workspace; None if the scenario has no workspace.
        obstacles: Obstacles and unknown areas.
        bodies: Moving bodies from the lowest layer up: robot parts, plate, objects.
        goals: Goal outlines of the objects.
        t: (m,) times of the poses, s; only 0 if nothing was executed.
        poses: (m, b, 3) poses of the bodies' frames in the world.
        margins: (m,) smallest margin of any contact; NaN if nothing is pushed.
        lines: Parts of the path of the plate.
        rests: Poses after each push.
        nearest: Path that comes nearest to the goal, if there is no plan.
        nearest_poses: (b, 3) poses at the end of that path; None without such a path.
        tree: (q, 2, 2) branches of the search tree.
        marks: Events of a closed loop.
    """

    name: str
    walls: FloatArray | None
    obstacles: tuple[Fixed, ...]
    bodies: tuple[Body, ...]
    goals: tuple[Fixed, ...]
    t: FloatArray
    poses: FloatArray
    margins: FloatArray
    lines: tuple[Line, ...] = ()
    rests: tuple[Rest, ...] = ()
    nearest: tuple[Line, ...] = ()
    nearest_poses: FloatArray | None = None
    tree: FloatArray | None = None
    marks: tuple[Mark, ...] = ()

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        plan: Plan | None = None,
        execution: Execution | None = None,
        events: Iterable[Event] = (),
    ) -> Self:
        """Return the scene of a scenario.

        Args:
            scenario: Scenario to show.
            plan: Plan to show; None for the scenario alone.
            execution: Execution to show; by default that of the plan, if it has one.
            events: Events of a closed loop.
        """
        if execution is None and plan is not None:
            execution = plan.execution
        bodies, area = tuple(_bodies(scenario)), scenario.workspace
        colours = {body.name: body.colour for body in bodies}
        first = _pose_rows(bodies, scenario.plate_start, scenario.poses)
        t, poses, margins = np.zeros(1), first[None], np.full(1, np.nan)
        segments = () if plan is None else plan.segments
        lines, rests = _planned(bodies, segments)
        if execution is not None and len(execution.t):
            moved = dict(zip(execution.names, np.moveaxis(execution.objects, 1, 0), strict=True))
            poses = np.stack([moved.get(body.name, execution.poses) for body in bodies], axis=1)
            t, margins = execution.t, smallest(execution.margins)
            lines, rests = _executed(bodies, segments, execution, poses, margins)
        blocking = () if plan is None or plan.solved else plan.blocking
        nearest: tuple[Line, ...] = ()
        last: FloatArray | None = None
        if plan is not None and plan.nearest is not None and plan.nearest.segments:
            nearest, ends = _planned(bodies, plan.nearest.segments)
            last = ends[-1].poses if ends else None
        return cls(
            scenario.name,
            None if area is None else area.outline,
            tuple(_obstacle(one, k in blocking) for k, one in enumerate(scenario.obstacles)),
            bodies,
            # only a plan knows the place of a row
            tuple(_goals(plan.scenario if plan is not None and scenario.task.flush else scenario, colours)),
            t,
            poses,
            margins,
            lines,
            rests,
            nearest,
            last,
            None if plan is None or not len(plan.tree) else plan.tree[:, :, :2],
            tuple(_marks(events, execution)),
        )

    @property
    def objects(self) -> tuple[Body, ...]:
        """Bodies of the objects."""
        return tuple(body for body in self.bodies if body.kind is BodyKind.OBJECT)

    @property
    def start(self) -> FloatArray:
        """(b, 3) poses of the bodies at the start."""
        return np.asarray(self.poses[0])

    @property
    def end(self) -> FloatArray:
        """(b, 3) poses of the bodies at the end of the execution, or of the plan if nothing was executed."""
        return self.poses[-1] if len(self.t) > 1 or not self.rests else self.rests[-1].poses

    @cached_property
    def moved(self) -> tuple[bool, ...]:
        """Whether each body moves at all."""
        every = np.concatenate([self.poses, *(rest.poses[None] for rest in self.rests)])
        return tuple((np.abs(every - every[:1]).max(axis=(0, 2)) > 1e-9).tolist())

    def at(self, time: float) -> FloatArray:
        """Return the poses (b, 3) of the bodies at a time, s; angles are continuous, not wrapped."""
        columns = self.poses.reshape(len(self.t), -1).T
        return np.array([np.interp(time, self.t, column) for column in columns]).reshape(-1, 3)

    def outlines(self, poses: FloatArray) -> list[FloatArray]:
        """Return the outlines of all bodies in the world at poses (b, 3)."""
        return [body.at(pose) for body, pose in zip(self.bodies, poses, strict=True)]

    @cached_property
    def window(self) -> Window:
        """Rectangle to show: the workspace or all bodies, cropped to the moving bodies if the room is much larger."""
        moving = self._action()
        if self.walls is not None:
            whole = _around([self.walls], 0.0)
        else:
            whole = _around([*moving, *(one.outline for one in self.obstacles)], _AIR)
        if not self.lines and not self.nearest:
            return whole
        action = _around(moving, _ACTION)
        low, high = np.maximum(whole[:2], action[:2]), np.minimum(whole[2:], action[2:])
        part = Window(*map(float, (*low, *high)))
        return part if np.prod(part.size) < _CROPPED * np.prod(whole.size) else whole

    def _action(self) -> list[FloatArray]:
        """Return the points of the path, and the outlines of moving bodies (along it) and of goals."""
        along = self.poses[np.linspace(0, len(self.t) - 1, 100).astype(int)]
        known = [*along, *(rest.poses for rest in self.rests)]
        if self.nearest_poses is not None:
            known.append(self.nearest_poses)
        moved = self.moved if any(self.moved) else (True,) * len(self.bodies)
        points = [line.points for line in (*self.lines, *self.nearest)]
        bodies = [
            body.at(pose)
            for poses in known
            for body, pose, moves in zip(self.bodies, poses, moved, strict=True)
            if moves
        ]
        return [*points, *bodies, *(goal.outline for goal in self.goals)]


def piece_colours(margins: FloatArray) -> list[str]:
    """Return k - 1 colours for the pieces between points with margins (k,): that of the smaller margin of each."""
    return [palette.margin_colour(float(m)) or palette.PATH for m in np.fmin(margins[:-1], margins[1:])]


def smallest(margins: FloatArray) -> FloatArray:
    """Return the minimum (m,) over the contacts of margins (m, n); NaN if nothing is pushed."""
    least = np.fmin.reduce(margins, axis=1, initial=np.inf)
    return np.where(np.isinf(least), np.nan, least)


def _obstacle(obstacle: Obstacle, blocking: bool) -> Fixed:
    colour = palette.BLOCKING if blocking else palette.OBSTACLE
    if isinstance(obstacle, PolygonObstacle):
        return Fixed("", obstacle.outline, colour, obstacle.unknown)
    angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_CORNERS, endpoint=False)
    around = obstacle.center + obstacle.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Fixed("", around, colour)


def _bodies(scenario: Scenario) -> Iterator[Body]:
    pusher = scenario.pusher
    of_plate = se2.inverse(pusher.plate_pose)
    for part in pusher.footprint:
        outline = se2.transform_points(of_plate, part)
        yield Body(ROBOT, BodyKind.ROBOT, outline, palette.ROBOT)
    plate = se2.transform_points(of_plate, pusher.outline)
    yield Body(PUSHER, BodyKind.PLATE, plate, palette.PLATE)
    colours = palette.object_colours(list(scenario.poses))
    for obj, colour in zip(scenario.objects, colours, strict=True):
        yield Body(obj.name, BodyKind.OBJECT, obj.outline, colour)


def _goals(scenario: Scenario, colours: dict[str, str]) -> Iterator[Fixed]:
    """Yield each goal once, a row as one outline: dashes over dashes would look like a line."""
    rows = [goal for goal in scenario.task.goals if goal.flush]
    in_rows = {name for row in rows for name in row.names}
    for row in rows:
        slots = [
            se2.transform_points(goals[0].pose_chain, obj.outline_chain)
            for load in scenario.loads
            for goals in [row.candidates(load.name)]
            for obj in load.chain.objects
            if goals
        ]
        if slots:
            around = shapely.minimum_rotated_rectangle(shapely.MultiPoint(np.concatenate(slots)))
            yield Fixed("row", shapely.get_coordinates(around)[:-1], palette.SWEPT)
    seen: set[tuple[str, frozenset[tuple[float, ...]]]] = set()
    each = (
        (load, goal)
        for load in scenario.loads
        if load.name not in in_rows
        for goal in scenario.goals.get(load.name, ())
    )
    for load, goal in each:
        for obj in load.chain.objects:
            outline = se2.transform_points(goal.pose_chain, obj.outline_chain)
            key = obj.name, frozenset(map(tuple, outline.round(_SAME).tolist()))
            if key not in seen:
                seen.add(key)
                yield Fixed(obj.name, outline, colours[obj.name])


def _marks(events: Iterable[Event], execution: Execution | None) -> Iterator[Mark]:
    """Yield a mark at the plate's position for each event that has a colour (not the first plan or the end)."""
    if execution is not None and len(execution.t):
        for event in events:
            if event.kind in palette.EVENTS:
                yield Mark(event.time, event.kind, execution.poses_at(event.time)[0][:2])


def _pose_rows(bodies: tuple[Body, ...], plate: FloatArray, objects: Poses) -> FloatArray:
    """Return the poses (b, 3) of bodies from the pose (3,) of the plate and those of the objects."""
    return np.array([objects[body.name] if body.kind is BodyKind.OBJECT else plate for body in bodies])


def _planned(bodies: tuple[Body, ...], segments: tuple[Segment, ...]) -> tuple[tuple[Line, ...], tuple[Rest, ...]]:
    """Return the planned path of the plate (margins NaN) and the poses after each push."""
    lines: list[Line] = []
    rests: list[Rest] = []
    for segment in segments:
        points = segment.path.sampled(PATH_SPACING)[:, :2]
        names = segment.load.names if segment.pushes and segment.load is not None else ()
        lines.append(Line(segment.kind, points, np.full(len(points), np.nan), names))
        if names:
            _add_rest(rests, segment.kind, names, _pose_rows(bodies, segment.path.end, segment.after))
    return tuple(lines), tuple(rests)


def _add_rest(rests: list[Rest], kind: str, names: tuple[str, ...], poses: FloatArray) -> None:
    """Add the poses after a push; a `close` segment counts as part of the push before it."""
    if kind == CLOSE and rests:
        rests.pop()
    rests.append(Rest(len(rests) + 1, names, poses))


def _executed(
    bodies: tuple[Body, ...],
    segments: tuple[Segment, ...],
    execution: Execution,
    poses: FloatArray,
    margins: FloatArray,
) -> tuple[tuple[Line, ...], tuple[Rest, ...]]:
    """Return the executed path of the plate with margins, and the poses after each push."""
    pushing = ~np.isnan(margins)
    changes = np.flatnonzero((np.diff(execution.segment) != 0) | (np.diff(pushing) != 0)) + 1
    ends = [0, *changes.tolist(), len(margins)] if len(margins) > 1 else [0]
    lines: list[Line] = []
    rests: list[Rest] = []
    for begin, end in pairwise(ends):
        pushed = ~np.isnan(np.fmin.reduce(execution.margins[begin:end], axis=0))
        names = tuple(name for name, one in zip(execution.names, pushed, strict=True) if one)
        upto = min(end, len(margins) - 1)  # the next part begins where this one ends
        kept = _spaced(execution.poses[begin : upto + 1])
        least = np.append(np.fmin.reduceat(margins[begin:end], kept[:-1]), margins[end - 1])
        owner = int(execution.segment[begin])
        kind = segments[owner].kind if owner < len(segments) else TRANSIT
        kind = (CLOSE if kind == CLOSE else PUSH) if names else TRANSIT if kind in (PUSH, CLOSE) else kind
        lines.append(Line(kind, execution.poses[begin + kept, :2], least, names))
        if names:
            _add_rest(rests, kind, names, poses[upto])
    return tuple(lines), tuple(rests)


def _spaced(poses: FloatArray) -> IntArray:
    """Return the indices of poses (m, 3) to draw: one per `PATH_SPACING` of path cost, and the last."""
    step = np.diff(poses, axis=0)
    cost = np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]) + 0.1 * np.abs(step[:, 2]))])
    kept = np.flatnonzero(np.diff(np.floor(cost / PATH_SPACING), prepend=-1.0))
    return distinct(np.append(kept, len(poses) - 1))


def _around(outlines: list[FloatArray], rim: float) -> Window:
    points = np.concatenate(outlines)
    low, high = points.min(axis=0), points.max(axis=0)
    air = rim * float((high - low).max())
    return Window(*map(float, (*(low - air), *(high + air))))
