"""Narrow stable intervals found from their neighbours on the next meridian."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.basics.arrays import FloatArray, IntArray
from pushplan.mechanics.sphere import Meridians
from pushplan.stable_sets.boundary.intervals import Samples

Find = Callable[[FloatArray, Samples | None], Meridians]
"""find(longitude (m,), hints): the intervals at increasing longitudes, sampling the hinted latitudes too."""

FAN = np.linspace(-1.5, 1.5, 13)


def rows_at(meridians: Meridians, longitude: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the first row and the number of rows (m,) at longitudes (m,)."""
    first = np.searchsorted(meridians.longitude, longitude, side="left")
    return first, np.searchsorted(meridians.longitude, longitude, side="right") - first


def fan(meridians: Meridians, source: FloatArray, index: IntArray, gap: FloatArray) -> Samples:
    """Return latitudes around the intervals at longitudes `source` (m,), to sample `gap` (m,) away from there.

    Args:
        meridians: Where the intervals are known.
        source: Longitudes among them.
        index: (m,) index of the longitude that each hint is for.
        gap: Distance in longitude; the fan opens with it, as intervals may lean.
    """
    first, count = rows_at(meridians, source)
    member = np.repeat(np.arange(len(source)), count)
    row = np.arange(len(member)) - np.repeat(np.cumsum(count) - count, count) + first[member]
    low, high = meridians.lower[row], meridians.upper[row]
    reach = np.maximum(high - low, 1.5 * gap[member])
    latitude = 0.5 * (low + high)[:, None] + reach[:, None] * FAN
    inside = np.abs(latitude) < 0.5 * np.pi
    return Samples(np.repeat(index[member], len(FAN))[inside.ravel()], latitude[inside])


def joined(meridians: Meridians, other: Meridians) -> Meridians:
    """Return the rows of both, sorted."""
    longitude, lower, upper = (
        np.concatenate([getattr(meridians, name), getattr(other, name)])
        for name in ("longitude", "lower", "upper")
    )
    order = np.lexsort((lower, longitude))
    return Meridians(longitude[order], lower[order], upper[order])


def search_again(find: Find, found: Meridians, longitude: FloatArray, poor: IntArray) -> Meridians:
    """Return `found` with the meridians `poor` (p,) sampled again around the intervals of both neighbours.

    Neighbours of the first and the last longitude are taken to be each other, or at the same place.
    """
    index = np.arange(len(poor))
    beside = [longitude[poor - 1], longitude[(poor + 1) % len(longitude)]]
    gaps = [np.abs(side - longitude[poor]) % (2.0 * np.pi) for side in beside]
    parts = [fan(found, side, index, gap) for side, gap in zip(beside, gaps, strict=True)]
    again = find(longitude[poor], parts[0].joined(parts[1]))
    kept = ~np.isin(found.longitude, longitude[poor])
    return joined(Meridians(found.longitude[kept], found.lower[kept], found.upper[kept]), again)


def poorer(found: Meridians, longitude: FloatArray) -> tuple[IntArray, IntArray]:
    """Return which meridians have fewer intervals than a neighbour, and how many that one has (all, (m,))."""
    count = rows_at(found, longitude)[1]
    most = np.maximum(np.roll(count, 1), np.roll(count, -1))
    return np.flatnonzero(count < most), most


def track_meridians(find: Find, longitude: FloatArray) -> Meridians:
    """Return the intervals at increasing longitudes (m,) around the full circle.

    Wherever a meridian has fewer intervals than the next one, it is sampled again around its neighbour's, until
    nothing more is found.
    """
    found = find(longitude, None)
    searched = np.zeros(len(longitude), dtype=np.int64)
    while True:
        poor, most = poorer(found, longitude)
        poor = poor[searched[poor] < most[poor]]
        if len(poor) == 0:
            return found
        searched[poor] = most[poor]
        found = search_again(find, found, longitude, poor)
