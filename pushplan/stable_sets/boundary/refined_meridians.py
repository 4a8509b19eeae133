"""Meridians of a stable set, as close together as its boundary needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.basics.arrays import BoolArray, FloatArray, IntArray
from pushplan.mechanics.sphere import Meridians
from pushplan.stable_sets.boundary.intervals import Samples
from pushplan.stable_sets.boundary.meridian_tracking import (
    Find,
    fan,
    joined,
    poorer,
    rows_at,
    search_again,
    track_meridians,
)

FLATNESS = 1e-6
"""Largest angle by which the boundary may leave the great circle between neighbouring meridians, rad."""
SMALLEST_GAP = 1e-6
"""Longitudes between which intervals begin, end or merge are found to this angle, rad."""
START = 256


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


def refine_meridians(find: Find, start: FloatArray) -> RefinedMeridians:
    """Return the meridians of a set, halving gaps until the boundary is known to `FLATNESS`.

    Args:
        find: Returns the intervals at given longitudes.
        start: (s,) further longitudes to look at, one in every component that may be narrow, rad.
    """
    longitude = np.unique(np.concatenate([np.linspace(-np.pi, np.pi, START + 1), start]))
    found = track_meridians(find, longitude)
    doubtful = np.ones(len(longitude) - 1, dtype=np.bool_)
    while True:
        count = rows_at(found, longitude)[1]
        doubtful &= (np.diff(longitude) > SMALLEST_GAP) & (count[:-1] + count[1:] > 0)
        left = np.flatnonzero(doubtful)
        if len(left) == 0:
            found, overlooked = _checked(find, found, longitude)
            if not overlooked.any():
                return RefinedMeridians(longitude, found)
            doubtful |= overlooked[:-1] | overlooked[1:]
            continue
        ends = longitude[left], longitude[left + 1]
        middle = 0.5 * (ends[0] + ends[1])
        new = find(middle, _hints(found, ends))
        bent = _bent(found, new, ends[0], middle, ends[1])
        found = joined(found, new)
        doubtful[left] = bent
        doubtful = np.insert(doubtful, left + 1, bent)
        longitude = np.insert(longitude, left + 1, middle)


def _checked(find: Find, found: Meridians, longitude: FloatArray) -> tuple[Meridians, BoolArray]:
    """Look again where intervals seem to end: a sample may have missed a narrow one.

    Returns:
        The intervals, and which meridians (m,) have more of them than before.
    """
    before = rows_at(found, longitude)[1]
    poor, _ = poorer(found, longitude)
    if len(poor):
        found = search_again(find, found, longitude, poor)
    return found, rows_at(found, longitude)[1] > before


def _hints(found: Meridians, ends: tuple[FloatArray, FloatArray]) -> Samples:
    """Return latitudes around the neighbours' intervals for the middles between `ends`."""
    index, gap = np.arange(len(ends[0])), 0.5 * (ends[1] - ends[0])
    left, right = (fan(found, source, index, gap) for source in ends)
    return left.joined(right)


def _bent(
    found: Meridians, new: Meridians, left: FloatArray, middle: FloatArray, right: FloatArray
) -> BoolArray:
    """Return which gaps (m,) do not hold the same number of intervals throughout, or bent ends."""
    rows = [rows_at(found, left), rows_at(new, middle), rows_at(found, right)]
    counts = np.stack([count for _, count in rows])
    bent = (counts[0] != counts[1]) | (counts[1] != counts[2])
    for j in range(int(counts.max(initial=0))):
        gap = np.flatnonzero(~bent & (counts[1] > j))
        stretch = 1.0 / np.cos(0.5 * (right[gap] - left[gap]))
        at: list[IntArray] = [first[gap] + j for first, _ in rows]
        for old, fresh in ((found.lower, new.lower), (found.upper, new.upper)):
            chord = np.arctan(0.5 * (np.tan(old[at[0]]) + np.tan(old[at[2]])) * stretch)
            bent[gap] |= np.abs(chord - fresh[at[1]]) > FLATNESS
    return np.asarray(bent, dtype=np.bool_)
