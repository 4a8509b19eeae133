"""Goals of loads, all subclasses of `TaskGoal`; they hold data only.

A new goal type needs a subclass, a form in the scenario file (`schema`, `build`) and an entry in the table of
searches (`planners.searches`). docs/contributing.md has the recipe.
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
from pushplan.mechanics.faces import face_pairs
from pushplan.scenario.loads import PlacedLoad
from pushplan.scenario.parts import Workspace
from pushplan.util.arrays import FloatArray, frozen

DEFAULT_TOLERANCE = (0.002, math.radians(0.2))
"""Default tolerance of a goal: distance (m) and angle (rad)."""

TOLERANCE_OF_SEVERAL = (0.010, math.radians(2.0))
"""Default tolerance (m, rad) of separate objects. With a smaller one the robot drives metres for each correction."""

EXACT = 1e-7
"""Largest error (m, rad) at the end of a plan that counts as rounding."""

AT_WALL = 2e-3
"""Largest gap between a row's front and its wall, beyond the clearance, m."""


@dataclass(frozen=True, eq=False)
class Goal:
    """A goal pose of a load.

    Attributes:
        pose: Pose (3,) in the world of the object `of` or of the chain frame, as in the file.
        of: Name of the object; None for the chain frame.
        pose_chain: Pose (3,) of the chain frame in the world at the goal.
        position_tolerance: Tolerance of the distance, m.
        angle_tolerance: Tolerance of the angle, rad.
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
        """Return a goal of the chain frame: a pose (3,) in the world with a tolerance (m, rad)."""
        return cls(pose_chain, None, pose_chain, *tolerance)

    @property
    def tolerance(self) -> tuple[float, float]:
        """Tolerance: distance (m) and angle (rad)."""
        return self.position_tolerance, self.angle_tolerance

    def errors(self, pose_chain: FloatArray) -> tuple[float, float]:
        """Return the errors (m, rad) of the goal's frame with the chain frame at a pose (3,)."""
        position, angle = se2.pose_error(se2.compose(pose_chain, se2.relative(self.pose_chain, self.pose)), self.pose)
        return float(position), float(angle)

    def is_reached(self, pose_chain: FloatArray) -> bool:
        """Return whether the goal is reached within its tolerance with the chain frame at a pose (3,)."""
        position, angle = self.errors(pose_chain)
        return position <= self.position_tolerance and angle <= self.angle_tolerance

    def document(self) -> dict[str, Any]:
        """Return the goal in the form of a file of one load."""
        of = {} if self.of is None else {"of": self.of}
        tolerance = {"position": self.position_tolerance, "angle": self.angle_tolerance}
        return {"pose": self.pose.tolist(), **of, "tolerance": tolerance}


@dataclass(frozen=True, eq=False)
class End:
    """State at the end of a plan, for the check of goals.

    Attributes:
        loads: All loads of the task, by name.
        poses: Poses (3,) of all objects' own frames in the world, by name.
        heading: Heading of the plate after the last push, rad.
        workspace: Workspace of the room; None if it has no walls.
        clearance: Distance that objects keep from walls, m.
        exact: Names of the loads that must be at a goal up to rounding, because tolerances are for the execution.
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
    """Goal of some loads of a task."""

    flush: ClassVar[bool] = False
    """Whether the loads end flush with each other."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the loads with this goal."""

    @abstractmethod
    def candidates(self, load: str) -> tuple[Goal, ...]:
        """Return the goal poses to try for a load; none if only a plan determines them."""

    @abstractmethod
    def shortfall(self, end: End) -> str:
        """Return a sentence on why the goal is missed at the end of a plan; empty if it is reached."""

    @abstractmethod
    def document(self) -> dict[str, Any]:
        """Return the goal in the form of a scenario file: parts of the document, by key."""

    @abstractmethod
    def aim(self, load: str) -> str:
        """Return a verb phrase for a load's goal, e.g. `goes to its goal`."""

    def fulfilled(self, end: End) -> bool:
        """Return whether the goal is reached."""
        return not self.shortfall(end)

    def slack(self, tolerance: tuple[float, float]) -> tuple[float, float]:
        """Return the allowed error (m, rad) of a load; `tolerance` is that of a load alone."""
        return tolerance

    def settled(self, loads: Mapping[str, PlacedLoad], poses: Mapping[str, FloatArray]) -> TaskGoal:
        """Return the goal as chosen by a plan that ends with the objects at poses (3,), by name."""
        return self

    def resumed(self, end: End, tolerance: tuple[float, float]) -> TaskGoal:
        """Return the goal for replanning, which keeps the choices of the previous plan.

        Args:
            end: State at the end of the previous plan.
            tolerance: Tolerance (m, rad) of a load alone.
        """
        return self

    def remaining(self, loads: Mapping[str, PlacedLoad], delivered: Collection[str]) -> TaskGoal:
        """Return the goal that remains after the named loads were delivered; `loads` are at their current poses."""
        return self

    def with_friction(self, factor: float) -> TaskGoal:
        """Return the goal with the lowest friction between its loads multiplied by a factor."""
        return self


@dataclass(frozen=True, eq=False)
class Poses(TaskGoal):
    """Alternative goal poses of one load.

    Attributes:
        load: Name of the load.
        any_of: Alternatives, at least one.
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
        """See `TaskGoal`: a delivered load stays at its pose."""
        if self.load not in delivered:
            return self
        return Poses(self.load, (Goal.of_chain(loads[self.load].start, self.any_of[0].tolerance),))

    def shortfall(self, end: End) -> str:
        """See `TaskGoal`."""
        load, pose_chain = end.loads[self.load], end.start_of(self.load)
        if self.load not in end.exact and any(goal.is_reached(pose_chain) for goal in self.any_of):
            return ""
        errors = [se2.pose_error(pose_chain, goal.pose_chain) for goal in self.any_of]
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
    """A row: objects that stand flush, one in front of another along the push.

    Attributes:
        of: Names of the objects, from the pusher outward.
        pose: Pose (3,) of the middle of the row's rear face in the world, +x along the push; None for a row at a
            wall or anywhere.
        wall: Side of the workspace at the row's front, one of `names.WALLS`; None for a row at a pose or anywhere.
        order: `given` for the order of `of`, `any` for any order.
        gather: One of `names.GATHER`.
        friction: Lowest and highest coefficient between two objects of the row.
        tolerance: Tolerance of the row's pose: distance (m) and angle (rad).
        placed: Names of the objects that already stand at the row's front; the others are pushed onto their rear.
        places: Goals of the objects by name, as a plan has chosen them; see `settled`.
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
        """Names of the objects that are not placed yet."""
        return tuple(name for name in self.of if name not in self.placed)

    def candidates(self, load: str) -> tuple[Goal, ...]:
        """See `TaskGoal`."""
        return self.places.get(load, ())

    def settled(self, loads: Mapping[str, PlacedLoad], poses: Mapping[str, FloatArray]) -> Row:
        """Return the row with the end poses of a plan as goals of its objects.

        A plan without poses for all objects, such as a replan, leaves the row unchanged.
        """
        if not set(self.of) <= set(poses):
            return self
        places = {}
        for name in self.of:
            obj, found = loads[name].chain.objects[0], []
            for turn in polygon.symmetries(obj.outline):  # a symmetric object can be turned
                pose = se2.compose(poses[name], turn)
                pose_chain = se2.compose(pose, se2.inverse(obj.pose_chain))
                found.append(Goal(pose, name, pose_chain, *self.tolerance))
            places[name] = tuple(found)
        return replace(self, places=places)

    def slack(self, tolerance: tuple[float, float]) -> tuple[float, float]:
        """See `TaskGoal`: a turn of the front object within its tolerance moves the others aside."""
        positions = np.array([goals[0].pose[:2] for goals in self.places.values()])
        position, angle = tolerance
        return position + angle * float(np.linalg.norm(np.ptp(positions, axis=0))), angle

    def resumed(self, end: End, tolerance: tuple[float, float]) -> Row:
        """See `TaskGoal`: the order of the objects is kept."""
        order = self.order_at(end.loads, end.poses, end.heading)
        return replace(self, of=order, order="given", tolerance=self.slack(tolerance))

    def remaining(self, loads: Mapping[str, PlacedLoad], delivered: Collection[str]) -> Row:
        """See `TaskGoal`: delivered objects at the row's front are placed."""
        front = tuple(itertools.takewhile(lambda name: name in delivered, reversed(self.of)))
        return replace(self, placed=front[::-1], places={})

    def with_friction(self, factor: float) -> Row:
        """See `TaskGoal`."""
        return replace(self, friction=(factor * self.friction[0], self.friction[1]))

    def order_at(
        self, loads: Mapping[str, PlacedLoad], poses: Mapping[str, FloatArray], heading: float
    ) -> tuple[str, ...]:
        """Return the objects of the row from its rear to its front.

        Args:
            loads: All loads by name.
            poses: Poses (3,) of the objects' own frames in the world, by name.
            heading: Direction of the push in the world, rad.
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
        pairs = {name: list(face_pairs(obj.outline)) for name, obj in bodies.items()}
        rears = [se2.compose(end.poses[order[0]], pair.entry) for pair in pairs[order[0]]]
        # Placed objects are at their measured poses, and the others stand flush with them.
        allowed = self.tolerance if self.placed else (EXACT, EXACT)
        errors = [] if self.pose is None else [se2.pose_error(rear, self.pose) for rear in rears]
        position, angle = min(errors, key=lambda error: error[0] + error[1], default=(0.0, 0.0))
        if position > allowed[0] or angle > allowed[1]:
            off = f"{1e3 * position:.3g} mm and {np.degrees(angle):.2g} deg"
            return f"the row's rear, at '{order[0]}', misses its goal by {off}"
        fronts = [se2.compose(end.poses[order[-1]], pair.exit) for pair in pairs[order[-1]] if pair.exit is not None]
        if self.wall is not None and not self.placed and not any(self._is_at_wall(front, end) for front in fronts):
            return f"the row's front, at '{order[-1]}', is not at the wall"
        return ""

    def _is_at_wall(self, front: FloatArray, end: End) -> bool:
        """Return whether a face with middle and outward normal at a pose (3,) is near the row's wall and faces it."""
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
