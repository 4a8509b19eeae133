"""Numbers in files: a dimension, a range, and a sentence for whoever writes something else."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from pushplan.scenario.values.units import ANGLE, NUMBER_PATTERN, dimension_of, split_unit
from pushplan.scenario.yaml.node import shorten
from pushplan.util.names import AUTO, MOST_FRICTION

FAULT = "pushplan"
"""Type of the validation errors whose message is already a sentence for people."""

DESCRIBED_FAULT = "pushplan-described"
"""Type of those whose message says what was found; the field's description says what is allowed."""


def fault(found: str, allowed: str) -> PydanticCustomError:
    """Return the error that says what was found and what is allowed."""
    return PydanticCustomError(FAULT, "{text}", {"text": f"{found}; allowed: {allowed}"})


def show(value: object) -> str:
    """Return a value from a file as a message names it."""
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


@dataclass(frozen=True)
class Quantity:
    """A number within a range, plain in SI or as text with a unit; put beside `float` in an annotation.

    Attributes:
        noun: What it is, e.g. `a length`.
        units: Units that a text may carry, as factors to SI; the first is the one of plain numbers.
        low: Smallest value.
        high: Largest value.
        example: Text shown to those who write something else.
        whole: Only whole numbers are allowed.
        tangent: The units are those of an angle whose tangent is meant (a friction angle).
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
        """What may be written, in words."""
        first = next(iter(self.units), "")
        unit = f" in {first}" if self.units.get(first) == 1.0 and not self.tangent else ""
        form = "a friction angle" if self.tangent else "with a unit"
        text = f', or {form}, e.g. "{self.example}"' if self.example else ""
        return f"{self.noun}{unit} from {self.low:.12g} to {self.high:.12g}{text}"

    def read(self, value: object) -> float:
        """Return the number in SI.

        Raises:
            PydanticCustomError: When `value` is not such a quantity.
        """
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
        return number

    def _from_text(self, text: str) -> float:
        parts = split_unit(text)
        if parts is None:
            raise fault(show(text), self.allowed)
        number, unit = parts
        if unit not in self.units:
            kind = dimension_of(unit)
            found = (
                f"has the unknown unit '{shorten(unit)}'" if kind is None else f"'{shorten(text)}' is {kind}"
            )
            raise fault(found, self.allowed)
        value = number * self.units[unit]
        if not self.tangent:
            return value
        if not 0.0 <= value < math.pi / 2.0:
            raise fault(f"'{shorten(text)}' is no friction angle", "an angle from 0 to less than 90 deg")
        return math.tan(value)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        number: dict[str, Any] = {"type": "integer" if self.whole else "number"}
        number |= {"minimum": self.low, "maximum": self.high}
        if not self.units:
            return number
        units = "|".join(unit.replace("^", r"\^") for unit in self.units)
        text = {"type": "string", "pattern": rf"^\s*{NUMBER_PATTERN}\s*({units})\s*$"}
        return {"anyOf": [number, text]}


@dataclass(frozen=True)
class OrAuto:
    """A quantity, or a word; put beside `float | Literal["auto"]` in an annotation.

    Attributes:
        number: The quantity; its name tells of the words, too.
        words: That may stand in its place.
    """

    number: Quantity
    words: tuple[str, ...] = (AUTO,)

    def read(self, value: object) -> object:
        """Return the number in SI, or a word.

        Raises:
            PydanticCustomError: When `value` is neither.
        """
        return value if value in self.words else self.number.read(value)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {
            "anyOf": [
                *({"const": word} for word in self.words),
                self.number.__get_pydantic_json_schema__(schema, handler),
            ]
        }


@dataclass(frozen=True)
class EitherWay:
    """A quantity above 0 for both directions, or a list of the least, below 0, and the most for one direction each.

    Put beside `float | tuple[float, float]` in an annotation.

    Attributes:
        number: The quantity for both.
    """

    number: Quantity

    @property
    def _ends(self) -> tuple[Quantity, Quantity]:
        return replace(self.number, low=-self.number.high, high=-self.number.low), self.number

    def read(self, value: object) -> float | tuple[float, float]:
        """Return the number, or both, in SI.

        Raises:
            PydanticCustomError: When `value` is neither.
        """
        if not isinstance(value, list | tuple):
            return self.number.read(value)
        if len(value) != 2:
            raise fault(show(value), f"{self.number.allowed}, or [least, most], the least below 0")
        least, most = (end.read(item) for end, item in zip(self._ends, value, strict=True))
        return least, most

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        ends = [end.__get_pydantic_json_schema__(schema, handler) for end in self._ends]
        pair = {"type": "array", "prefixItems": ends, "minItems": 2, "maxItems": 2}
        return {"anyOf": [self.number.__get_pydantic_json_schema__(schema, handler), pair]}


def friction(low: float) -> Quantity:
    """Return the quantity of a friction coefficient, which may be written as a friction angle."""
    return Quantity("a friction coefficient", ANGLE, low, MOST_FRICTION, "14 deg", tangent=True)
