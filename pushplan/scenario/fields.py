"""Building blocks of the file formats: quantities with their ranges, points, poses, polygons and names."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    StringConstraints,
    Tag,
    WithJsonSchema,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from pushplan.geometry.polygon import find_flaw
from pushplan.scenario import units
from pushplan.scenario.units import OrWord, Quantity, Span, either_way, fault, friction, or_interval, show
from pushplan.util import names
from pushplan.util.names import FACES

MOST_CORNERS = 500

Coordinate = Annotated[float, Quantity("a coordinate", units.LENGTH, -names.FARTHEST, names.FARTHEST, "5 mm")]
Size = Annotated[float, Quantity("a length", units.LENGTH, 1e-3, 1e3, "5 mm")]
Clearance = Annotated[float, Quantity("a length", units.LENGTH, 1e-4, 10.0, "5 mm")]
Height = Annotated[float | Span, or_interval(Quantity("a height", units.LENGTH, 0.0, 100.0, "5 mm"))]
Travel = Annotated[float, Quantity("a length", units.LENGTH, 1e-3, 10.0, "50 mm")]
ArcPrice = Annotated[float, Quantity("a length", units.LENGTH, 0.0, 100.0, "30 mm")]
PositionTolerance = Annotated[float, Quantity("a length", units.LENGTH, 1e-9, 1.0, "2 mm")]
SnapDistance = Annotated[float, Quantity("a length", units.LENGTH, 1e-6, 0.1, "5 mm")]
Angle = Annotated[float, Quantity("an angle", units.ANGLE, -10.0, 10.0, "90 deg")]
"""The range excludes most angles in degrees without a unit, so that they are not read as radians."""
AngleTolerance = Annotated[float, Quantity("an angle", units.ANGLE, 1e-9, math.pi, "0.2 deg")]
SnapAngle = Annotated[float, Quantity("an angle", units.ANGLE, 0.0, math.radians(20.0), "2 deg")]
Mass = Annotated[float | Span, or_interval(Quantity("a mass", units.MASS, 1e-6, 1e6, "800 g"))]
Duration = Annotated[float, Quantity("a time", units.TIME, 1e-3, 86400.0, "500 ms")]
Friction = Annotated[float | Span, or_interval(friction(0.0))]
FloorFriction = Annotated[float | Span, or_interval(friction(1e-3))]
_LOAD = Quantity("a part of the load", units.FRACTION, 1e-6, 1.0, "25 %")
LoadFraction = Annotated[float | Span, or_interval(_LOAD, replace(_LOAD, low=0.0))]
Margin = Annotated[float | Literal["auto"], OrWord(Quantity("auto, or a margin", {}, 0.0, 0.99))]
Weight = Annotated[float, Quantity("a weight", {}, 0.0, 1000.0)]
Gap = Annotated[float, Quantity("a share", units.FRACTION, 0.0, 100.0, "1 %")]
Share = Annotated[float, Quantity("a share", units.FRACTION, 0.0, 0.9, "20 %")]
Face = Annotated[
    float | str, OrWord(Quantity(f"{', '.join(FACES)}, or an angle", units.ANGLE, -10.0, 10.0, "120 deg"), FACES)
]
Most = Annotated[int, Quantity("a whole number", {}, 1, 100, whole=True)]
Symmetry = Annotated[int, Quantity("a whole number", {}, 1, 360, whole=True)]
Seed = Annotated[int, Quantity("a whole number", {}, 0, 2**31 - 1, whole=True)]
Force = Annotated[float, Quantity("a force", units.FORCE, 1e-3, 1e6, "40 N")]
Breakaway = Annotated[float, Quantity("a factor", {}, 1.0, 10.0)]
Speed = Annotated[float | Span, either_way(Quantity("a speed", units.SPEED, 1e-4, 100.0, "0.2 m/s"))]
Acceleration = Annotated[
    float | Span, either_way(Quantity("an acceleration", units.ACCELERATION, 1e-4, 1e3, "0.5 m/s^2"))
]
Jerk = Annotated[float, Quantity("a jerk", units.JERK, 1e-4, 1e5, "5 m/s^3")]
AngularSpeed = Annotated[
    float | Span, either_way(Quantity("an angular speed", units.ANGULAR_SPEED, 1e-4, 100.0, "60 deg/s"))
]
AngularAcceleration = Annotated[
    float | Span, either_way(Quantity("an angular acceleration", units.ANGULAR_ACCELERATION, 1e-4, 1e3, "90 deg/s^2"))
]
AngularJerk = Annotated[float, Quantity("an angular jerk", units.ANGULAR_JERK, 1e-4, 1e5, "900 deg/s^3")]


def _row(form: str, or_else: str = "") -> BeforeValidator:
    """Return a validator of lists with one value for each name in `form`, e.g. `[x, y, theta]`."""

    def read(value: Any) -> Any:
        if not isinstance(value, list) or len(value) != form.count(",") + 1:
            raise fault(show(value), form + or_else)
        return value

    return BeforeValidator(read)


Point = Annotated[tuple[Coordinate, Coordinate], _row("[x, y]")]
FlatCenter = Annotated[tuple[Coordinate, Coordinate], _row("[x, y]", " or [x, y, z]")]
HighCenter = Annotated[tuple[Coordinate, Coordinate, Size], _row("[x, y, z]")]
MassCenter = Annotated[
    Annotated[FlatCenter, Tag("<flat>")] | Annotated[HighCenter, Tag("<high>")],
    Discriminator(lambda point: "<high>" if isinstance(point, list | tuple) and len(point) == 3 else "<flat>"),
]
Pose = Annotated[tuple[Coordinate, Coordinate, Angle], _row("[x, y, theta]")]
Box = Annotated[tuple[Size, Size], _row("[length along x, width along y]")]
BareFoot = Annotated[tuple[Coordinate, Coordinate], _row("[x, y]", " or [x, y, load]")]
LoadedFoot = Annotated[tuple[Coordinate, Coordinate, LoadFraction], _row("[x, y, load]")]
Foot = Annotated[
    Annotated[BareFoot, Tag("<bare>")] | Annotated[LoadedFoot, Tag("<loaded>")],
    Discriminator(lambda foot: "<loaded>" if isinstance(foot, list | tuple) and len(foot) == 3 else "<bare>"),
]


def _interval(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise fault(f"is [{ends[0]:.9g}, {ends[1]:.9g}]", "[min, max] with min < max")
    return ends


Interval = Annotated[tuple[Coordinate, Coordinate], _row("[min, max]"), AfterValidator(_interval)]


@dataclass(frozen=True)
class Several:
    """Requires a list of `low` to `high` values; it annotates a tuple type.

    It checks the length of the list in the file, whereas pydantic's own limits count the validated values.
    """

    low: int
    high: int

    def read(self, value: Any) -> Any:
        """Return `value` if it is a list of the required length."""
        if not isinstance(value, list) or not self.low <= len(value) <= self.high:
            raise PydanticCustomError(units.DESCRIBED_FAULT, "{text}", {"text": show(value)})
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return handler(schema) | {"minItems": self.low, "maxItems": self.high}


def _simple(corners: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    flaw = find_flaw(np.array(corners))
    if flaw is not None:
        raise fault(flaw, "a polygon that does not touch itself, its corners in order")
    return corners


Polygon = Annotated[tuple[Point, ...], Several(3, MOST_CORNERS), AfterValidator(_simple)]

# The length is checked separately: with `{0,63}` in the pattern, its compilation takes 35 ms of every command.
NAME_PATTERN, MOST_LETTERS = r"^[^\W_][\w .-]*$", 64

# Editors read `\w` as ASCII, so their pattern excludes the ASCII characters that are not letters or digits.
_NAME_IN_EDITORS = r"^[^\x00-/:-@\[-`{-\x7f\ud800-\udfff][^\x00-\x1f!-,/:-@\[-^`{-\x7f\ud800-\udfff]{0,63}$"

Name = Annotated[
    str,
    StringConstraints(strict=True, pattern=NAME_PATTERN, max_length=MOST_LETTERS),
    WithJsonSchema({"type": "string", "pattern": _NAME_IN_EDITORS}),
]
FileName = Annotated[str, StringConstraints(strict=True, min_length=1)]


class Strict(BaseModel):
    """A mapping without unknown keys."""

    # The validator of a part is built within that of the file. Building it alone as well would double the time.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


def with_defaults(part: type[Strict], description: str) -> Any:
    """Return the field of an optional part; its defaults need no validation."""
    return Field(default_factory=part.model_construct, description=description)


def still_here(name: Any) -> Any:
    """Return the name of a planner.

    Raises:
        PydanticCustomError: If the planner was removed; the message names the replacement.
    """
    if isinstance(name, str) and name in names.GONE_PLANNERS:
        what, instead = names.GONE_PLANNERS[name]
        raise fault(f"is '{name}', which is {what}", instead)
    return name


def one_or_list(value: object) -> str:
    """Return the tag of a value in a union of `<one>` and `<list>`."""
    return "<list>" if isinstance(value, list | tuple) else "<one>"


def by_key(*keys: str) -> Discriminator:
    """Return the discriminator of several forms of a mapping: each has one key of its own, and the tag `<key>`.

    A value that is not a mapping has the tag `<word>`.
    """

    def form(value: object) -> str | None:
        if isinstance(value, BaseModel):
            value = dict(value)
        if not isinstance(value, dict):
            return "<word>"
        given = [key for key in keys if value.get(key) is not None]
        return f"<{given[0]}>" if len(given) == 1 else None

    return Discriminator(form)
