"""Objects, contacts, pusher and robot in a scenario file; a description is what messages name as allowed."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from pushplan.mechanics.chain import Limits
from pushplan.scenario.schema import types as t
from pushplan.scenario.values.quantity import fault
from pushplan.util import names

NAME = "a name of up to 64 letters, digits, blanks, '.', '_' and '-' that begins with a letter or digit"
FRICTION = 'a friction coefficient, or a friction angle, e.g. "14 deg"'
POLYGON = f"a list of 3 to {t.MOST_CORNERS} corners [x, y]"
FACES = f"all, or a list of {', '.join(names.FACES)} and angles of outward normals in the chain frame"
_SUPPORT = "uniform, unknown, {feet: [[x, y], ...]}, {feet: [[x, y, load], ...]} or {pressure_map: file.csv}"
DRIVE = "omnidirectional, {differential: {axle: [x, y, theta]}} or {car: {axle: ..., min_radius: ...}}"
_AXLE = (
    "[x, y, theta] of the axle's middle, in the chain frame in pusher.drive, in the plate's in robot.drive"
)
_LIMITS = Limits()


# All feet have a load, or none has.
_ALIKE = Field(
    json_schema_extra={"anyOf": [{"items": {"type": "array", "maxItems": n, "minItems": n}} for n in (2, 3)]}
)


def _word_or_mapping(value: Any) -> str:
    return "<mapping>" if isinstance(value, dict | t.Strict) else "<word>"


class Shape(t.Strict):
    """A box about its frame's origin, or a polygon in its frame."""

    model_config = t.exactly_one("box", "polygon")

    box: t.Box | None = Field(default=None, description="[length along x, width along y]")
    polygon: t.Polygon | None = Field(default=None, description=POLYGON)

    @model_validator(mode="after")
    def _one(self) -> Shape:
        t.require_one(self, "box", "polygon")
        return self


class PlacedSupport(t.Strict):
    """Feet, with or without loads, or a measured pressure map; in the object's frame."""

    model_config = t.exactly_one("feet", "pressure_map")

    feet: Annotated[tuple[t.Foot, ...], t.Several(1, 1000), _ALIKE] | None = Field(
        default=None, description="a list of 1 to 1000 feet [x, y] or [x, y, load]"
    )
    pressure_map: Annotated[str, Field(strict=True, min_length=1)] | None = Field(
        default=None,
        description="the name of a CSV file beside the scenario, with the columns x, y, pressure",
    )

    @model_validator(mode="after")
    def _one(self) -> PlacedSupport:
        t.require_one(self, "feet", "pressure_map")
        if self.feet is not None and len({len(foot) for foot in self.feet}) > 1:
            raise fault("some feet have a load and some have none", "a load for every foot, or for none")
        return self


Support = Annotated[
    Annotated[Literal["uniform", "unknown"], Tag("<word>")] | Annotated[PlacedSupport, Tag("<mapping>")],
    Discriminator(_word_or_mapping),
]


class Object(t.Strict):
    """One object; without `pose` it is stacked flush on the one before, or on the plate."""

    name: t.Name = Field(description=NAME)
    shape: Shape = Field(description="{box: [length, width]} or {polygon: [[x, y], ...]}")
    mass: t.Mass = Field(description="a mass in kg")
    support: Support = Field(default="uniform", description=_SUPPORT)
    center_of_mass: t.Point | None = Field(default=None, description="[x, y] in the object's frame")
    floor_friction: t.Friction | None = Field(default=None, description=FRICTION)
    offset: t.Coordinate | None = Field(default=None, description="a length in m")
    pose: t.Pose | None = Field(default=None, description="[x, y, theta] in the chain frame")


class ContactPair(t.Strict):
    """The friction between two objects, or between the pusher and an object."""

    objects: Annotated[tuple[str, ...], t.Several(2, 2)] = Field(
        description="two names of objects that touch, e.g. [near, far], or pusher and an object"
    )
    friction: t.Friction = Field(description=FRICTION)


class Contacts(t.Strict):
    """Friction where objects touch each other."""

    friction: t.Friction | None = Field(default=None, description=FRICTION)
    between: Annotated[tuple[ContactPair, ...], t.Several(0, 400)] = Field(
        default=(), description="a list of {objects: [a, b], friction: ...}"
    )


class Differential(t.Strict):
    """Two driven wheels on one axle."""

    axle: t.Pose = Field(description=_AXLE)


class Car(t.Strict):
    """A rear axle that follows and front wheels that steer."""

    axle: t.Pose = Field(description=_AXLE)
    min_radius: t.Size = Field(description="the smallest turning radius of the axle's middle, a length in m")


class WheeledDrive(t.Strict):
    """A drive with wheels that roll without slipping sideways."""

    model_config = t.exactly_one("differential", "car")

    differential: Differential | None = Field(default=None, description="{axle: [x, y, theta]}")
    car: Car | None = Field(default=None, description="{axle: [x, y, theta], min_radius: ...}")

    @model_validator(mode="after")
    def _one(self) -> WheeledDrive:
        t.require_one(self, "differential", "car")
        return self


Drive = Annotated[
    Annotated[Literal["omnidirectional"], Tag("<word>")] | Annotated[WheeledDrive, Tag("<mapping>")],
    Discriminator(_word_or_mapping),
]


class MotionLimits(t.Strict):
    """What the pusher's motion may not exceed."""

    speed: t.Speed = Field(default=_LIMITS.speed, description="a speed in m/s, or [least, most]")
    acceleration: t.Acceleration = Field(
        default=_LIMITS.acceleration, description="an acceleration in m/s^2, or [least, most]"
    )
    jerk: t.Jerk = Field(default=_LIMITS.jerk, description="a jerk in m/s^3")
    angular_speed: t.AngularSpeed = Field(
        default=_LIMITS.angular_speed, description="an angular speed in rad/s, or [least, most]"
    )
    angular_acceleration: t.AngularAcceleration = Field(
        default=_LIMITS.angular_acceleration,
        description="an angular acceleration in rad/s^2, or [least, most]",
    )
    angular_jerk: t.AngularJerk = Field(
        default=_LIMITS.angular_jerk, description="an angular jerk in rad/s^3"
    )
    contact: Literal[names.CONTACT_LIMITS] = Field(  # type: ignore[valid-type]
        default=_LIMITS.contact, description="one of " + ", ".join(names.CONTACT_LIMITS)
    )


Faces = Annotated[
    Annotated[Literal["all"], Tag("<word>")]
    | Annotated[Annotated[tuple[t.Face, ...], t.Several(1, 100)], Tag("<list>")],
    Discriminator(lambda value: "<list>" if isinstance(value, list | tuple) else "<word>"),
]


class Plate(t.Strict):
    """The plate and the robot that carries it."""

    width: t.Size = Field(description="a length in m")
    thickness: t.Size = Field(default=0.03, description="a length in m")
    friction: t.Friction = Field(description=FRICTION)
    contact_height: t.Height = Field(default=0.0, description="a height in m")
    drive: Drive = Field(default="omnidirectional", description=DRIVE)
    faces: Faces | None = Field(default=None, description=FACES)
    offsets: Annotated[tuple[t.Coordinate, ...], t.Several(1, 20)] | None = Field(
        default=None, description="a list of 1 to 20 lengths in m, e.g. [0, 15 mm]"
    )
    limits: MotionLimits = Field(
        default_factory=MotionLimits,
        description="{speed: ..., acceleration: ..., jerk: ..., ...}",
    )
