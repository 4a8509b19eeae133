"""The parts of a push problem beside the chain: goal, workspace, obstacles, settings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.intervals import IntervalChain
from pushplan.util.arrays import FloatArray, frozen

DEFAULT_TOLERANCE = (0.002, math.radians(0.2))
"""Distance (m) and angle (rad) from a goal that still count as reached, where a file states no others."""

TOLERANCE_OF_SEVERAL = (0.010, math.radians(2.0))
"""Likewise from the goals of objects that stand apart: one that is pushed again for less drives metres for it."""


@dataclass(frozen=True, eq=False)
class Goal:
    """Where to bring the chain.

    Attributes:
        pose: (3,) pose in the world of the object `of`, or of the chain frame, as stated.
        of: Name of the object whose frame is meant; None stands for the chain frame.
        pose_chain: (3,) pose of the chain frame in the world at the goal.
        position_tolerance: Distance that still counts as reached, m.
        angle_tolerance: Angle that still counts as reached, rad.
        objects: Names of those that it is for, where others stand apart from them; empty stands for all.
    """

    pose: FloatArray
    of: str | None
    pose_chain: FloatArray
    position_tolerance: float
    angle_tolerance: float
    objects: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", frozen(self.pose, (3,), "pose of the goal"))
        object.__setattr__(self, "pose_chain", frozen(self.pose_chain, (3,), "chain's pose at the goal"))

    def errors(self, pose_chain: FloatArray) -> tuple[float, float]:
        """Return how far (m, rad) what the goal is stated for is from it, the chain frame being at a pose (3,)."""
        position, angle = se2.pose_error(se2.compose(pose_chain, se2.relative(self.pose_chain, self.pose)), self.pose)
        return float(position), float(angle)

    def is_reached(self, pose_chain: FloatArray) -> bool:
        """Tell whether the chain frame at a pose (3,) is at the goal, within the tolerance."""
        position, angle = self.errors(pose_chain)
        return position <= self.position_tolerance and angle <= self.angle_tolerance


@dataclass(frozen=True, eq=False)
class Pushes:
    """Several pushes: where the robot is at first, which contacts it may choose, and what counts.

    Attributes:
        robot_start: (3,) pose of the plate's frame in the world.
        goals: Any of which will do.
        faces: Names of `names.FACES` and angles of outward normals in the chain frame, rad; None stands for all.
        offsets: Of the plate's middle from the middle of the face, to the left of the push, m.
        most: Pushes, at most.
        switch_cost: What a change of the contact counts when plans are ranked, m.
        transit_weight: What a metre of the robot's way alone counts, as a share of a metre of pushing.
        approach: Length of the straight way to a contact, m.
        retreat: Length of the straight way back from it, m.
        settle: Length of the straight push with which every push begins, m.
    """

    robot_start: FloatArray
    goals: tuple[Goal, ...]
    faces: tuple[str | float, ...] | None = None
    offsets: tuple[float, ...] = (0.0,)
    most: int = 6
    switch_cost: float = 0.1
    transit_weight: float = 0.1
    approach: float = 0.05
    retreat: float = 0.05
    settle: float = 0.02

    def __post_init__(self) -> None:
        object.__setattr__(self, "robot_start", frozen(self.robot_start, (3,), "start of the robot"))


@dataclass(frozen=True, eq=False, kw_only=True)
class Bodies:
    """What moves as one load.

    Attributes:
        chain: Objects, contacts and pusher; of intervals, the middle of loads and the lowest contact friction.
        interval: The chain with the intervals of its loads and floor frictions, None when these are numbers.
        contact_friction: (n, 2) least and largest coefficient of every contact.
        stated: The same as plain data in the form of the file, with every pose and default filled in.
        snapping: How measured poses were moved; None when they are taken as they are.
    """

    chain: Chain
    interval: IntervalChain | None
    contact_friction: FloatArray
    stated: Mapping[str, Any]
    snapping: Snapping | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedObject(Bodies):
    """An object that stands apart, as a load pushed at its rear face with the plate's middle at its frame's y = 0.

    Attributes:
        pose: (3,) pose of its own frame in the world.
        goals: Any of which will do; none where it is moved only when it is in the way of others.
    """

    pose: FloatArray
    goals: tuple[Goal, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", frozen(self.pose, (3,), "pose of an object"))

    @property
    def start(self) -> FloatArray:
        """(3,) pose of its chain's frame in the world."""
        return se2.compose(self.pose, se2.inverse(self.chain.objects[0].pose_chain))

    @property
    def kind(self) -> str:
        """What is the same for objects that differ in name, place and goals only."""
        own = {key: value for key, value in self.stated["objects"][0].items() if key != "name"}
        return repr({**self.stated, "objects": own})


@dataclass(frozen=True, eq=False)
class Row:
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
    """

    of: tuple[str, ...]
    pose: FloatArray | None
    wall: str | None
    order: str
    gather: str
    friction: tuple[float, float]
    tolerance: tuple[float, float]
    placed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.pose is not None:
            object.__setattr__(self, "pose", frozen(self.pose, (3,), "pose of the row"))

    @property
    def left(self) -> tuple[str, ...]:
        """Names of those that have to be brought to it."""
        return tuple(name for name in self.of if name not in self.placed)


@dataclass(frozen=True, eq=False)
class Task:
    """A load that has to be brought to a goal.

    Attributes:
        chain: The load, as the scenario states it.
        start: (3,) pose of its chain frame in the world.
        goals: Any of which will do; none where it is moved only if it is in the way.
    """

    chain: Chain
    start: FloatArray
    goals: tuple[Goal, ...]

    def poses(self, load: FloatArray) -> dict[str, FloatArray]:
        """Return where the objects' own frames (3,) are with the chain frame at a pose (3,) in the world."""
        names = (obj.name for obj in self.chain.objects)
        return dict(zip(names, se2.compose(load, self.chain.places), strict=True))


@dataclass(frozen=True)
class Workspace:
    """The rectangle, in the world, that pusher and objects do not leave, m."""

    xmin: float
    xmax: float
    ymin: float
    ymax: float

    @property
    def outline(self) -> FloatArray:
        """(4, 2) its corners, counter-clockwise."""
        x, y = [self.xmin, self.xmax, self.xmax, self.xmin], [self.ymin, self.ymin, self.ymax, self.ymax]
        return np.stack([x, y], axis=1)


@dataclass(frozen=True)
class Snapped:
    """How an object was moved.

    Attributes:
        name: Of the object.
        onto: What messages call the body whose edge it lies on now.
        gap: Distance along the edge's normal that it was moved towards that body, m; < 0 away from it.
        turn: Angle by which it was turned about its outline's centroid, rad.
    """

    name: str
    onto: str
    gap: float
    turn: float


@dataclass(frozen=True)
class Snapping:
    """What became of measured poses.

    Attributes:
        objects: How each object with a stated pose was moved.
        sideways: y of the first contact's midpoint in the stated poses, which is the chain frame's origin now, m.
    """

    objects: tuple[Snapped, ...]
    sideways: float


@dataclass(frozen=True, eq=False)
class PolygonObstacle:
    """A simple polygon that stands still.

    Attributes:
        outline: (v, 2) corners in the world, m, counter-clockwise.
        unknown: It stands for a part of a map of which nothing is known; it is drawn as such.
    """

    outline: FloatArray
    unknown: bool = False
    radius: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", frozen(self.outline, (None, 2), "outline of an obstacle"))

    @cached_property
    def core(self) -> shapely.Polygon:
        """What all of its points are no farther from than `radius`, in the world: itself."""
        return shapely.Polygon(self.outline)

    @cached_property
    def box(self) -> FloatArray:
        """(2, 2) lower left and upper right corner of the box around it, in the world, m."""
        return frozen([self.outline.min(axis=0), self.outline.max(axis=0)], (2, 2), "box")

    def document(self) -> dict[str, Any]:
        """Return it in the form that it has in a file."""
        return {"polygon": self.outline.tolist(), **({"unknown": "obstacle"} if self.unknown else {})}

    def __str__(self) -> str:
        """Say where it is."""
        return _obstacle_at(self.box.mean(axis=0))


@dataclass(frozen=True, eq=False)
class CircleObstacle:
    """A disc that stands still.

    Attributes:
        center: (2,) in the world, m.
        radius: m.
    """

    center: FloatArray
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen(self.center, (2,), "centre of an obstacle"))

    @cached_property
    def core(self) -> shapely.Point:
        """What all of its points are no farther from than `radius`, in the world: its centre."""
        return shapely.Point(self.center)

    @cached_property
    def box(self) -> FloatArray:
        """(2, 2) lower left and upper right corner of the box around it, in the world, m."""
        return frozen([self.center - self.radius, self.center + self.radius], (2, 2), "box")

    def document(self) -> dict[str, Any]:
        """Return it in the form that it has in a file."""
        return {"circle": self.radius, "center": self.center.tolist()}

    def __str__(self) -> str:
        """Say where it is."""
        return _obstacle_at(self.center)


def _obstacle_at(place: FloatArray) -> str:
    return f"the obstacle at ({place[0]:.2f}, {place[1]:.2f}) m"


Obstacle = PolygonObstacle | CircleObstacle
