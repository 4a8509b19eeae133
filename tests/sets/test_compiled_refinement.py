"""Boundaries found in compiled code against those found from nothing but a margin function."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from pushplan.mechanics.sphere import twists_at
from pushplan.stable_sets.boundary.refined_meridians import RefinedMeridians
from pushplan.stable_sets.cor.cor_region import cor_polygons
from pushplan.stable_sets.named import stable_set
from pushplan.stable_sets.stable_set import StableSet

if TYPE_CHECKING:
    from conftest import ChainMaker


def from_margins(stable: StableSet, minimum: float) -> RefinedMeridians:
    """Return what the general search finds."""
    return StableSet._refine_meridians(stable, minimum)


@pytest.mark.parametrize("minimum", [0.0, 0.03])
@pytest.mark.parametrize(
    ("seed", "n", "tree", "feet"),
    [
        (0, 1, False, False),
        (1, 2, False, True),
        (2, 3, True, False),
        (3, 4, True, True),
        (4, 6, False, False),
    ],
)
def test_both_searches_find_the_same_set(
    make_chain: ChainMaker, seed: int, n: int, tree: bool, feet: bool, minimum: float
) -> None:
    stable = stable_set(make_chain.random(seed, n, tree=tree, feet=feet))
    length = stable.chain.characteristic_length
    found, expected = stable.refined_meridians(minimum), from_margins(stable, minimum)
    for sense in (+1, -1):
        one, other = (cor_polygons(each, length, sense, None) for each in (found, expected))
        assert one.symmetric_difference(other).area < 1e-5 * max(other.area, length**2)


@pytest.mark.parametrize("name", ["ecof", "robust"])
def test_ends_are_roots_of_the_margin(make_chain: ChainMaker, name: str) -> None:
    """Inside by less than 2e-12 rad, on every one of the meridians."""
    stable = stable_set(make_chain.random(6, 2), name)
    rows, length = stable.refined_meridians().meridians, stable.chain.characteristic_length
    assert len(rows) > 100
    for ends, outward in ((rows.lower, -2e-12), (rows.upper, +2e-12)):
        assert (stable.margin(twists_at(rows.longitude, ends, length)) > 0.0).all()
        assert (stable.margin(twists_at(rows.longitude, ends + outward, length)) <= 0.0).all()


@pytest.mark.parametrize("name", ["ecof", "robust"])
def test_great_circles_between_meridians_stay_on_the_boundary(make_chain: ChainMaker, name: str) -> None:
    """To 3e-6 rad, where the set is wider than a ten-thousandth; there is one interval on every meridian."""
    stable = stable_set(make_chain.boxes(3), name)
    refined, length = stable.refined_meridians(), stable.chain.characteristic_length
    rows = refined.meridians
    assert (np.diff(rows.longitude) > 0.0).all()
    wide = rows.upper - rows.lower > 1e-4
    wide = wide[:-1] & wide[1:]
    a, b = rows.longitude[:-1][wide], rows.longitude[1:][wide]
    for share in (0.25, 0.5, 0.75):
        middle = a + share * (b - a)
        for ends, outward in ((rows.lower, -3e-6), (rows.upper, +3e-6)):
            weights = np.sin(b - middle) / np.sin(b - a), np.sin(middle - a) / np.sin(b - a)
            chord = np.arctan(weights[0] * np.tan(ends[:-1][wide]) + weights[1] * np.tan(ends[1:][wide]))
            assert (stable.margin(twists_at(middle, chord - outward, length)) > 0.0).all()
            assert (stable.margin(twists_at(middle, chord + outward, length)) <= 0.0).all()


def test_a_set_without_twists_is_found_empty(make_chain: ChainMaker) -> None:
    stable = stable_set(make_chain.boxes(2, contact_friction=0.0))
    assert len(stable.refined_meridians().meridians) == 0
    assert len(stable_set(make_chain.boxes(1)).refined_meridians(0.999).meridians) == 0
