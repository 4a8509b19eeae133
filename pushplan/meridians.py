"""Stable intervals along meridians of the twist sphere, from nothing but a margin function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pushplan.arrays import BoolArray, FloatArray, IntArray
from pushplan.bracketing import inner_ends, maximise
from pushplan.sphere import POLE, Meridians, twists_at

MarginFunction = Callable[[FloatArray, float], FloatArray]
"""margin(twists (k, 3), floor) -> (k,); values at or below the floor need not be exact, only not above it."""

Excess = Callable[[FloatArray, FloatArray], FloatArray]
"""excess(longitude (m,), latitude (m,)) -> margin minus the one asked for (m,)."""

LATITUDES = 21
"""Latitudes at which every meridian is sampled before its extremes are searched between the samples."""
PROMISING = 0.35
"""A largest sample that falls short of the wanted margin by more than this is not searched for a peak."""
_PEAK_STEPS = 14


class Hints(NamedTuple):
    """Further latitudes to sample: which longitude (h,) and latitude (h,), rad."""

    member: IntArray
    latitude: FloatArray


@dataclass(frozen=True, eq=False)
class _Samples:
    """Values at latitudes of meridians, sorted by the longitude's index, then by latitude."""

    index: IntArray
    latitude: FloatArray
    value: FloatArray

    @classmethod
    def sorted(cls, index: IntArray, latitude: FloatArray, value: FloatArray) -> _Samples:
        order = np.lexsort((latitude, index))
        return cls(index[order], latitude[order], value[order])

    def has_next(self) -> BoolArray:
        """Return (k,) whether the sample after each one lies on the same meridian."""
        return np.append(self.index[1:] == self.index[:-1], False)


def find_meridians(
    margin: MarginFunction,
    length: float,
    longitude: FloatArray,
    minimum: float,
    hints: Hints | None = None,
) -> Meridians:
    """Return all intervals of latitude with margin > `minimum` at increasing longitudes (m,), rad.

    Samples each meridian, searches the peaks (and the dips of stable stretches) between samples, and encloses
    each end to `bracketing.TOLERANCE`. The ends returned are inside: the margin exceeds `minimum` there.
    """

    def excess(lon: FloatArray, lat: FloatArray) -> FloatArray:
        return margin(twists_at(lon, lat, length), minimum - PROMISING) - minimum

    index = np.repeat(np.arange(len(longitude)), LATITUDES)
    latitude = np.tile(np.linspace(-POLE, POLE, LATITUDES), len(longitude))
    if hints is not None:
        index = np.concatenate([index, hints.member])
        latitude = np.concatenate([latitude, hints.latitude])
    samples = _Samples.sorted(index, latitude, excess(longitude[index], latitude))
    return _intervals(excess, longitude, _with_extremes(excess, longitude, samples))


def _with_extremes(excess: Excess, longitude: FloatArray, samples: _Samples) -> _Samples:
    """Return the samples with peaks above 0 and dips below 0 that lie between them."""
    parts = [(samples.index, samples.latitude, samples.value)]
    for sign in (+1.0, -1.0):
        v, before = sign * samples.value, np.roll(samples.has_next(), 1)
        inner = samples.has_next() & before & (v >= np.roll(v, 1)) & (v >= np.roll(v, -1))
        k = np.flatnonzero(inner & (v <= 0.0) & (v > -PROMISING))
        index = samples.index[k]

        def family(
            member: IntArray, lat: FloatArray, sign: float = sign, index: IntArray = index
        ) -> FloatArray:
            return sign * excess(longitude[index[member]], lat)

        low, high = samples.latitude[k - 1], samples.latitude[(k + 1) % len(v)]
        lat, best = maximise(family, low, high, 0.0, _PEAK_STEPS)
        found = best > 0.0
        parts.append((index[found], lat[found], sign * best[found]))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return _Samples.sorted(columns[0].astype(np.int64), columns[1], columns[2])


def _intervals(excess: Excess, longitude: FloatArray, samples: _Samples) -> Meridians:
    """Return the runs of positive samples, extended to their exact ends."""
    positive, after = samples.value > 0.0, samples.has_next()
    before = np.roll(after, 1)
    begins = np.flatnonzero(positive & ~(before & np.roll(positive, 1)))
    stops = np.flatnonzero(positive & ~(after & np.roll(positive, -1)))
    lower = _ends(excess, longitude, samples, begins, np.where(before[begins], begins - 1, begins))
    upper = _ends(excess, longitude, samples, stops, np.where(after[stops], stops + 1, stops))
    return Meridians(longitude[samples.index[begins]], lower, upper)


def _ends(
    excess: Excess, longitude: FloatArray, samples: _Samples, inside: IntArray, outside: IntArray
) -> FloatArray:
    """Return the exact ends between samples inside and outside, which are the same sample at a pole."""
    lon = longitude[samples.index[inside]]

    def family(member: IntArray, lat: FloatArray) -> FloatArray:
        return excess(lon[member], lat)

    lat, value = samples.latitude, samples.value
    return inner_ends(family, lat[inside], lat[outside], value[inside], value[outside])
