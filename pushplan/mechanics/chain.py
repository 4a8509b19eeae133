"""A chain (or tree) of objects in contact, carried by one pusher: sections 3 and 4.1 of Harada et al. 2006.

Frames: the *chain frame* has its origin at the midpoint of the pusher's contact with the first object, +x
along the push normal, +y to the left. Objects are listed from the pusher outward; `objects[i]` is pushed
through `contacts[i]`. The paper counts the other way round (its object 1 is the farthest one). For collision checks
and pictures all bodies, plate and robot included, move as one.
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
"""Bodies this close (m) count as one: they touch along lines that rounding may open."""


class BodyKind(Enum):
    """What a body is; objects alone rest on the floor and are pushed."""

    ROBOT = "robot"
    PLATE = "plate"
    OBJECT = "object"


@dataclass(frozen=True, eq=False)
class Body:
    """An outline that is fixed to the chain frame.

    Attributes:
        name: `robot`, `pusher` (the plate) or the object's name.
        kind: What it is.
        outline: (v, 2) simple polygon in the chain frame, m, counter-clockwise.
    """

    name: str
    kind: BodyKind
    outline: FloatArray


def as_one(bodies: Iterable[Body]) -> BaseGeometry:
    """Return what the bodies cover together, in the chain frame."""
    outlines = [shapely.Polygon(body.outline) for body in bodies]
    return shapely.union_all(outlines).buffer(SEAM, join_style="mitre").buffer(-SEAM, join_style="mitre")


def area_at(bodies: Iterable[Body], pose: FloatArray) -> BaseGeometry:
    """Return what bodies cover together with their frame at a pose (3,) in the world."""
    return shapely.transform(as_one(bodies), lambda corners: se2.transform_points(pose, corners))


def outline_of_all(bodies: Iterable[Body]) -> FloatArray:
    """Return one polygon (v, 2) around all bodies, counter-clockwise; where they are apart, their convex hull."""
    shape = as_one(bodies)
    around = shape if isinstance(shape, shapely.Polygon) else shape.convex_hull
    ring = shapely.Polygon(shapely.get_exterior_ring(around))  # without holes between the bodies
    return shapely.get_coordinates(shapely.orient_polygons(ring))[:-1]


GRAVITY = 9.80665
"""Standard gravity, m/s^2."""

PLATE = -1
"""Index that stands for the pusher's plate where an object's index is expected."""


@dataclass(frozen=True, eq=False)
class PushedObject:
    """One rigid object on the floor.

    Attributes:
        name: Unique name.
        outline: (v, 2) simple polygon in the object's own frame, m, counter-clockwise.
        mass: kg, > 0.
        floor_friction: Coefficient between the object and the floor, >= 0.
        support: How the load rests on the floor, in the object's own frame.
        pose_chain: (3,) pose (x, y, theta) of the object's frame in the chain frame.
        center_height: Height of its centre of mass above the floor, m; None where it is not stated: inertia then
            moves no load.
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
        """(v, 2) outline in the chain frame, m."""
        return transform_points(self.pose_chain, self.outline)

    @property
    def friction_load(self) -> float:
        """Floor friction coefficient times weight, N: the force that a pure translation has to overcome."""
        return self.floor_friction * self.mass * GRAVITY


@dataclass(frozen=True, eq=False)
class Contact:
    """A line contact through which `pushed` is moved.

    Attributes:
        right: (2,) end point of the segment to the right of the normal, chain frame, m.
        left: (2,) end point to the left of the normal, chain frame, m.
        friction: Coefficient of friction, >= 0.
        pushed: Index of the object that the contact moves.
        pusher: Index of the object that pushes, or `PLATE`.
        height: Least and largest height above the floor at which its force may act, m; None for the pusher's
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
        """(2,) unit vector from the right end to the left end."""
        return (self.left - self.right) / self.length

    @cached_property
    def normal(self) -> FloatArray:
        """(2,) unit vector from the pushing into the pushed body."""
        tangent = self.tangent
        return np.array([tangent[1], -tangent[0]])


Limit = float | tuple[float, float]
LimitName = Literal["speed", "acceleration", "angular_speed", "angular_acceleration"]


@dataclass(frozen=True)
class Limits:
    """What the pusher's motion may not exceed; lengths refer to the origin of the chain frame. SI units.

    A pair (least, most) around 0 holds another bound for either sign, a number the same for both.

    Attributes:
        speed: Like the next two, of the chain frame's origin; of a pair, the least bounds motion backwards.
        acceleration: See `speed`; of a pair, the least bounds its magnitude while the speed falls.
        jerk: See `speed`.
        angular_speed: Like the next two, of the turning.
        angular_acceleration: See `angular_speed`.
        angular_jerk: See `angular_speed`.
        contact: Whether no contact may slip through inertia either, one of `names.CONTACT_LIMITS`.
        force: Largest force `|F_xy|` with which the plate pushes, N.
        breakaway: Factor, >= 1, by which static friction on the floor exceeds that of sliding, as a push begins.
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
        """Return the largest magnitudes of what is negative and of what is positive."""
        limit: Limit = getattr(self, name)
        return (-limit[0], limit[1]) if isinstance(limit, tuple) else (limit, limit)


@dataclass(frozen=True, eq=False)
class Drive:
    """What twists the robot behind the plate can make.

    Attributes:
        kind: `omnidirectional`, `differential` or `car`.
        axle: (3,) pose in the chain frame of the (rear) axle's middle, +x forward; None if omnidirectional.
        min_radius: Smallest turning radius of the axle's middle, m (`car` only).
    """

    kind: str = "omnidirectional"
    axle: FloatArray | None = None
    min_radius: float = 0.0

    def turning_centres(self, far: float) -> FloatArray:
        """Return what it can turn about: two segments (2, 2, 2) of the axle's line, to `far` (m) from its middle.

        They are in the chain frame, to the left and to the right; of an omnidirectional drive, which can turn about
        any point, there are none: (0, 2, 2).
        """
        if self.axle is None:
            return np.zeros((0, 2, 2))
        x, y, heading = self.axle
        across = np.array([-np.sin(heading), np.cos(heading)])
        reach = np.array([[self.min_radius, far], [-self.min_radius, -far]])
        return np.asarray(np.array([x, y]) + reach[..., None] * across)

    @property
    def turning_words(self) -> str:
        """What it can turn about, for the key of a picture; empty where that is any point."""
        if self.axle is None:
            return ""
        tightest = f", radius from {self.min_radius:.3g} m" if self.min_radius else ""
        return f"turning centres of the {self.kind} drive{tightest}"


@dataclass(frozen=True, eq=False)
class Pusher:
    """The plate and the robot that carries it.

    Attributes:
        outline: (v, 2) plate in the chain frame, m, counter-clockwise.
        friction: Coefficient between the plate and the objects it touches.
        contact_height: Height above the floor of the forces of contacts that do not state their own, or least and
            largest one, m.
        drive: What twists the robot can make.
        limits: What its motion may not exceed.
        footprint: Outlines (v, 2) of the robot's parts in the chain frame, m, counter-clockwise; none where the robot
            is not stated. They may overlap the plate and one another.
        base: (3,) pose in the chain frame of the robot's base, the frame that path followers steer; by default the
            drive's axle, and the chain frame itself where there is none.
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
        """(3,) `base`, or what stands for it."""
        if self.base is not None:
            return self.base
        return np.zeros(3) if self.drive.axle is None else self.drive.axle

    @property
    def plate_pose(self) -> FloatArray:
        """(3,) pose of the plate's frame in the chain frame: the middle of its front edge, +x along the push."""
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        return np.array([high[0], 0.5 * (low[1] + high[1]), 0.0])

    @property
    def wheels_pose(self) -> FloatArray:
        """(3,) pose in the chain frame of what wheels move: the axle's middle, else the base, else the plate's frame.

        Errors of odometry are constants of that frame; of another one they change with the turns.
        """
        if self.drive.axle is not None:
            return self.drive.axle
        return self.plate_pose if self.base is None else self.base


@dataclass(frozen=True, eq=False)
class Chain:
    """Objects and the contacts that carry them; a tree is allowed, a loop is not.

    Attributes:
        objects: From the pusher outward.
        contacts: `contacts[i]` pushes `objects[i]`; its `pusher` is an earlier object or `PLATE`.
        pusher: The plate.

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
        """Say what it is in a line."""
        return f"<Chain of {', '.join(obj.name for obj in self.objects)}>"

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """All that moves with the chain, from behind to the front: the robot's parts, the plate, the objects."""
        return (
            *(Body(ROBOT, BodyKind.ROBOT, part) for part in self.pusher.footprint),
            Body(PUSHER, BodyKind.PLATE, self.pusher.outline),
            *(Body(obj.name, BodyKind.OBJECT, obj.outline_chain) for obj in self.objects),
        )

    @cached_property
    def carried(self) -> tuple[Body, ...]:
        """Those of `bodies` that the robot carries wherever it goes: its own parts and the plate."""
        return tuple(body for body in self.bodies if body.kind is not BodyKind.OBJECT)

    @cached_property
    def places(self) -> FloatArray:
        """(n, 3) poses of the objects' own frames in the chain frame."""
        return frozen([obj.pose_chain for obj in self.objects], (None, 3), "places of the objects")

    @cached_property
    def contact_heights(self) -> FloatArray:
        """(n, 2) least and largest height above the floor at which each contact's force may act, m."""
        own = self.pusher.contact_height
        heights = [own if contact.height is None else contact.height for contact in self.contacts]
        return frozen([np.broadcast_to(height, 2) for height in heights], (None, 2), "contact heights")

    @property
    def contact_height(self) -> float:
        """The height of all contacts, m.

        Raises:
            SupportError: If they have several, or intervals.
        """
        heights = self.contact_heights
        if (heights != heights[0, 0]).any():
            raise SupportError(
                f"the contacts are at heights from {heights.min():.6g} to {heights.max():.6g} m, for which loads "
                "have no closed form: this needs one height for all, as a number; the sets 'ecof' and 'robust' do not"
            )
        return float(heights[0, 0])

    def at_floor(self) -> Chain:
        """Return the chain pushed at the floor: no load moves."""
        contacts = tuple(replace(contact, height=None) for contact in self.contacts)
        objects = tuple(replace(obj, center_height=None) for obj in self.objects)
        return replace(self, objects=objects, contacts=contacts, pusher=replace(self.pusher, contact_height=0.0))

    @property
    def loads_known(self) -> bool:
        """Whether the load distribution under every object is known, so that contact forces are."""
        return all(obj.support.known for obj in self.objects)

    @cached_property
    def reach(self) -> float:
        """Distance from the chain frame's origin to the farthest point of any body, m."""
        return max(float(np.linalg.norm(body.outline, axis=1).max()) for body in self.bodies)

    @cached_property
    def characteristic_length(self) -> float:
        """Distance from the chain frame's origin to the farthest point of any object, m.

        Moments are divided by it and angular velocities multiplied, so that margins and the twist sphere
        are dimensionless.
        """
        points = np.concatenate([obj.outline_chain for obj in self.objects])
        return float(np.max(np.linalg.norm(points, axis=1)))

    @property
    def first_pushed(self) -> int:
        """Index of the first object that the plate pushes."""
        return next(contact.pushed for contact in self.contacts if contact.pusher == PLATE)

    def contact_name(self, k: int) -> str:
        """Return a name for contact `k`: who pushes, and whom."""
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
            raise ChainError(f"no object is called {name!r}; there are {', '.join(names)}")
        return names.index(name)


class Inertia(NamedTuple):
    """Mass (kg), centre of mass (2,) in the chain frame (m) and moment of inertia about it (kg m^2)."""

    mass: float
    center: FloatArray
    moment: float


def inertia_of(obj: PushedObject) -> Inertia:
    """Return the mass properties of an object of even density over its outline.

    The centre of mass is the centre of the load at rest. Where a support model puts it off the outline's
    centroid, the moment of inertia is that of the outline shifted to this centre.
    """
    moments = area_moments(obj.outline)
    center = transform_points(obj.pose_chain, obj.support.center)
    return Inertia(obj.mass, center, obj.mass * float(np.trace(moments.second)) / moments.area)


class InertiaTable(NamedTuple):
    """The objects of a chain: masses (n,), centres (n, 2) in the chain frame, moments of inertia (n,)."""

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
