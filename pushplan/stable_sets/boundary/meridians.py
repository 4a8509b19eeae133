"""Stable intervals along meridians of the twist sphere, from nothing but a margin function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.basics.arrays import FloatArray, IntArray
from pushplan.mechanics.sphere import POLE, Meridians, twists_at
from pushplan.stable_sets.boundary.intervals import PROMISING, Samples, find_intervals

MarginFunction = Callable[[FloatArray, float], FloatArray]
"""margin(twists (k, 3), floor) -> (k,); values at or below the floor need not be exact, only not above it."""

LATITUDES = 17
"""Latitudes at which every meridian is sampled before its extremes are searched between the samples."""


def find_meridians(
    margin: MarginFunction,
    length: float,
    longitude: FloatArray,
    minimum: float,
    hints: Samples | None = None,
) -> Meridians:
    """Return all intervals of latitude with margin > `minimum` at increasing longitudes (m,), rad.

    The ends returned are inside: the margin exceeds `minimum` there. `hints` are further latitudes to sample.
    """

    def excess(member: IntArray, lat: FloatArray) -> FloatArray:
        return margin(twists_at(longitude[member], lat, length), minimum - PROMISING) - minimum

    grid = Samples.on_grid(len(longitude), np.linspace(-POLE, POLE, LATITUDES))
    found = find_intervals(excess, grid if hints is None else grid.joined(hints))
    return Meridians(longitude[found.member], found.lower, found.upper)
