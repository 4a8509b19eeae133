"""Numbers in files: plain in SI or with a unit, limited to a range, with messages for all other values."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from pushplan.scenario.source import shorten
from pushplan.util.names import AUTO, MOST_FRICTION

Span = tuple[float, float]
"""Lowest and highest value."""

_POWERS = {1: ("",), 2: ("^2", "2", "²"), 3: ("^3", "3", "³")}


def _rates(units: Mapping[str, float], order: int) -> dict[str, float]:
    return {f"{unit}/s{power}": factor for unit, factor in units.items() for power in _POWERS[order]}


# Units of numbers with their factors to SI; the first is the unit of plain numbers.
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048}
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "°": math.pi / 180.0}
MASS = {"kg": 1.0, "g": 1e-3, "t": 1e3, "lb": 0.45359237}
TIME = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
FRACTION = {"%": 0.01}
FORCE = {"N": 1.0, "kN": 1e3, "mN": 1e-3, "lbf": 4.4482216152605, "kgf": 9.80665}
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
    "a force": FORCE,
    "a speed": SPEED,
    "an acceleration": ACCELERATION,
    "a jerk": JERK,
    "an angular speed": ANGULAR_SPEED,
    "an angular acceleration": ANGULAR_ACCELERATION,
    "an angular jerk": ANGULAR_JERK,
}

_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_WITH_UNIT = re.compile(rf"\s*({_NUMBER})\s*([^\s0-9.+-]\S*)\s*")

FAULT = "pushplan"
"""Type of validation errors with a complete message."""

DESCRIBED_FAULT = "pushplan-described"
"""Type of validation errors whose message names only the value; the field's description names the allowed values."""


def fault(found: str, allowed: str) -> PydanticCustomError:
    """Return an error with the value and the allowed values."""
    return PydanticCustomError(FAULT, "{text}", {"text": f"{found}; allowed: {allowed}"})


def show(value: object) -> str:
    """Return the description of a value for a message."""
    match value:
        case None:
            return "is empty"
        case bool():
            return f"is {str(value).lower()}"
        case int() | float():
            return f"is {value:.12g}"
        case str():
            return f"is the text '{shorten(value)}'"
        case dict():
            return "is a mapping"
    return f"is a list of {len(value)}" if isinstance(value, list | tuple) else f"is a {type(value).__name__}"


class Stated(ABC):
    """Notation of a value in a file; it annotates the value's type."""

    @abstractmethod
    def read(self, value: Any) -> Any:
        """Return the value in SI.

        Raises:
            PydanticCustomError: If `value` does not follow the notation.
        """

    @abstractmethod
    def schema(self) -> dict[str, Any]:
        """Return its JSON Schema."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        # The result of `read` is valid; otherwise pydantic would build and run a validator of its type.
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return self.schema()


@dataclass(frozen=True)
class Quantity(Stated):
    """A number within a range, plain in SI or as text with a unit.

    Attributes:
        noun: Noun for the quantity, e.g. `a length`.
        units: Allowed units of a text.
        low: Smallest value.
        high: Largest value.
        example: Example of a text, for messages.
        whole: Whether only whole numbers are allowed.
        tangent: Whether the units are of a friction angle, whose tangent is the value.
    """

    noun: str
    units: Mapping[str, float] = field(default_factory=dict, hash=False)
    low: float = -math.inf
    high: float = math.inf
    example: str = ""
    whole: bool = False
    tangent: bool = False

    @property
    def allowed(self) -> str:
        """Description of the allowed values."""
        first = next(iter(self.units), "")
        unit = f" in {first}" if self.units.get(first) == 1.0 and not self.tangent else ""
        form = "a friction angle" if self.tangent else "with a unit"
        text = f', or {form}, e.g. "{self.example}"' if self.example else ""
        return f"{self.noun}{unit} from {self.low:.12g} to {self.high:.12g}{text}"

    def read(self, value: Any) -> float:
        """Return the number in SI."""
        if isinstance(value, str):
            number = self._from_text(value)
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise fault(show(value), self.allowed)
        else:
            number = float(value)
        if not math.isfinite(number):
            raise fault(f"{show(value)}, which is not finite", self.allowed)
        if not self.low <= number <= self.high or (self.whole and not number.is_integer()):
            raise fault(f"is '{shorten(value)}'" if isinstance(value, str) else show(value), self.allowed)
        return int(number) if self.whole else number

    def _from_text(self, text: str) -> float:
        match = _WITH_UNIT.fullmatch(text)
        if match is None:
            raise fault(show(text), self.allowed)
        number, unit = float(match[1]), match[2]
        if unit not in self.units:
            kind = next((name for name, units in DIMENSIONS.items() if unit in units), None)
            unknown = f"has the unknown unit '{shorten(unit)}'"
            raise fault(unknown if kind is None else f"'{shorten(text)}' is {kind}", self.allowed)
        value = number * self.units[unit]
        if not self.tangent:
            return value
        if not 0.0 <= value < math.pi / 2.0:
            raise fault(f"'{shorten(text)}' is not a friction angle", "an angle from 0 to less than 90 deg")
        return math.tan(value)

    def schema(self) -> dict[str, Any]:
        """Return its JSON Schema, which does not limit the range of a number with a unit."""
        kind = "integer" if self.whole else "number"
        number: dict[str, Any] = {"type": kind, "minimum": self.low, "maximum": self.high}
        if not self.units:
            return number
        units = "|".join(unit.replace("^", r"\^") for unit in self.units)
        return {"anyOf": [number, {"type": "string", "pattern": rf"^\s*{_NUMBER}\s*({units})\s*$"}]}


@dataclass(frozen=True)
class OrWord(Stated):
    """A quantity or one of several words; the noun of the quantity names the words."""

    number: Quantity
    words: tuple[str, ...] = (AUTO,)

    def read(self, value: Any) -> Any:
        """Return the number in SI, or the word."""
        return value if value in self.words else self.number.read(value)

    def schema(self) -> dict[str, Any]:
        """Return its JSON Schema."""
        return {"anyOf": [*({"const": word} for word in self.words), self.number.schema()]}


@dataclass(frozen=True)
class OrPair(Stated):
    """A quantity, or a list of two quantities.

    Attributes:
        number: The single quantity.
        low: First quantity of the list.
        high: Second quantity of the list.
        form: Description of the list.
        ordered: Whether the first must not exceed the second.
    """

    number: Quantity
    low: Quantity
    high: Quantity
    form: str
    ordered: bool = False

    def read(self, value: Any) -> float | Span:
        """Return the number or the two numbers in SI."""
        if not isinstance(value, list | tuple):
            return self.number.read(value)
        if len(value) != 2:
            raise fault(show(value), f"{self.high.allowed}, or {self.form}")
        low, high = self.low.read(value[0]), self.high.read(value[1])
        if self.ordered and not low <= high:
            what = f"is the interval [{low:.9g}, {high:.9g}]"
            raise fault(what, "[lowest, highest] with lowest <= highest")
        return low, high

    def schema(self) -> dict[str, Any]:
        """Return its JSON Schema."""
        ends = [self.low.schema(), self.high.schema()]
        items = {"items": ends[0]} if self.low == self.high else {"prefixItems": ends}
        pair = {"type": "array", **items, "minItems": 2, "maxItems": 2}
        return {"anyOf": [self.number.schema(), pair]}


def or_interval(number: Quantity, end: Quantity | None = None) -> OrPair:
    """Return the notation of a number or an interval [lowest, highest]; `end` is the quantity of the ends."""
    end = end or number
    return OrPair(number, end, end, "its interval [lowest, highest]", ordered=True)


def either_way(number: Quantity) -> OrPair:
    """Return the notation of one limit above 0 for both directions, or [least, most] with the least below 0."""
    least = replace(number, low=-number.high, high=-number.low)
    return OrPair(number, least, number, "[least, most], the least below 0")


def friction(low: float) -> Quantity:
    """Return the quantity of a friction coefficient, which can also be given as a friction angle."""
    return Quantity("a friction coefficient", ANGLE, low, MOST_FRICTION, "14 deg", tangent=True)


def lowest(value: float | Span) -> float:
    """Return a number, or the lower end of an interval."""
    return value[0] if isinstance(value, tuple) else value


def highest(value: float | Span) -> float:
    """Return a number, or the upper end of an interval."""
    return value[1] if isinstance(value, tuple) else value


def middle(value: float | Span) -> float:
    """Return a number, or the middle of an interval."""
    return 0.5 * (value[0] + value[1]) if isinstance(value, tuple) else value
