"""Goals: where loads shall be in the end. Siblings behind one interface, `TaskGoal`; data only.

A new goal type is a subclass, its form in a file (`schema`, `build`), and an entry in the table of searches
(`planners.searches`). docs/contributing.md has the recipe.
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from pushplan.geometry import polygon, se2
from pushplan.geometry.polygon import TOUCH, find_touch, overlap_depth
from pushplan.mechanics.faces import ways_through
from pushplan.scenario.loads import PlacedLoad
from pushplan.scenario.parts import Workspace
from pushplan.util.arrays import FloatArray, frozen

DEFAULT_TOLERANCE = (0.002, math.radians(0.2))
"""Distance (m) and angle (rad) from a goal that still count as reached, where a file states no others."""

TOLERANCE_OF_SEVERAL = (0.010, math.radians(2.0))
"""The same for objects that stand apart: one that is pushed again for less drives metres for it."""

EXACT = 1e-7
"""Largest error (m, rad) of a plan's end that counts as none."""

AT_WALL = 2e-3
"""A row whose front is nearer to a wall than this and the clearance, m, is at it."""


@dataclass(frozen=True, eq=False)
class Goal:
    """One pose that a load may be brought to.

    Attributes:
        pose: (3,) pose in the world of the object `of`, or of the chain frame, as stated.
        of: Name of the object whose frame is meant; None stands for the chain frame.
        pose_chain: (3,) pose of the chain frame in the world at the goal.
        position_tolerance: Distance that still counts as reached, m.
        angle_tolerance: Angle that still counts as reached, rad.
    """

    pose: FloatArray
    of: str | None
    pose_chain: FloatArray
    position_tolerance: float
    angle_tolerance: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", frozen(self.pose, (3,), "pose of the goal"))
        object.__setattr__(self, "pose_chain", frozen(self.pose_chain, (3,), "chain's pose at the goal"))

    @classmethod
    def of_chain(cls, pose_chain: FloatArray, tolerance: tuple[float, float] = DEFAULT_TOLERANCE) -> Goal:
        """Return a goal for the chain frame: a pose (3,) in the world, with a tolerance (m, rad)."""
        return cls(pose_chain, None, pose_chain, *tolerance)

    @property
    def tolerance(self) -> tuple[float, float]:
        """Distance (m) and angle (rad) that still count as reached."""
        return self.position_tolerance, self.angle_tolerance

    def errors(self, pose_chain: FloatArray) -> tuple[float, float]:
        """Return how far (m, rad) what the goal is stated for is from it, the chain frame being at a pose (3,)."""
        position, angle = se2.pose_error(se2.compose(pose_chain, se2.relative(self.pose_chain, self.pose)), self.pose)
        return float(position), float(angle)

    def is_reached(self, pose_chain: FloatArray) -> bool:
        """Return whether the chain frame at a pose (3,) is at the goal, within the tolerance."""
        position, angle = self.errors(pose_chain)
        return position <= self.position_tolerance and angle <= self.angle_tolerance

    def document(self) -> dict[str, Any]:
        """Return the goal in the form that it has in a file of one load."""
        of = {} if self.of is None else {"of": self.of}
        tolerance = {"position": self.position_tolerance, "angle": self.angle_tolerance}
        return {"pose": self.pose.tolist(), **of, "tolerance": tolerance}


@dataclass(frozen=True, eq=False)
class End:
    """Where a plan leaves everything, as goals see it.

    Attributes:
        loads: All loads of the task, by name.
        poses: (3,) poses of all objects' own frames in the world, by name.
        heading: Heading of the plate after the last push, rad.
        workspace: Of the room; None where it has no walls.
        clearance: Distance that objects keep from walls, m.
        exact: Names of the loads that have to be at a goal up to rounding: a tolerance is for the execution.
    """

    loads: Mapping[str, PlacedLoad]
    poses: Mapping[str, FloatArray]
    heading: float
    workspace: Workspace | None
    clearance: float
    exact: frozenset[str] = frozenset()

    def start_of(self, name: str) -> FloatArray:
        """Return the pose (3,) of a load's chain frame."""
        return self.loads[name].start_for(self.poses[name])


class TaskGoal(ABC):
    """What a task asks for: where some of its loads shall be."""

    flush: ClassVar[bool] = False
    """Whether its loads end flush with one another."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the loads that the goal is for."""

    @abstractmethod
    def candidates(self, load: str) -> tuple[Goal, ...]:
        """Return the poses that may be tried for a load; none where only a plan says where it ends."""

    @abstractmethod
    def shortfall(self, end: End) -> str:
        """Return in words what is missing at the end of a plan; empty where the goal is fulfilled."""

    @abstractmethod
    def document(self) -> dict[str, Any]:
        """Return the goal in the form that it has in a file: parts of the document, by key."""

    @abstractmethod
    def aim(self, load: str) -> str:
        """Return in words what the goal asks of a load."""

    def fulfilled(self, end: End) -> bool:
        """Return whether the goal is fulfilled."""
        return not self.shortfall(end)

    def slack(self, tolerance: tuple[float, float]) -> tuple[float, float]:
        """Return how far (m, rad) a load may be off, where one that stands by itself may be off by a tolerance."""
        return tolerance

    def settled(self, loads: Mapping[str, PlacedLoad], poses: Mapping[str, FloatArray]) -> TaskGoal:
        """Return the goal once a plan has said where its loads end, at the objects' poses (3,) by name."""
        return self

    def resumed(self, end: End, tolerance: tuple[float, float]) -> TaskGoal:
        """Return the goal for plans that go on from a plan: what that has chosen stays.

        Args:
            end: Where the plan leaves everything.
            tolerance: Distance (m) and angle (rad) that a load by itself may be off where it was brought.
        """
        return self

    def remaining(self, loads: Mapping[str, PlacedLoad], delivered: Collection[str]) -> TaskGoal:
        """Return the goal that is left with loads where they are now, once some, by name, were delivered."""
        return self

    def with_friction(self, factor: float) -> TaskGoal:
        """Return the goal with the least friction between its loads times a factor."""
        return self


@dataclass(frozen=True, eq=False)
class Poses(TaskGoal):
    """Poses of one load, any of which will do.

    Attributes:
        load: Name of the load.
        any_of: At least one.
    """

    load: str
    any_of: tuple[Goal, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """See `TaskGoal`."""
        return (self.load,)

    def candidates(self, load: str) -> tuple[Goal, ...]:
        """See `TaskGoal`."""
        return self.any_of if load == self.load else ()

    def remaining(self, loads: Mapping[str, PlacedLoad], delivered: Collection[str]) -> Poses:
        """See `TaskGoal`: what was delivered stays where it is."""
        if self.load not in delivered:
            return self
        return Poses(self.load, (Goal.of_chain(loads[self.load].start, self.any_of[0].tolerance),))

    def shortfall(self, end: End) -> str:
        """See `TaskGoal`."""
        load, there = end.loads[self.load], end.start_of(self.load)
        if self.load not in end.exact and any(goal.is_reached(there) for goal in self.any_of):
            return ""
        errors = [se2.pose_error(there, goal.pose_chain) for goal in self.any_of]
        if any(position <= EXACT and angle <= EXACT for position, angle in errors):
            return ""
        position, angle = min(errors, key=lambda error: error[0] + load.chain.reach * error[1])
        who = f"'{self.load}'" if len(end.loads) > 1 else "the path"
        return f"{who} misses the goal by {position:.2g} m and {angle:.2g} rad"

    def document(self) -> dict[str, Any]:
        """See `TaskGoal`."""
        stated = [goal.document() for goal in self.any_of]
        return {"goals": {self.load: [{key: one[key] for key in ("pose", "tolerance")} for one in stated]}}

    def aim(self, load: str) -> str:
        """See `TaskGoal`."""
        return f"goes to {'its goal' if len(self.any_of) == 1 else f'one of {len(self.any_of)} goals'}"


@dataclass(frozen=True, eq=False)
class Row(TaskGoal):
    """Objects that shall stand flush in a row, one in front of another as they are pushed.

    Attributes:
        of: Their names, from the pusher outward.
        pose: (3,) pose in the world of the middle of the row's rear face, +x along the push; None where `wall` or
            nothing says where.
        wall: Side of the workspace that the row's front is brought to, one of `names.WALLS`; None with `pose`, and
            where the row may stand anywhere.
        order: `given` stands for that of `of`, `any` for any.
        gather: One of `names.GATHER`.
        friction: Least and largest coefficient between two of them.
        tolerance: Distance (m) and angle (rad) that still count as reached.
        placed: Those that stand in it already, at its front: the others are pushed onto the rear of these.
        places: Goals of its objects by name, once a plan has said which place each one has; see `settled`.
    """

    flush = True

    of: tuple[str, ...]
    pose: FloatArray | None
    wall: str | None
    order: str
    gather: str
    friction: tuple[float, float]
    tolerance: tuple[float, float]
    placed: tuple[str, ...] = ()
    places: Mapping[str, tuple[Goal, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.pose is not None:
            object.__setattr__(self, "pose", frozen(self.pose, (3,), "pose of the row"))

    @property
    def names(self) -> tuple[str, ...]:
        """See `TaskGoal`."""
        return self.of

    @property
    def left(self) -> tuple[str, ...]:
        """Names of those that have to be brought to the row."""
        return tuple(name for name in self.of if name not in self.placed)

    def candidates(self, load: str) -> tuple[Goal, ...]:
        """See `TaskGoal`."""
        return self.places.get(load, ())

    def settled(self, loads: Mapping[str, PlacedLoad], poses: Mapping[str, FloatArray]) -> Row:
        """Return the row with a goal for each of its objects: where a plan leaves it.

        A plan for some of them, as replans are, says nothing of the row.
        """
        if not set(self.of) <= set(poses):
            return self
        places = {}
        for name in self.of:
            obj, found = loads[name].chain.objects[0], []
            for turn in polygon.symmetries(obj.outline):  # a row that looks the same is the same
                pose = se2.compose(poses[name], turn)
                there = se2.compose(pose, se2.inverse(obj.pose_chain))
                found.append(Goal(pose, name, there, *self.tolerance))
            places[name] = tuple(found)
        return replace(self, places=places)

    def slack(self, tolerance: tuple[float, float]) -> tuple[float, float]:
        """See `TaskGoal`: where the one in front is turned within its tolerance, the others are aside by it."""
        there = np.array([goals[0].pose[:2] for goals in self.places.values()])
        position, angle = tolerance
        return position + angle * float(np.linalg.norm(np.ptp(there, axis=0))), angle

    def resumed(self, end: End, tolerance: tuple[float, float]) -> Row:
        """See `TaskGoal`: the order stays, and the row goes on from what stands there."""
        order = self.order_at(end.loads, end.poses, end.heading)
        return replace(self, of=order, order="given", tolerance=self.slack(tolerance))

    def remaining(self, loads: Mapping[str, PlacedLoad], delivered: Collection[str]) -> Row:
        """See `TaskGoal`: what was delivered, from the front on, is placed."""
        front = tuple(itertools.takewhile(lambda name: name in delivered, reversed(self.of)))
        return replace(self, placed=front[::-1], places={})

    def with_friction(self, factor: float) -> Row:
        """See `TaskGoal`."""
        return replace(self, friction=(factor * self.friction[0], self.friction[1]))

    def order_at(
        self, loads: Mapping[str, PlacedLoad], poses: Mapping[str, FloatArray], heading: float
    ) -> tuple[str, ...]:
        """Return the objects of the row, from its rear to its front, where they stand at poses (3,).

        Args:
            loads: All loads by name.
            poses: By name.
            heading: Direction in the world that the row is pushed along, rad.
        """
        ahead = [math.cos(heading), math.sin(heading)]

        def front(name: str) -> float:
            outline = loads[name].chain.objects[0].outline
            return float((se2.transform_points(poses[name], outline) @ ahead).max())

        return tuple(sorted(self.of, key=front))

    def shortfall(self, end: End) -> str:
        """See `TaskGoal`."""
        bodies = {name: end.loads[name].chain.objects[0] for name in self.of}
        outlines = {name: se2.transform_points(end.poses[name], obj.outline) for name, obj in bodies.items()}
        order = self.order_at(end.loads, end.poses, end.heading)
        if self.order == "given" and order != self.of:
            return f"the row has the order {', '.join(order)}"
        if set(order[len(order) - len(self.placed) :]) != set(self.placed):
            return f"{', '.join(self.placed)} do not stand at the row's front"
        for behind, before in itertools.pairwise(order[: len(order) - len(self.placed) + 1]):
            touch = find_touch(outlines[behind], outlines[before])
            depth = overlap_depth(outlines[behind], outlines[before])
            if touch is None or len(touch) != 1 or depth > TOUCH:
                return f"'{behind}' is not flush with '{before}' in the row"
        ways = {name: list(ways_through(obj.outline)) for name, obj in bodies.items()}
        rears = [se2.compose(end.poses[order[0]], way.entry) for way in ways[order[0]]]
        # What stood there already is where it was measured, and the rest is flush with it.
        allowed = self.tolerance if self.placed else (EXACT, EXACT)
        errors = [] if self.pose is None else [se2.pose_error(rear, self.pose) for rear in rears]
        position, angle = min(errors, key=lambda error: error[0] + error[1], default=(0.0, 0.0))
        if position > allowed[0] or angle > allowed[1]:
            off = f"{1e3 * position:.3g} mm and {np.degrees(angle):.2g} deg off where it shall be"
            return f"the row's rear, of '{order[0]}', is {off}"
        fronts = [se2.compose(end.poses[order[-1]], way.exit) for way in ways[order[-1]] if way.exit is not None]
        if self.wall is not None and not self.placed and not any(self._is_at_wall(front, end) for front in fronts):
            return f"the row's front, of '{order[-1]}', is not at the wall"
        return ""

    def _is_at_wall(self, front: FloatArray, end: End) -> bool:
        """Return whether a face, with middle and outward normal at a pose (3,), is near the row's wall and faces it."""
        if end.workspace is None:
            return False
        area, (x, y, theta) = end.workspace, (float(value) for value in front)
        walls = {
            "xmin": (x - area.xmin, np.pi),
            "xmax": (area.xmax - x, 0.0),
            "ymin": (y - area.ymin, -0.5 * np.pi),
            "ymax": (area.ymax - y, 0.5 * np.pi),
        }
        return any(
            abs(float(se2.wrap_angle(theta - normal))) <= EXACT and away <= end.clearance + AT_WALL
            for name, (away, normal) in walls.items()
            if self.wall in (name, "any")
        )

    def document(self) -> dict[str, Any]:
        """See `TaskGoal`."""
        place: dict[str, Any] = {"anywhere": True} if self.wall is None else {"wall": self.wall}
        if self.pose is not None:
            place = {"pose": self.pose.tolist()}
        tolerance = {"position": self.tolerance[0], "angle": self.tolerance[1]}
        placed = {"placed": list(self.placed)} if self.placed else {}
        row = {"of": list(self.of), **place, "order": self.order, "tolerance": tolerance, **placed}
        return {"goals": {"row": row}, "gather": self.gather}

    def aim(self, load: str) -> str:
        """See `TaskGoal`."""
        return "goes into the row"
