"""Meridians of a stable set, as close together as its boundary needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pushplan.arrays import BoolArray, FloatArray
from pushplan.sphere import Meridians

FLATNESS = 1e-6
"""Largest angle by which the boundary may leave the great circle between neighbouring meridians, rad."""
SMALLEST_GAP = 1e-8
"""Longitudes between which intervals begin, end or merge are found to this angle, rad."""
_START = 256


@dataclass(frozen=True, eq=False)
class RefinedMeridians:
    """Intervals on meridians between which the boundary runs along great circles, to `FLATNESS`.

    Great circles of the twist sphere are straight lines of the COR plane.

    Attributes:
        longitude: (m,) all longitudes looked at, from -pi to pi, rad.
        meridians: The intervals found on them.
    """

    longitude: FloatArray
    meridians: Meridians


def refine_meridians(find: Callable[[FloatArray], Meridians], start: FloatArray) -> RefinedMeridians:
    """Return the meridians of a set, halving gaps until the boundary is known to `FLATNESS`.

    Args:
        find: Returns the intervals at increasing longitudes.
        start: (s,) further longitudes to look at, one in every component that may be narrow, rad.
    """
    even = np.linspace(-np.pi, np.pi, _START + 1)
    longitude = np.unique(np.concatenate([even, start]))
    found = _Rows.of(find(longitude))
    doubtful = np.ones(len(longitude) - 1, dtype=np.bool_)
    while doubtful.any():
        doubtful &= np.diff(longitude) > SMALLEST_GAP
        left = np.flatnonzero(doubtful & (found.count(longitude[:-1]) + found.count(longitude[1:]) > 0))
        if len(left) == 0:
            break
        middle = 0.5 * (longitude[left] + longitude[left + 1])
        new = _Rows.of(find(middle))
        bent = _bent(found, new, longitude[left], middle, longitude[left + 1])
        found = found.merged(new)
        longitude, doubtful = _inserted(longitude, middle, left, bent)
    return RefinedMeridians(longitude, Meridians(found.longitude, found.lower, found.upper))


def _inserted(
    longitude: FloatArray,
    middle: FloatArray,
    left: np.ndarray[tuple[int], np.dtype[np.intp]],
    bent: BoolArray,
) -> tuple[FloatArray, BoolArray]:
    """Return the longitudes with the middles, and which gaps are to be halved again."""
    doubtful = np.zeros(len(longitude) - 1, dtype=np.bool_)
    doubtful[left] = bent
    return np.insert(longitude, left + 1, middle), np.insert(doubtful, left + 1, bent)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Intervals sorted by longitude, then latitude."""

    longitude: FloatArray
    lower: FloatArray
    upper: FloatArray

    @classmethod
    def of(cls, meridians: Meridians) -> _Rows:
        return cls(meridians.longitude, meridians.lower, meridians.upper)

    def merged(self, other: _Rows) -> _Rows:
        longitude = np.concatenate([self.longitude, other.longitude])
        lower = np.concatenate([self.lower, other.lower])
        upper = np.concatenate([self.upper, other.upper])
        order = np.lexsort((lower, longitude))
        return _Rows(longitude[order], lower[order], upper[order])

    def first(self, longitude: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        return np.searchsorted(self.longitude, longitude, side="left")

    def count(self, longitude: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        return np.searchsorted(self.longitude, longitude, side="right") - self.first(longitude)


def _bent(found: _Rows, new: _Rows, left: FloatArray, middle: FloatArray, right: FloatArray) -> BoolArray:
    """Return which gaps (m,) do not hold the same number of intervals throughout, or bent ends."""
    counts = np.stack([found.count(left), new.count(middle), found.count(right)])
    bent = (counts[0] != counts[1]) | (counts[1] != counts[2])
    for j in range(int(counts.max(initial=0))):
        gap = np.flatnonzero(~bent & (counts[1] > j))
        stretch = 1.0 / np.cos(0.5 * (right[gap] - left[gap]))
        rows = found.first(left[gap]) + j, new.first(middle[gap]) + j, found.first(right[gap]) + j
        for old, fresh in ((found.lower, new.lower), (found.upper, new.upper)):
            chord = np.arctan(0.5 * (np.tan(old[rows[0]]) + np.tan(old[rows[2]])) * stretch)
            bent[gap] |= np.abs(chord - fresh[rows[1]]) > FLATNESS
    return np.asarray(bent, dtype=np.bool_)
