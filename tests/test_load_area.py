"""What is known of a load: where it may rest, how far a push above the floor moves it, and what supports hold."""

import re

import numpy as np
import pytest

from pushplan.errors import SupportError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.support import (
    Support,
    UniformSupport,
    UnknownSupport,
)
from pushplan.mechanics.uncertain import load_area
from pushplan.util.arrays import FloatArray

BOX = np.array([[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]])
POSE = np.array([0.5, 0.1, 0.7])


def resting(support: Support, friction: float = 0.5) -> PushedObject:
    return PushedObject("box", BOX, 2.0, friction, support, POSE)


def test_a_push_above_the_floor_moves_the_load_until_it_tips() -> None:
    """The box tips over its short side, 0.1 m off the middle, at height 0.1 / mu = 0.2 m."""
    obj = resting(UnknownSupport(BOX))
    assert load_area(obj, 0.06).shift == pytest.approx(0.03)
    assert load_area(obj, 0.2).shift == pytest.approx(0.1)
    text = (
        "a push at height 0.21 m could tip 'box': the load's centre moves by up to 0.105 m and is 0.1 m inside the "
        "support; the contact height must be at most 0.2 m"
    )
    with pytest.raises(SupportError, match=f"^{re.escape(text)}$"):
        load_area(obj, 0.21)


@pytest.mark.parametrize("center", [None, [0.03, -0.01]])
def test_elements_of_an_affine_pressure_have_its_centre_and_spread(center: list[float] | None) -> None:
    given: FloatArray | None = None if center is None else np.array(center)
    away = np.array([0.3, 0.2])
    moved = BOX + away
    support = UniformSupport(moved, None if given is None else given + away)
    places, parts = support.elements(5000)
    places = transform_points(POSE, places)
    np.testing.assert_allclose(parts @ places, transform_points(POSE, support.center), atol=1e-5)
    assert len(places) == 5000
    spread = parts @ ((places - POSE[:2]) ** 2).sum(axis=1)
    turned = transform_points(-POSE * [0, 0, 1], places - POSE[:2])
    np.testing.assert_allclose(turned.min(axis=0), moved.min(axis=0) + 0.002, atol=1e-12)  # squares of 4 mm
    assert spread == pytest.approx(float(parts @ (turned**2).sum(axis=1)))
