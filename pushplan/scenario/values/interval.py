"""Numbers in files that may be written as an interval of values: `[lowest, highest]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from pushplan.scenario.values.quantity import Quantity, fault, show

Span = tuple[float, float]
"""Lowest and highest value."""


@dataclass(frozen=True)
class OrInterval:
    """A quantity, or the lowest and the highest value that it may have; put beside `float | Span`.

    Attributes:
        number: What may be written for a single number.
        end: Likewise for the ends of an interval; None stands for `number`.
    """

    number: Quantity
    end: Quantity | None = None

    def read(self, value: Any) -> float | Span:
        """Return the number, or the ends of the interval, in SI.

        Raises:
            PydanticCustomError: When `value` is neither.
        """
        if not isinstance(value, list | tuple):
            return self.number.read(value)
        ends = self.end or self.number
        if len(value) != 2:
            raise fault(show(value), f"{ends.allowed}, or an interval [lowest, highest] of it")
        low, high = (ends.read(number) for number in value)
        if not low <= high:
            raise fault(
                f"is the interval [{low:.9g}, {high:.9g}]", "[lowest, highest] with lowest <= highest"
            )
        return low, high

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        one = self.number.__get_pydantic_json_schema__(schema, handler)
        end = (self.end or self.number).__get_pydantic_json_schema__(schema, handler)
        return {"anyOf": [one, {"type": "array", "items": end, "minItems": 2, "maxItems": 2}]}


def lowest(value: float | Span) -> float:
    """Return a number, or the lower end of an interval."""
    return value[0] if isinstance(value, tuple) else value


def highest(value: float | Span) -> float:
    """Return a number, or the upper end of an interval."""
    return value[1] if isinstance(value, tuple) else value


def middle(value: float | Span) -> float:
    """Return a number, or the middle of an interval."""
    return 0.5 * (value[0] + value[1]) if isinstance(value, tuple) else value
