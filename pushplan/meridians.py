"""Stable intervals along meridians of the twist sphere, from nothing but a margin function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.arrays import FloatArray, IntArray
from pushplan.bracketing import inner_ends, maximise
from pushplan.sphere import POLE, Meridians, twists_at

MarginFunction = Callable[[FloatArray, float], FloatArray]
"""margin(twists (k, 3), floor) -> (k,); values at or below the floor need not be exact, only not above it."""

Excess = Callable[[FloatArray, FloatArray], FloatArray]
"""excess(longitude (m,), latitude (m,)) -> margin minus the one asked for (m,)."""

LATITUDES = 25
"""Latitudes at which every meridian is sampled before its extremes are searched between the samples."""
PROMISING = 0.35
"""A largest sample that falls short of the wanted margin by more than this is not searched for a peak."""
_PEAK_STEPS = 14


def find_meridians(margin: MarginFunction, length: float, longitude: FloatArray, minimum: float) -> Meridians:
    """Return all intervals of latitude with margin > `minimum` at increasing longitudes (m,), rad.

    Samples each meridian, searches the peaks (and the dips of stable stretches) between samples, and encloses
    each end to `bracketing.TOLERANCE`. The ends returned are inside: the margin exceeds `minimum` there.
    """

    def excess(lon: FloatArray, lat: FloatArray) -> FloatArray:
        return margin(twists_at(lon, lat, length), minimum - PROMISING) - minimum

    latitude = np.linspace(-POLE, POLE, LATITUDES)
    grid = np.broadcast_to(latitude, (len(longitude), LATITUDES))
    lon = np.repeat(longitude, LATITUDES)
    values = excess(lon, grid.ravel()).reshape(grid.shape)
    peaks = _extremes(excess, longitude, latitude, values, +1.0)
    dips = _extremes(excess, longitude, latitude, values, -1.0)
    i = np.concatenate([np.repeat(np.arange(len(longitude)), LATITUDES), peaks[0], dips[0]])
    lat = np.concatenate([grid.ravel(), peaks[1], dips[1]])
    value = np.concatenate([values.ravel(), peaks[2], dips[2]])
    order = np.lexsort((lat, i))
    return _intervals(excess, longitude, i[order], lat[order], value[order])


def _extremes(
    excess: Excess, longitude: FloatArray, latitude: FloatArray, values: FloatArray, sign: float
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Search local maxima below 0 (`sign` +1), minima above 0 (-1) between samples.

    Returns:
        Index of the longitude, latitude and value of each one found that has the other sign.
    """
    v = sign * values
    inner = v[:, 1:-1]
    extreme = (inner >= v[:, :-2]) & (inner >= v[:, 2:]) & (inner <= 0.0) & (inner > -PROMISING)
    i, j = np.nonzero(extreme)

    def family(member: IntArray, lat: FloatArray) -> FloatArray:
        return sign * excess(longitude[i[member]], lat)

    lat, best = maximise(family, latitude[j], latitude[j + 2], 0.0, _PEAK_STEPS)
    found = best > 0.0
    return i[found], lat[found], sign * best[found]


def _intervals(
    excess: Excess, longitude: FloatArray, i: IntArray, lat: FloatArray, value: FloatArray
) -> Meridians:
    """Return the runs of positive values among samples sorted by longitude index, then latitude."""
    positive = value > 0.0
    same = i[1:] == i[:-1]
    begins = np.flatnonzero(positive & ~np.concatenate([[False], same & positive[:-1]]))
    stops = np.flatnonzero(positive & ~np.concatenate([same & positive[1:], [False]]))
    ends = []
    for at, step in ((begins, -1), (stops, +1)):
        beyond = np.clip(at + step, 0, len(i) - 1)
        at_pole = (i[beyond] != i[at]) | (beyond == at)
        outside = np.where(at_pole, at, beyond)
        ends.append(_ends(excess, longitude[i[at]], lat, value, at, outside))
    return Meridians(longitude[i[begins]], ends[0], ends[1])


def _ends(
    excess: Excess, lon: FloatArray, lat: FloatArray, value: FloatArray, inside: IntArray, outside: IntArray
) -> FloatArray:
    def family(member: IntArray, x: FloatArray) -> FloatArray:
        return excess(lon[member], x)

    return inner_ends(family, lat[inside], lat[outside], value[inside], value[outside])
