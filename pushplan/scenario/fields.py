"""The building blocks of the file formats: quantities with their ranges, points, poses, polygons, names."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np

from pushplan.geometry.polygon import find_flaw
from pushplan.scenario import units
from pushplan.scenario.records import After, Before, Chosen, Record, Several
from pushplan.scenario.units import (
    NotAllowedError,
    OrWord,
    Quantity,
    Span,
    Stated,
    either_way,
    friction,
    or_interval,
    show,
)
from pushplan.util import names
from pushplan.util.names import FACES

MOST_CORNERS = 500

Coordinate = Annotated[float, Quantity("a coordinate", units.LENGTH, -1e4, 1e4, "5 mm")]
Size = Annotated[float, Quantity("a length", units.LENGTH, 1e-3, 1e3, "5 mm")]
Clearance = Annotated[float, Quantity("a length", units.LENGTH, 1e-4, 10.0, "5 mm")]
Height = Annotated[float | Span, or_interval(Quantity("a height", units.LENGTH, 0.0, 100.0, "5 mm"))]
Travel = Annotated[float, Quantity("a length", units.LENGTH, 1e-3, 10.0, "50 mm")]
ArcPrice = Annotated[float, Quantity("a length", units.LENGTH, 0.0, 100.0, "30 mm")]
PositionTolerance = Annotated[float, Quantity("a length", units.LENGTH, 1e-9, 1.0, "2 mm")]
SnapDistance = Annotated[float, Quantity("a length", units.LENGTH, 1e-6, 0.1, "5 mm")]
Angle = Annotated[float, Quantity("an angle", units.ANGLE, -10.0, 10.0, "90 deg")]
"""Degrees without their unit are mostly out of this range, and so are not taken for radians."""
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
    float | str,
    OrWord(Quantity(f"{', '.join(FACES)}, or an angle", units.ANGLE, -10.0, 10.0, "120 deg"), FACES),
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
    float | Span,
    either_way(Quantity("an angular acceleration", units.ANGULAR_ACCELERATION, 1e-4, 1e3, "90 deg/s^2")),
]
AngularJerk = Annotated[float, Quantity("an angular jerk", units.ANGULAR_JERK, 1e-4, 1e5, "900 deg/s^3")]


def _row(form: str, or_else: str = "") -> Before:
    """Return the validator of a list with one value for each word in `form`, e.g. `[x, y, theta]`."""

    def read(value: Any) -> Any:
        if not isinstance(value, list) or len(value) != form.count(",") + 1:
            raise NotAllowedError(show(value), form + or_else)
        return value

    return Before(read)


Point = Annotated[tuple[Coordinate, Coordinate], _row("[x, y]")]
FlatCenter = Annotated[tuple[Coordinate, Coordinate], _row("[x, y]", " or [x, y, z]")]
HighCenter = Annotated[tuple[Coordinate, Coordinate, Size], _row("[x, y, z]")]
MassCenter = Annotated[
    FlatCenter | HighCenter, Chosen(lambda point: int(isinstance(point, list) and len(point) == 3))
]
Pose = Annotated[tuple[Coordinate, Coordinate, Angle], _row("[x, y, theta]")]
Box = Annotated[tuple[Size, Size], _row("[length along x, width along y]")]
BareFoot = Annotated[tuple[Coordinate, Coordinate], _row("[x, y]", " or [x, y, load]")]
LoadedFoot = Annotated[tuple[Coordinate, Coordinate, LoadFraction], _row("[x, y, load]")]
Foot = Annotated[BareFoot | LoadedFoot, Chosen(lambda foot: int(isinstance(foot, list) and len(foot) == 3))]


def _interval(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise NotAllowedError(f"is [{ends[0]:.9g}, {ends[1]:.9g}]", "[min, max] with min < max")
    return ends


Interval = Annotated[tuple[Coordinate, Coordinate], _row("[min, max]"), After(_interval)]


def _simple(corners: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    flaw = find_flaw(np.array(corners))
    if flaw is not None:
        raise NotAllowedError(flaw, "a polygon that does not touch itself, its corners in order")
    return corners


Polygon = Annotated[tuple[Point, ...], Several(3, MOST_CORNERS), After(_simple)]

NAME_PATTERN = r"^[^\W_][\w .-]{0,63}$"

# Editors read `\w` as ASCII, so that their pattern excludes what ASCII has beside letters and digits.
_NAME_IN_EDITORS = r"^[^\x00-/:-@\[-`{-\x7f\ud800-\udfff][^\x00-\x1f!-,/:-@\[-^`{-\x7f\ud800-\udfff]{0,63}$"


@dataclass(frozen=True)
class Text(Stated):
    """A text of at least one character, or one of a pattern, which editors know in their own form."""

    pattern: str = ""
    in_editors: str = ""

    def read(self, value: Any) -> str:
        """Return the text."""
        if not isinstance(value, str) or not value or (self.pattern and not re.search(self.pattern, value)):
            raise NotAllowedError(show(value))
        return value

    def schema(self) -> dict[str, Any]:
        """Return its JSON Schema."""
        return {
            "type": "string",
            **({"pattern": self.in_editors} if self.in_editors else {"minLength": 1}),
        }


Name = Annotated[str, Text(NAME_PATTERN, _NAME_IN_EDITORS)]
FileName = Annotated[str, Text()]


def still_here(name: Any) -> Any:
    """Return the name of a planner, but of one that went to the benchmarks.

    Raises:
        NotAllowedError: With what to write instead.
    """
    if name in names.MOVED_PLANNERS and name not in names.PLANNERS:
        raise NotAllowedError(
            f"is '{name}', a baseline that is in the benchmarks now",
            f"{names.DEFAULT_PLANNER}, or where a module:attribute is allowed, that of the benchmark",
        )
    return name


def require_one(record: Record, *keys: str) -> None:
    """Refuse a record unless exactly one of `keys` is given."""
    given = [key for key in keys if getattr(record, key) is not None]
    if len(given) != 1:
        found = f"has {' and '.join(given)}" if given else f"has none of {', '.join(keys)}"
        raise NotAllowedError(found, f"exactly one of {', '.join(keys)}")
