"""Units that a number in a file may carry, by dimension, as factors to SI."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

_POWERS = {1: ("",), 2: ("^2", "2", "²"), 3: ("^3", "3", "³")}

LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048}
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "°": math.pi / 180.0}
MASS = {"kg": 1.0, "g": 1e-3, "t": 1e3, "lb": 0.45359237}
TIME = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
FRACTION = {"%": 0.01}


def _rates(units: Mapping[str, float], order: int) -> dict[str, float]:
    return {f"{unit}/s{power}": factor for unit, factor in units.items() for power in _POWERS[order]}


SPEED = _rates(LENGTH, 1) | {"km/h": 1.0 / 3.6}
ACCELERATION = _rates(LENGTH, 2)
JERK = _rates(LENGTH, 3)
ANGULAR_SPEED = _rates(ANGLE, 1) | {"rpm": math.pi / 30.0}
ANGULAR_ACCELERATION = _rates(ANGLE, 2)
ANGULAR_JERK = _rates(ANGLE, 3)

DIMENSIONS: dict[str, Mapping[str, float]] = {
    "a length": LENGTH,
    "an angle": ANGLE,
    "a mass": MASS,
    "a time": TIME,
    "a fraction": FRACTION,
    "a speed": SPEED,
    "an acceleration": ACCELERATION,
    "a jerk": JERK,
    "an angular speed": ANGULAR_SPEED,
    "an angular acceleration": ANGULAR_ACCELERATION,
    "an angular jerk": ANGULAR_JERK,
}

NUMBER_PATTERN = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_WITH_UNIT = re.compile(rf"\s*({NUMBER_PATTERN})\s*([^\s0-9.+-]\S*)\s*")


def split_unit(text: str) -> tuple[float, str] | None:
    """Return number and unit of a text such as `90 deg`, or None when it is no such text."""
    match = _WITH_UNIT.fullmatch(text)
    return None if match is None else (float(match[1]), match[2])


def dimension_of(unit: str) -> str | None:
    """Return what `unit` measures, e.g. `an angle`, or None when the unit is not known."""
    return next((name for name, units in DIMENSIONS.items() if unit in units), None)
