"""What a boundary finder asks of a stable set: its margins, at many twists at a time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled
from pushplan.sets.boundary.bracketing import Family
from pushplan.util.arrays import FloatArray, IntArray

MarginFunction = Callable[[FloatArray, float], FloatArray]
"""margin(twists (k, 3), floor) -> (k,); values at or below the floor need not be exact, only not above it."""

PROMISING = 0.35
"""Where margins fall short of the one asked for by more than this, no interval is hoped for between samples."""


class Asked(NamedTuple):
    """Which boundary is sought: where the margin of a set exceeds a minimum.

    Attributes:
        margin: Of the set.
        length: Characteristic length, m.
        minimum: Margin that stable twists exceed.
    """

    margin: MarginFunction
    length: float
    minimum: float

    def excess(self, longitude: FloatArray) -> Family:
        """Return f(i, latitude): by how much the margin exceeds the minimum on the meridian at `longitude[i]`.

        Values at or below -PROMISING need not be exact.
        """
        east, north = np.cos(longitude), np.sin(longitude)

        def of(member: IntArray, latitude: FloatArray) -> FloatArray:
            twists = _twists(east, north, self.length, member, latitude)
            values = self.margin(twists, self.minimum - PROMISING)
            return np.subtract(values, self.minimum, dtype=np.float64)

        return of


@compiled
def _twists(
    east: FloatArray, north: FloatArray, length: float, member: IntArray, latitude: FloatArray
) -> FloatArray:
    """Return the unit twists (k, 3) at latitudes (k,) of meridians; see `twists_at`."""
    out = np.empty((len(member), 3))
    for j in range(len(member)):
        i, flat = member[j], math.cos(latitude[j])
        out[j, 0], out[j, 1], out[j, 2] = flat * east[i], flat * north[i], math.sin(latitude[j]) / length
    return out
