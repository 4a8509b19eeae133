"""Boundaries against what nothing but a margin function tells, and against dense samples of it."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.mechanics.sphere import twists_at
from pushplan.sets.boundary_following import RefinedMeridians
from pushplan.sets.cor import cor_polygons
from pushplan.sets.known_load_sets import IntersectionSet
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import BoolArray, FloatArray


class ByContacts(StableSet):
    """What a user writes: the margins of contacts alone, in Python."""

    name = "by-contacts"

    def __init__(self, same: StableSet) -> None:
        super().__init__(same.chain)
        self._same = same

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact."""
        return self._same.contact_margin_values(twists)


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
def test_compiled_margins_and_those_of_contacts_give_the_same_set(
    make_chain: ChainMaker, seed: int, n: int, tree: bool, feet: bool, minimum: float
) -> None:
    stable = stable_set(make_chain.random(seed, n, tree=tree, feet=feet))
    length, general = stable.chain.characteristic_length, ByContacts(stable)
    found, expected = stable.refined_meridians(minimum), general.refined_meridians(minimum)
    for sense in (+1, -1):
        one, other = (cor_polygons(each, length, sense, None) for each in (found, expected))
        assert one.symmetric_difference(other).area < 1e-5 * max(other.area, length**2)
    mine, theirs = stable.meridians(minimum), general.meridians(minimum)
    np.testing.assert_array_equal(mine.longitude, theirs.longitude)
    np.testing.assert_allclose(mine.lower, theirs.lower, rtol=0.0, atol=2e-12)
    np.testing.assert_allclose(mine.upper, theirs.upper, rtol=0.0, atol=2e-12)


@pytest.mark.parametrize("name", ["ecof", "cof", "stable", "robust", "both"])
@pytest.mark.parametrize(("seed", "n", "minimum"), [(5, 1, 0.0), (6, 2, 0.02), (7, 4, 0.0)])
def test_dense_samples_agree_with_the_boundary_between_meridians(
    make_chain: ChainMaker, name: str, seed: int, n: int, minimum: float
) -> None:
    """On 20 random meridians, farther than 5e-6 rad from the ends that great circles between found ones give."""
    chain = make_chain.random(seed, n, tree=seed % 2 == 1, feet=seed == 7)
    stable = (
        IntersectionSet(stable_set(chain), stable_set(chain, "stable"))
        if name == "both"
        else stable_set(chain, name)
    )
    refined, rng = stable.refined_meridians(minimum), np.random.default_rng(seed)
    latitude = np.linspace(-0.5, 0.5, 1001) * np.pi
    for longitude in rng.uniform(-np.pi, np.pi, 20):
        held, near = held_between(refined, longitude, latitude)
        margins = stable.margin(twists_at(longitude, latitude, chain.characteristic_length))
        assert ((held == (margins > minimum)) | near).all()


def held_between(
    refined: RefinedMeridians, longitude: float, latitude: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Return which latitudes (k,) are inside on a meridian between two found ones, and which are next to an end."""
    k = int(np.searchsorted(refined.longitude, longitude))
    a, b = refined.longitude[k - 1 : k + 1]
    rows, held, near = refined.meridians, np.zeros(len(latitude), np.bool_), np.zeros(len(latitude), np.bool_)
    left, right = np.flatnonzero(rows.longitude == a), np.flatnonzero(rows.longitude == b)
    assert len(left) == len(right) or b - a < 1e-6
    for i, j in zip(left, right, strict=False):
        weights = np.sin(b - longitude) / np.sin(b - a), np.sin(longitude - a) / np.sin(b - a)
        low, high = (
            np.arctan(weights[0] * np.tan(ends[i]) + weights[1] * np.tan(ends[j]))
            for ends in (rows.lower, rows.upper)
        )
        held |= (latitude >= low) & (latitude <= high)
        near |= (np.abs(latitude - low) < 5e-6) | (np.abs(latitude - high) < 5e-6)
    return held, near


def test_a_narrow_cone_of_translations_is_found(make_chain: ChainMaker) -> None:
    """Where all contacts hold by less than they could, 0.01 rad wide: the meridians end where the cone does."""
    chain = make_chain.boxes(2, contact_friction=0.005)
    chain = replace(chain, contacts=(chain.contacts[0], replace(chain.contacts[1], friction=0.005)))
    refined, cone = stable_set(chain, "translation").refined_meridians(), stable_set(chain).translation_cone()
    assert cone is not None
    ends = refined.meridians.longitude[[0, -1]]
    np.testing.assert_allclose(ends, np.arctan2(cone[:, 1], cone[:, 0]), atol=1e-11)
    assert len(stable_set(chain, "translation").meridians(count=2048)) == 3
