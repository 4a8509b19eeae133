"""Neighbours of one direction are worked out once, and nothing else is."""

from __future__ import annotations

import numpy as np

import pushplan.core.sphere as sphere
from pushplan.mechanics.sphere import by_direction
from pushplan.util.arrays import FloatArray


def test_each_twist_has_the_direction_of_the_first_one_of_its_neighbours() -> None:
    rng = np.random.default_rng(1)
    counts = rng.integers(1, 9, 40)
    rays = rng.normal(size=(40, 3))
    rays[::4] *= [1.0, 1.0, 0.0]  # straight pushes as well
    twists = np.repeat(rays, counts, axis=0) * rng.uniform(1e-3, 2.0, (counts.sum(), 1))
    owner, first = sphere.directions(twists, 0.3)
    np.testing.assert_array_equal(owner, np.repeat(np.arange(40), counts))
    np.testing.assert_array_equal(first, np.cumsum(counts) - counts)


def test_opposite_twists_and_slight_turns_are_other_directions() -> None:
    twists = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, 0.0, 1e-9], [-1.0, 1e-9, 1e-9]])
    assert len(sphere.directions(twists, 1.0)[1]) == len(twists)


def test_values_are_asked_for_once_a_direction_and_are_those_of_all_twists() -> None:
    asked = []

    def values(twists: FloatArray) -> FloatArray:
        asked.append(len(twists))
        return np.asarray(np.arctan2(twists[:, 1], twists[:, 0]))

    rays = np.random.default_rng(2).normal(size=(5, 3))
    twists = np.repeat(rays, 20, axis=0) * np.tile(np.linspace(0.1, 1.0, 20), 5)[:, None]
    np.testing.assert_allclose(by_direction(values, twists, 1.0), values(twists), atol=1e-12)
    assert asked == [5, 100]
