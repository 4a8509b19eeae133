"""The boundary of a stable set along meridians of the twist sphere, and the peaks of its margin."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import pushplan.core.boundary as boundary
import pushplan.core.sphere as sphere
from pushplan.mechanics.sphere import POLE, Meridians, twists_at
from pushplan.util.arrays import FloatArray, IntArray

MarginFunction = Callable[[FloatArray, float], FloatArray]
"""margin(twists (k, 3), floor) -> (k,); values at or below the floor need not be exact, only not above it."""


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

        Values at or below -`boundary.PROMISING` need not be exact.
        """
        east, north = np.cos(longitude), np.sin(longitude)

        def of(member: IntArray, latitude: FloatArray) -> FloatArray:
            twists = sphere.twists_on(east, north, self.length, member, latitude)
            values = self.margin(twists, self.minimum - boundary.PROMISING)
            return np.subtract(values, self.minimum, dtype=np.float64)

        return of


class Table(NamedTuple):
    """Meridians and their intervals.

    Attributes:
        at: (m,) longitudes, rad.
        counts: (m,) number of intervals on each.
        ends: (m, c, 2) their lower and upper ends, rad; nan beyond the counts.
        bend: (m, c, 2) how far an end is from the great circle between the neighbours that the meridian was put
            between, divided by the product of the distances from both, 1/rad; nan where that is not known.
    """

    at: FloatArray
    counts: IntArray
    ends: FloatArray
    bend: FloatArray

    @classmethod
    def of(cls, at: FloatArray, member: IntArray, ends: FloatArray) -> Table:
        """Return meridians at longitudes (m,) with the intervals `ends` (k, 2) of the members (k,), in order."""
        counts = np.bincount(member, minlength=len(at))
        slot = np.arange(len(member)) - (np.cumsum(counts) - counts)[member]
        table = np.full((2, len(at), max(counts.max(initial=0), 1), 2), np.nan)
        table[0, member, slot] = ends
        return cls(at, counts, table[0], table[1])

    def joined(self, other: Table) -> Table:
        """Return these meridians, and others after them."""
        width = max(self.ends.shape[1], other.ends.shape[1])
        one, more = self._widened(width), other._widened(width)
        return Table(
            np.concatenate([one.at, more.at]),
            np.concatenate([one.counts, more.counts]),
            np.concatenate([one.ends, more.ends]),
            np.concatenate([one.bend, more.bend]),
        )

    def replaced(self, index: IntArray, other: Table) -> Table:
        """Return the table with others in the place of the meridians `index`."""
        kept = np.arange(len(self.at))
        kept[index] = len(self.at) + np.arange(len(index))
        return self.joined(other).chosen(kept)

    def chosen(self, index: IntArray) -> Table:
        """Return some of the meridians."""
        return Table(self.at[index], self.counts[index], self.ends[index], self.bend[index])

    def meridians(self) -> Meridians:
        """Return the rows of all intervals."""
        rows = self.ends[np.arange(self.ends.shape[1]) < self.counts[:, None]]
        return Meridians(np.repeat(self.at, self.counts), rows[:, 0], rows[:, 1])

    def _widened(self, width: int) -> Table:
        more = ((0, 0), (0, width - self.ends.shape[1]), (0, 0))
        if not more[1][1]:
            return self
        ends, bend = (np.pad(each, more, constant_values=np.nan) for each in (self.ends, self.bend))
        return Table(self.at, self.counts, ends, bend)


Family = Callable[[IntArray, FloatArray], FloatArray]
"""f(i, x): value of member i (m,) of a family of functions at x (m,)."""


def inner_ends(f: Family, brackets: FloatArray) -> FloatArray:
    """Return the last points (m,) with f > 0 on the way from the inside (f > 0) to the outside (f <= 0).

    Args:
        f: Known by its values.
        brackets: (m, 4) places inside and outside, and the values there.
    """
    search = boundary.RootSearch(brackets)
    while search:
        search.take(f(search.member, search.x))
    return search.ends


def maximise(
    f: Family,
    low: FloatArray,
    high: FloatArray,
    goal: float,
    iterations: int,
    ends: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the best points and values (m,) of golden-section searches; each stops once above `goal`.

    Args:
        f: Known by its values.
        low: (m,) where to begin.
        high: (m,) where to end.
        goal: Value that is enough.
        iterations: Most values asked for after the first two.
        ends: (m,) values at `low` and `high`. With them, hopeless searches are given up; see `boundary.PeakSearch`.
    """
    search = boundary.PeakSearch(low, high, goal, iterations, ends)
    while search:
        search.take(f(search.member, search.x))
    return search.best


FLOOR = -0.8
_SHAPE = (96, 49)
_STEPS = 48
_STEEPEST = 1e3
"""Slope of a margin, 1/rad, above which no peak is hoped for."""
_TURN = np.pi * (3.0 - np.sqrt(5.0))


class SphereSamples(NamedTuple):
    """Margins at equally spaced places.

    Attributes:
        longitude: (n + 1,) from -pi to pi, rad.
        latitude: (s,) from pole to pole, rad.
        value: (n + 1, s) margins, exact above the floor.
    """

    longitude: FloatArray
    latitude: FloatArray
    value: FloatArray

    @classmethod
    def of(cls, margin: MarginFunction, length: float, floor: float, shape: tuple[int, int]) -> SphereSamples:
        """Return the margins of a set with a characteristic length, m, at so many longitudes and latitudes."""
        longitude, latitude = np.linspace(-np.pi, np.pi, shape[0] + 1), np.linspace(-POLE, POLE, shape[1])
        twists = twists_at(longitude[:-1, None], latitude[None, :], length)
        value = margin(twists.reshape(-1, 3), floor).reshape(shape)
        return cls(longitude, latitude, np.concatenate([value, value[:1]]))

    def maxima(self, floor: float) -> tuple[FloatArray, FloatArray]:
        """Return unit vectors (m, 3) and values (m,) of samples above the floor that no neighbour exceeds.

        Those in the midst of a plateau, as where nothing rubs, are left out: no way leads up from there.
        """
        value = self.value[:-1]
        most, least = _around(np.maximum, value), _around(np.minimum, value)
        highest = (value >= most) & (value > least) & (value > floor)
        highest[1:, [0, -1]] = False  # all longitudes meet at the poles
        i, j = np.nonzero(highest)
        return twists_at(self.longitude[i], self.latitude[j], 1.0), value[i, j]

    def on_meridians(self, floor: float) -> FloatArray:
        """Return the samples (k, 3) of longitudes where one is above the floor: index, latitude and value."""
        hope = np.flatnonzero(self.value.max(axis=1) > floor)
        latitude = np.tile(self.latitude, len(hope))
        return np.column_stack([np.repeat(hope, len(self.latitude)), latitude, self.value[hope].ravel()])


def _around(of: np.ufunc, value: FloatArray) -> FloatArray:
    """Return what is largest or smallest of samples and their neighbours, (n, s); the first row follows the last."""
    rows = of(of(np.roll(value, 1, axis=0), value), np.roll(value, -1, axis=0))
    beside = np.pad(rows, ((0, 0), (1, 1)), mode="edge")
    return np.asarray(of(of(beside[:, :-2], rows), beside[:, 2:]))


def margin_peaks(margin: MarginFunction, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the local maxima of a margin as unit twists (m, 3) and values (m,)."""
    at, values = SphereSamples.of(margin, length, FLOOR, _SHAPE).maxima(FLOOR)
    climb(margin, length, at, values, np.pi / _SHAPE[1])
    return at / [1.0, 1.0, length], values


def climb(
    margin: MarginFunction, length: float, at: FloatArray, values: FloatArray, first_step: float, goal: float = np.inf
) -> None:
    """Move unit vectors (m, 3) with margins (m,) uphill, each until it is above the goal or cannot get there.

    It is a pattern search whose directions turn, as margins have ridges: they are minima of many functions.
    """
    step = np.full(len(at), first_step)
    for k in range(_STEPS):
        live = np.flatnonzero((values <= goal) & (values > goal - _STEEPEST * step) | np.isinf(goal))
        if len(live) == 0:
            break
        around = sphere.neighbours(at, step, live, k * _TURN)
        sphere.move(at, values, step, live, around, margin(around / [1.0, 1.0, length], -2.0))
