"""Typed models of objects, contacts and robot in a scenario file; descriptions state the allowed values."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from pushplan.mechanics.chain import Limits
from pushplan.scenario import fields as t
from pushplan.scenario.units import fault
from pushplan.util import names

NAME = "a name of up to 64 letters, digits, blanks, '.', '_' and '-' that begins with a letter or digit"
FRICTION = 'a friction coefficient, or a friction angle, e.g. "14 deg"'
POLYGON = f"a list of 3 to {t.MOST_CORNERS} corners [x, y]"
FACES = f"all, or a list of {', '.join(names.FACES)} and angles of outward normals in the chain frame"
SUPPORT = "uniform, unknown, {feet: [[x, y], ...]}, {feet: [[x, y, load], ...]} or {pressure_map: file.csv}"
DRIVE = "omnidirectional, {differential: {axle: [x, y, theta]}} or {car: {axle: ..., min_radius: ...}}"
LENGTH = "a length in m"
HEIGHT = "a height in m, or its interval [lowest, highest]"
MOST_PARTS = 50
FOOTPRINT = (
    "{box: [length, width], pose: [x, y, theta]}, {polygon: [[x, y], ...]} or a list of 1 to "
    f"{MOST_PARTS} of these"
)
_AXLE = "[x, y, theta] of the axle's middle, in the chain frame in pusher.drive, in the plate's in robot.drive"
_LIMITS = Limits()


def one_of(words: tuple[str, ...]) -> str:
    """Return the description of a choice of words."""
    return f"one of {', '.join(words)}"


class BoxShape(t.Strict):
    """A box about its frame's origin."""

    box: t.Box = Field(description="[length along x, width along y]")


class PolygonShape(t.Strict):
    """A polygon in its frame."""

    polygon: t.Polygon = Field(description=POLYGON)


Shape = Annotated[
    Annotated[BoxShape, Tag("<box>")] | Annotated[PolygonShape, Tag("<polygon>")], t.by_key("box", "polygon")
]


class Feet(t.Strict):
    """Feet in the object's frame, either all with or all without a fraction of the load."""

    feet: Annotated[
        tuple[t.Foot, ...],
        t.Several(1, 1000),
        Field(
            json_schema_extra={"anyOf": [{"items": {"type": "array", "maxItems": n, "minItems": n}} for n in (2, 3)]}
        ),
    ] = Field(description="a list of 1 to 1000 feet [x, y] or [x, y, load]")

    @model_validator(mode="after")
    def _alike(self) -> Feet:
        if len({len(foot) for foot in self.feet}) > 1:
            raise fault("some feet have a load and some have none", "a load for every foot, or for none")
        return self


class PressureMap(t.Strict):
    """A measured pressure in the object's frame."""

    pressure_map: t.FileName = Field(
        description="the name of a CSV file beside the scenario, with the columns x, y, pressure"
    )


Support = Annotated[
    Annotated[Literal["uniform", "unknown"], Tag("<word>")]
    | Annotated[Feet, Tag("<feet>")]
    | Annotated[PressureMap, Tag("<pressure_map>")],
    t.by_key("feet", "pressure_map"),
]


class Object(t.Strict):
    """One object; without `pose` it is stacked flush on the previous object or the plate."""

    name: t.Name = Field(description=NAME)
    shape: Shape = Field(description="{box: [length, width]} or {polygon: [[x, y], ...]}")
    mass: t.Mass = Field(description="a mass in kg")
    support: Support = Field(default="uniform", description=SUPPORT)
    height: t.Size | None = Field(default=None, description="a height in m")
    center_of_mass: t.MassCenter | None = Field(
        default=None, description="[x, y] in the object's frame, or [x, y, z] with z above the floor"
    )
    floor_friction: t.Friction | None = Field(default=None, description=FRICTION)
    offset: t.Coordinate | None = Field(default=None, description=LENGTH)
    pose: t.Pose | None = Field(default=None, description="[x, y, theta] in the chain frame")


class ContactPair(t.Strict):
    """Friction and height of the contact between two objects, or between the pusher and an object."""

    objects: Annotated[tuple[str, ...], t.Several(2, 2)] = Field(
        description="two names of objects that touch, e.g. [near, far], or pusher and an object"
    )
    friction: t.Friction | None = Field(default=None, description=FRICTION)
    height: t.Height | None = Field(default=None, description=HEIGHT)

    @model_validator(mode="after")
    def _says_something(self) -> ContactPair:
        if self.friction is None and self.height is None:
            raise fault("has neither friction nor height", "one of them, or both")
        return self


class Contacts(t.Strict):
    """Friction between objects."""

    friction: t.Friction | None = Field(default=None, description=FRICTION)
    between: Annotated[tuple[ContactPair, ...], t.Several(0, 400)] = Field(
        default=(), description="a list of {objects: [a, b], friction: ..., height: ...}"
    )


class Wheels(t.Strict):
    """Two driven wheels on one axle."""

    axle: t.Pose = Field(description=_AXLE)


class CarWheels(Wheels):
    """A fixed rear axle and steered front wheels."""

    min_radius: t.Size = Field(description="the smallest turning radius of the axle's middle, a length in m")


class Differential(t.Strict):
    """A drive with two wheels that do not slip sideways."""

    differential: Wheels = Field(description="{axle: [x, y, theta]}")


class Car(t.Strict):
    """A drive that steers like a car."""

    car: CarWheels = Field(description="{axle: [x, y, theta], min_radius: ...}")


Drive = Annotated[
    Annotated[Literal["omnidirectional"], Tag("<word>")]
    | Annotated[Differential, Tag("<differential>")]
    | Annotated[Car, Tag("<car>")],
    t.by_key("differential", "car"),
]


class MotionLimits(t.Strict):
    """Limits of the pusher's motion."""

    speed: t.Speed = Field(default=_LIMITS.speed, description="a speed in m/s, or [least, most]")
    acceleration: t.Acceleration = Field(
        default=_LIMITS.acceleration, description="an acceleration in m/s^2, or [least, most]"
    )
    jerk: t.Jerk = Field(default=_LIMITS.jerk, description="a jerk in m/s^3")
    angular_speed: t.AngularSpeed = Field(
        default=_LIMITS.angular_speed, description="an angular speed in rad/s, or [least, most]"
    )
    angular_acceleration: t.AngularAcceleration = Field(
        default=_LIMITS.angular_acceleration, description="an angular acceleration in rad/s^2, or [least, most]"
    )
    angular_jerk: t.AngularJerk = Field(default=_LIMITS.angular_jerk, description="an angular jerk in rad/s^3")
    contact: Literal[names.CONTACT_LIMITS] = Field(  # type: ignore[valid-type]
        default=_LIMITS.contact, description=one_of(names.CONTACT_LIMITS)
    )


Faces = Annotated[
    Annotated[Literal["all"], Tag("<one>")]
    | Annotated[Annotated[tuple[t.Face, ...], t.Several(1, 100)], Tag("<list>")],
    Discriminator(t.one_or_list),
]


class Plate(t.Strict):
    """The plate, its contacts and its motion limits."""

    width: t.Size = Field(description=LENGTH)
    thickness: t.Size = Field(default=0.03, description=LENGTH)
    friction: t.Friction = Field(description=FRICTION)
    contact_height: t.Height = Field(default=0.0, description=HEIGHT)
    drive: Drive = Field(default="omnidirectional", description=DRIVE)
    faces: Faces | None = Field(default=None, description=FACES)
    offsets: Annotated[tuple[t.Coordinate, ...], t.Several(1, 20)] | None = Field(
        default=None, description="a list of 1 to 20 lengths in m, e.g. [0, 15 mm]"
    )
    limits: MotionLimits = t.with_defaults(MotionLimits, "{speed: ..., acceleration: ..., jerk: ..., ...}")


_PART = Field(default=(0.0, 0.0, 0.0), description="[x, y, theta] in the frame of the plate's front edge")


class BoxPart(BoxShape):
    """A rectangular part of the robot."""

    pose: t.Pose = _PART


class PolygonPart(PolygonShape):
    """A polygonal part of the robot."""

    pose: t.Pose = _PART


Part = Annotated[
    Annotated[BoxPart, Tag("<box>")] | Annotated[PolygonPart, Tag("<polygon>")], t.by_key("box", "polygon")
]
Footprint = Annotated[
    Annotated[Part, Tag("<one>")] | Annotated[Annotated[tuple[Part, ...], t.Several(1, MOST_PARTS)], Tag("<list>")],
    Discriminator(t.one_or_list),
]


class RobotLimits(t.Strict):
    """Limits of the robot's push force."""

    force: t.Force = Field(description="a force in N: the largest push of the plate, e.g. 40 N")
    breakaway: t.Breakaway = Field(
        default=_LIMITS.breakaway,
        description="a factor from 1: the force that starts a load's motion, divided by the force of sliding",
    )


class Robot(t.Strict):
    """The robot that carries the plate, with its shape and drive."""

    footprint: Footprint | None = Field(default=None, description=FOOTPRINT)
    drive: Drive | None = Field(default=None, description=DRIVE)
    start: t.Pose | None = Field(
        default=None, description="[x, y, theta] of the plate's frame in the world; requests a multi-push plan"
    )
    base: t.Pose | None = Field(
        default=None,
        description="[x, y, theta] of the frame that path followers steer, in the plate's frame; default: the axle",
    )
    limits: RobotLimits | None = Field(default=None, description="{force: ..., breakaway: ...}")


class PlacedObject(Object):
    """One object that stands apart from the others."""

    pose: t.Pose = Field(description="[x, y, theta] in the world")


class PlacedRobot(Robot):
    """The robot at a given start pose."""

    start: t.Pose = Field(description="[x, y, theta] of the plate's frame in the world")
