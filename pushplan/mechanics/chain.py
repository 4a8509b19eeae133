"""A chain (or tree) of objects in contact, pushed by one pusher: sections 3 and 4.1 of Harada et al. 2006.

The origin of the *chain frame* is the midpoint of the pusher's contact with the first object, +x is the push normal,
+y is to the left. Objects are listed from the pusher outward; `objects[i]` is pushed through `contacts[i]`. The paper
counts in the opposite order: its object 1 is the farthest one. For collision checks and pictures, all bodies
including plate and robot move as one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.errors import ChainError, SupportError
from pushplan.geometry import se2
from pushplan.geometry.polygon import area_moments
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.support import Support
from pushplan.util.arrays import FloatArray, frozen
from pushplan.util.names import DEFAULT_CONTACT_LIMITS, PUSHER, ROBOT

SEAM = 1e-7
"""Distance (m) up to which bodies count as one, because rounding can open the line along which they touch."""


class BodyKind(Enum):
    """Kind of a body; only objects rest on the floor and are pushed."""

    ROBOT = "robot"
    PLATE = "plate"
    OBJECT = "object"


@dataclass(frozen=True, eq=False)
class Body:
    """An outline that is fixed to the chain frame.

    Attributes:
        name: `robot`, `pusher` (the plate) or the object's name.
        kind: Kind of the body.
        outline: Simple polygon (v, 2) in the chain frame, m, counter-clockwise.
    """

    name: str
    kind: BodyKind
    outline: FloatArray


def as_one(bodies: Iterable[Body]) -> BaseGeometry:
    """Return the union of the bodies in the chain frame."""
    outlines = [shapely.Polygon(body.outline) for body in bodies]
    return shapely.union_all(outlines).buffer(SEAM, join_style="mitre").buffer(-SEAM, join_style="mitre")


def area_at(bodies: Iterable[Body], pose: FloatArray) -> BaseGeometry:
    """Return the union of the bodies in the world, with their frame at a pose (3,)."""
    return shapely.transform(as_one(bodies), lambda corners: se2.transform_points(pose, corners))


def outline_of_all(bodies: Iterable[Body]) -> FloatArray:
    """Return one counter-clockwise polygon (v, 2) around all bodies; their convex hull if they are separate."""
    shape = as_one(bodies)
    around = shape if isinstance(shape, shapely.Polygon) else shape.convex_hull
    ring = shapely.Polygon(shapely.get_exterior_ring(around))  # without holes between the bodies
    return shapely.get_coordinates(shapely.orient_polygons(ring))[:-1]


GRAVITY = 9.80665
"""Standard gravity, m/s^2."""

PLATE = -1
"""Index of the pusher's plate in place of an object's index."""


@dataclass(frozen=True, eq=False)
class PushedObject:
    """One rigid object on the floor.

    Attributes:
        name: Unique name.
        outline: Simple polygon (v, 2) in the object's own frame, m, counter-clockwise.
        mass: Mass, kg, > 0.
        floor_friction: Friction coefficient between the object and the floor, >= 0.
        support: Load distribution on the floor, in the object's own frame.
        pose_chain: Pose (3,) (x, y, theta) of the object's frame in the chain frame.
        center_height: Height of the centre of mass above the floor, m; None if it is not known, so that inertia does
            not shift the load.
    """

    name: str
    outline: FloatArray
    mass: float
    floor_friction: float
    support: Support
    pose_chain: FloatArray
    center_height: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", frozen(self.outline, (None, 2), f"outline of {self.name!r}"))
        object.__setattr__(self, "pose_chain", frozen(self.pose_chain, (3,), f"pose of {self.name!r}"))

    @cached_property
    def outline_chain(self) -> FloatArray:
        """Outline (v, 2) in the chain frame, m."""
        return transform_points(self.pose_chain, self.outline)

    @property
    def friction_load(self) -> float:
        """Floor friction coefficient times weight, N: the force of a pure translation."""
        return self.floor_friction * self.mass * GRAVITY


@dataclass(frozen=True, eq=False)
class Contact:
    """A line contact through which one body pushes an object.

    Attributes:
        right: End point (2,) of the segment to the right of the normal, in the chain frame, m.
        left: End point (2,) of the segment to the left of the normal, in the chain frame, m.
        friction: Friction coefficient, >= 0.
        pushed: Index of the pushed object.
        pusher: Index of the pushing object, or `PLATE`.
        height: Lowest and highest height above the floor at which the force can act, m; None for the pusher's
            `contact_height`.
    """

    right: FloatArray
    left: FloatArray
    friction: float
    pushed: int
    pusher: int
    height: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "right", frozen(self.right, (2,), "contact end"))
        object.__setattr__(self, "left", frozen(self.left, (2,), "contact end"))
        if not self.length > 0.0:
            raise ChainError(f"contact of object {self.pushed} has length {self.length} m; it must be > 0")

    @cached_property
    def length(self) -> float:
        """Length of the segment, m."""
        return float(np.linalg.norm(self.left - self.right))

    @cached_property
    def tangent(self) -> FloatArray:
        """Unit vector (2,) from the right end to the left end."""
        return (self.left - self.right) / self.length

    @cached_property
    def normal(self) -> FloatArray:
        """Unit normal (2,) from the pushing to the pushed body."""
        tangent = self.tangent
        return np.array([tangent[1], -tangent[0]])


Limit = float | tuple[float, float]
LimitName = Literal["speed", "acceleration", "angular_speed", "angular_acceleration"]


@dataclass(frozen=True)
class Limits:
    """Limits of the pusher's motion, in SI units; translations are those of the chain frame's origin.

    A number is the limit for both signs. A pair (least, most) around 0 has a limit for each sign.

    Attributes:
        speed: Limit of the speed; the least of a pair limits backward motion.
        acceleration: Limit of the acceleration; the least of a pair limits braking.
        jerk: Limit of the jerk.
        angular_speed: Limit of the angular speed.
        angular_acceleration: Limit of the angular acceleration.
        angular_jerk: Limit of the angular jerk.
        contact: Whether inertia limits the motion so that no contact slips, one of `names.CONTACT_LIMITS`.
        force: Largest force `|F_xy|` of the plate, N.
        breakaway: Ratio, >= 1, of static and sliding floor friction at the beginning of a push.
    """

    speed: Limit = 0.2
    acceleration: Limit = 0.5
    jerk: float = 5.0
    angular_speed: Limit = 1.0
    angular_acceleration: Limit = 2.0
    angular_jerk: float = 20.0
    contact: str = DEFAULT_CONTACT_LIMITS
    force: float = math.inf
    breakaway: float = 1.3

    def both(self, name: LimitName) -> tuple[float, float]:
        """Return the largest magnitudes of negative and of positive values."""
        limit: Limit = getattr(self, name)
        return (-limit[0], limit[1]) if isinstance(limit, tuple) else (limit, limit)


@dataclass(frozen=True, eq=False)
class Drive:
    """Drive of the robot, which limits its twists.

    Attributes:
        kind: `omnidirectional`, `differential` or `car`.
        axle: Pose (3,) of the (rear) axle's middle in the chain frame, +x forward; None if omnidirectional.
        min_radius: Smallest turning radius of the axle's middle, m (`car` only).
    """

    kind: str = "omnidirectional"
    axle: FloatArray | None = None
    min_radius: float = 0.0

    def turning_centres(self, far: float) -> FloatArray:
        """Return the possible centres of rotation: two segments (2, 2, 2) of the axle's line in the chain frame.

        The segments, to the left and to the right, extend to `far` (m) from the axle's middle. For an omnidirectional
        drive, which can turn about any point, the array is empty: (0, 2, 2).
        """
        if self.axle is None:
            return np.zeros((0, 2, 2))
        x, y, heading = self.axle
        across = np.array([-np.sin(heading), np.cos(heading)])
        reach = np.array([[self.min_radius, far], [-self.min_radius, -far]])
        return np.asarray(np.array([x, y]) + reach[..., None] * across)

    @property
    def turning_words(self) -> str:
        """Legend entry for the possible centres of rotation; empty if every point is possible."""
        if self.axle is None:
            return ""
        tightest = f", radius from {self.min_radius:.3g} m" if self.min_radius else ""
        return f"turning centres of the {self.kind} drive{tightest}"


@dataclass(frozen=True, eq=False)
class Pusher:
    """The plate and the robot that carries it.

    Attributes:
        outline: Outline (v, 2) of the plate in the chain frame, m, counter-clockwise.
        friction: Friction coefficient between the plate and the objects that it touches.
        contact_height: Height, or lowest and highest height, above the floor of the forces of contacts without their
            own height, m.
        drive: Drive of the robot.
        limits: Limits of the motion.
        footprint: Outlines (v, 2) of the robot's parts in the chain frame, m, counter-clockwise; empty if the robot
            has no given shape. They can overlap the plate and each other.
        base: Pose (3,) of the robot's base in the chain frame, the frame that path followers steer; None for the
            drive's axle, or the chain frame if there is no axle.
    """

    outline: FloatArray
    friction: float
    contact_height: float | tuple[float, float] = 0.0
    drive: Drive = field(default_factory=Drive)
    limits: Limits = field(default_factory=Limits)
    footprint: tuple[FloatArray, ...] = ()
    base: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", frozen(self.outline, (None, 2), "outline of the pusher"))
        parts = tuple(frozen(part, (None, 2), "footprint of the robot") for part in self.footprint)
        object.__setattr__(self, "footprint", parts)
        if self.base is not None:
            object.__setattr__(self, "base", frozen(self.base, (3,), "base of the robot"))

    @property
    def base_pose(self) -> FloatArray:
        """Pose (3,) of the base in the chain frame: `base` or its default."""
        if self.base is not None:
            return self.base
        return np.zeros(3) if self.drive.axle is None else self.drive.axle

    @property
    def plate_pose(self) -> FloatArray:
        """Pose (3,) of the plate's frame in the chain frame: the middle of its front edge, +x along the push."""
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        return np.array([high[0], 0.5 * (low[1] + high[1]), 0.0])

    @property
    def wheels_pose(self) -> FloatArray:
        """Pose (3,) of the frame of the odometry in the chain frame: the axle's middle, else base or plate frame.

        Errors of the odometry are constant in this frame; in another frame they change with turns.
        """
        if self.drive.axle is not None:
            return self.drive.axle
        return self.plate_pose if self.base is None else self.base


@dataclass(frozen=True, eq=False)
class Chain:
    """Objects and the contacts that push them; a tree is allowed, a loop is not.

    Attributes:
        objects: Objects from the pusher outward.
        contacts: Contacts; `contacts[i]` pushes `objects[i]`, and its `pusher` is an earlier object or `PLATE`.
        pusher: Plate and robot.

    Raises:
        ChainError: If the contacts do not form a tree in this order.
    """

    objects: tuple[PushedObject, ...]
    contacts: tuple[Contact, ...]
    pusher: Pusher

    def __post_init__(self) -> None:
        if not self.objects:
            raise ChainError("a chain needs at least one object")
        if len(self.contacts) != len(self.objects):
            raise ChainError(f"{len(self.objects)} objects need as many contacts, not {len(self.contacts)}")
        for i, contact in enumerate(self.contacts):
            if contact.pushed != i or not PLATE <= contact.pusher < i:
                raise ChainError(
                    f"contact {i} pushes object {contact.pushed} from {contact.pusher}; "
                    f"it must push object {i} from the plate ({PLATE}) or an earlier object"
                )

    def __repr__(self) -> str:
        """Return one line with the objects' names."""
        return f"<Chain of {', '.join(obj.name for obj in self.objects)}>"

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies that move with the chain, from the rear to the front: robot parts, plate, objects."""
        return (
            *(Body(ROBOT, BodyKind.ROBOT, part) for part in self.pusher.footprint),
            Body(PUSHER, BodyKind.PLATE, self.pusher.outline),
            *(Body(obj.name, BodyKind.OBJECT, obj.outline_chain) for obj in self.objects),
        )

    @cached_property
    def carried(self) -> tuple[Body, ...]:
        """Bodies that always move with the robot: its own parts and the plate."""
        return tuple(body for body in self.bodies if body.kind is not BodyKind.OBJECT)

    @cached_property
    def places(self) -> FloatArray:
        """Poses (n, 3) of the objects' own frames in the chain frame."""
        return frozen([obj.pose_chain for obj in self.objects], (None, 3), "places of the objects")

    @cached_property
    def contact_heights(self) -> FloatArray:
        """Lowest and highest heights (n, 2) above the floor at which each contact's force can act, m."""
        own = self.pusher.contact_height
        heights = [own if contact.height is None else contact.height for contact in self.contacts]
        return frozen([np.broadcast_to(height, 2) for height in heights], (None, 2), "contact heights")

    @property
    def contact_height(self) -> float:
        """The common height of all contacts, m.

        Raises:
            SupportError: If the heights differ or are intervals.
        """
        heights = self.contact_heights
        if (heights != heights[0, 0]).any():
            raise SupportError(
                f"the contacts are at heights from {heights.min():.6g} to {heights.max():.6g} m; this computation "
                "needs a single number for all contacts; the sets 'ecof' and 'robust' do not"
            )
        return float(heights[0, 0])

    def at_floor(self) -> Chain:
        """Return the chain with all contacts at the floor, so that no load shifts."""
        contacts = tuple(replace(contact, height=None) for contact in self.contacts)
        objects = tuple(replace(obj, center_height=None) for obj in self.objects)
        return replace(self, objects=objects, contacts=contacts, pusher=replace(self.pusher, contact_height=0.0))

    @property
    def loads_known(self) -> bool:
        """Whether the load distribution under every object is known, and with it the contact forces."""
        return all(obj.support.known for obj in self.objects)

    @cached_property
    def reach(self) -> float:
        """Distance from the chain frame's origin to the farthest point of any body, m."""
        return max(float(np.linalg.norm(body.outline, axis=1).max()) for body in self.bodies)

    @cached_property
    def characteristic_length(self) -> float:
        """Distance from the chain frame's origin to the farthest point of any object, m.

        Moments are divided by this length and angular velocities multiplied by it, so that margins and the twist
        sphere are dimensionless.
        """
        points = np.concatenate([obj.outline_chain for obj in self.objects])
        return float(np.max(np.linalg.norm(points, axis=1)))

    @property
    def first_pushed(self) -> int:
        """Index of the first object that the plate pushes."""
        return next(contact.pushed for contact in self.contacts if contact.pusher == PLATE)

    def contact_name(self, k: int) -> str:
        """Return the name of contact `k`: the pushing and the pushed body."""
        contact = self.contacts[k]
        pushing = PUSHER if contact.pusher == PLATE else self.objects[contact.pusher].name
        return f"{pushing}-{self.objects[contact.pushed].name}"

    def index_of(self, name: str) -> int:
        """Return the index of the object called `name`.

        Raises:
            ChainError: If no object has that name.
        """
        names = [obj.name for obj in self.objects]
        if name not in names:
            raise ChainError(f"no object is called {name!r}; allowed: {', '.join(names)}")
        return names.index(name)


class Inertia(NamedTuple):
    """Mass (kg), centre of mass (2,) in the chain frame (m) and moment of inertia about it (kg m^2)."""

    mass: float
    center: FloatArray
    moment: float


def inertia_of(obj: PushedObject) -> Inertia:
    """Return the mass properties of an object with uniform density over its outline.

    The centre of mass is the centre of the load at rest. If this is not the outline's centroid, the moment of inertia
    is that of the outline shifted to this centre.
    """
    moments = area_moments(obj.outline)
    center = transform_points(obj.pose_chain, obj.support.center)
    return Inertia(obj.mass, center, obj.mass * float(np.trace(moments.second)) / moments.area)


class InertiaTable(NamedTuple):
    """Masses (n,), centres (n, 2) in the chain frame and moments of inertia (n,) of a chain's objects, SI units."""

    mass: FloatArray
    center: FloatArray
    moment: FloatArray


def inertia_table(chain: Chain) -> InertiaTable:
    """Return the mass properties of all objects of a chain."""
    parts = [inertia_of(obj) for obj in chain.objects]
    return InertiaTable(
        np.array([part.mass for part in parts]),
        np.array([part.center for part in parts]),
        np.array([part.moment for part in parts]),
    )
