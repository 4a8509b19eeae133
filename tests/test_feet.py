"""Feet that stand for a pressure: positive, inside, with the same moments and the same friction."""

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.errors import SupportError
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.contacts import friction_wrench
from pushplan.mechanics.sphere import twists_about
from pushplan.mechanics.support import (
    FeetSupport,
    Support,
    UniformSupport,
    UnknownSupport,
)
from pushplan.sim.feet import DEGREE, feet_of, polygon_rule
from pushplan.util.arrays import FloatArray

BOX = np.array([[-0.05, -0.03], [0.05, -0.03], [0.05, 0.03], [-0.05, 0.03]])


def outlines(make_chain: ChainMaker) -> list[FloatArray]:
    """A box and stars with up to nine corners, not convex."""
    return [BOX, *(make_chain.star(np.random.default_rng(seed), 3 + seed) for seed in range(7))]


def test_the_rule_on_a_polygon_has_its_area_centroid_and_second_moments(make_chain: ChainMaker) -> None:
    for outline in outlines(make_chain):
        moments = UniformSupport(outline).moments
        rule = polygon_rule(outline, 2)
        assert rule.weights.sum() == pytest.approx(moments.area, rel=1e-12)
        np.testing.assert_allclose(rule.weights @ rule.points / moments.area, moments.centroid, atol=1e-15)
        offsets = rule.points - moments.centroid
        np.testing.assert_allclose(
            (offsets * rule.weights[:, None]).T @ offsets, moments.second, rtol=1e-10, atol=1e-18
        )


def test_feet_have_the_moments_of_the_pressure_up_to_their_degree() -> None:
    """Against a much finer rule, monomial by monomial."""
    fine = polygon_rule(BOX, 12)
    feet = feet_of(UniformSupport(BOX))
    for i in range(DEGREE + 1):
        for j in range(DEGREE + 1 - i):
            want = fine.weights @ np.prod(fine.points ** [i, j], axis=1) / fine.weights.sum()
            have = feet.fractions @ np.prod(feet.positions ** [i, j], axis=1)
            assert have == pytest.approx(want, abs=1e-12 * 0.05 ** (i + j))


@pytest.mark.parametrize("center", [None, np.array([0.008, -0.004])])
def test_friction_on_the_feet_is_that_of_the_pressure(center: FloatArray | None) -> None:
    """The wrench at centres of rotation around the footprint, twice as far out as its corners."""
    support = UniformSupport(BOX, center)
    feet = feet_of(support)
    angle = np.linspace(-np.pi, np.pi, 40)
    twists = twists_about(0.12 * np.stack([np.cos(angle), np.sin(angle)], axis=1), +1)
    wrenches = [
        friction_wrench(PushedObject("box", BOX, 1.0, 0.3, each, np.zeros(3)), twists)
        for each in (support, FeetSupport(feet.positions, feet.fractions))
    ]
    np.testing.assert_allclose(wrenches[1], wrenches[0], atol=3e-6)


@pytest.mark.parametrize("support", [UnknownSupport(BOX), FeetSupport(BOX, None, np.zeros(2))])
def test_unknown_loads_are_refused(support: Support) -> None:
    with pytest.raises(SupportError, match="needs to know how the load rests on the floor"):
        feet_of(support)
