"""Numbers with units: values, dimensions, ranges, and the sentences about wrong ones."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic_core import PydanticCustomError

from pushplan.scenario import units
from pushplan.scenario.units import Quantity, Stated, either_way, friction, or_interval

LENGTH = Quantity("a length", units.LENGTH, 1e-3, 1e3, "5 mm")
ANGLE = Quantity("an angle", units.ANGLE, -10.0, 10.0, "90 deg")


@pytest.mark.parametrize(
    ("quantity", "text", "value"),
    [
        (LENGTH, "5 mm", 0.005),
        (LENGTH, "5mm", 0.005),
        (LENGTH, " 2.5e1 cm ", 0.25),
        (LENGTH, "1 in", 0.0254),
        (LENGTH, 3, 3.0),
        (ANGLE, "90 deg", math.pi / 2),
        (ANGLE, "-45°", -math.pi / 4),
        (ANGLE, "500 mrad", 0.5),
        (friction(0.0), "45 deg", 1.0),
        (friction(0.0), "14 deg", math.tan(math.radians(14.0))),
        (friction(0.0), "0.1 rad", math.tan(0.1)),
        (friction(0.0), 0.25, 0.25),
        (Quantity("a speed", units.SPEED, 0.0, 10.0), "3.6 km/h", 1.0),
        (Quantity("a jerk", units.JERK, 0.0, 10.0), "500 mm/s^3", 0.5),
        (Quantity("an acceleration", units.ANGULAR_ACCELERATION, 0.0, 10.0), "180 deg/s²", math.pi),
        (Quantity("a speed", units.ANGULAR_SPEED, 0.0, 10.0), "60 rpm", 2.0 * math.pi),
        (Quantity("a mass", units.MASS, 0.0, 10.0), "800 g", 0.8),
        (Quantity("a time", units.TIME, 0.0, 100.0), "1 min", 60.0),
        (Quantity("a part", units.FRACTION, 0.0, 1.0), "25 %", 0.25),
    ],
)
def test_numbers_with_units_become_si(quantity: Quantity, text: object, value: float) -> None:
    assert quantity.read(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("quantity", "value", "found"),
    [
        (LENGTH, "90 deg", "'90 deg' is an angle"),
        (LENGTH, "5 mn", "has the unknown unit 'mn'"),
        (LENGTH, "1.2", "is the text '1.2'"),
        (LENGTH, 0, "is 0"),
        (LENGTH, "-5 mm", "is '-5 mm'"),
        (LENGTH, True, "is true"),
        (LENGTH, None, "is empty"),
        (LENGTH, [1.0], "is a list of 1"),
        (LENGTH, math.nan, "is nan, which is not finite"),
        (LENGTH, "1e999 m", "is the text '1e999 m', which is not finite"),
        (friction(0.0), "5 mm", "'5 mm' is a length"),
        (friction(0.0), "120 deg", "'120 deg' is no friction angle"),
        (Quantity("a number", {}, 0, 9, whole=True), 1.5, "is 1.5"),
        (or_interval(LENGTH), [2, 1], "is the interval [2, 1]"),
        (either_way(LENGTH), [1, 2], "is 1"),
    ],
)
def test_wrong_ones_are_named_with_what_is_allowed(quantity: Stated, value: object, found: str) -> None:
    with pytest.raises(PydanticCustomError) as caught:
        quantity.read(value)
    assert caught.value.message().startswith(f"{found}; allowed: ")


@given(st.floats(1e-3, 1e3), st.sampled_from(sorted(units.LENGTH)))
def test_a_unit_is_a_factor(value: float, unit: str) -> None:
    wide = Quantity("a length", units.LENGTH, 0.0, 1e9)
    assert wide.read(f"{value!r} {unit}") == value * units.LENGTH[unit]
