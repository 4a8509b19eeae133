"""Finds the boundary of a stable set along meridians of the twist sphere, and the peaks of its margin.

The boundary is followed from meridian to meridian and refined if it bends; on each meridian it bounds intervals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

import pushplan.core.boundary as boundary
import pushplan.core.sphere as sphere
from pushplan.mechanics.sphere import POLE, Meridians, twists_at
from pushplan.sets.intervals import PROMISING, Brackets, Family, find_intervals, joined, sampled
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

MarginFunction = Callable[[FloatArray, float], FloatArray]
"""margin(twists (k, 3), floor) -> margins (k,); values up to the floor need not be exact, values above it must be."""


class BoundaryProblem(NamedTuple):
    """Definition of a boundary: the points at which the margin of a set falls below a minimum.

    Attributes:
        margin: Margin of the set.
        length: Characteristic length, m.
        minimum: Margin that stable twists exceed.
    """

    margin: MarginFunction
    length: float
    minimum: float

    def excess(self, longitude: FloatArray) -> Family:
        """Return f(i, latitude): the margin minus the minimum on the meridian at `longitude[i]`.

        Values at or below -`PROMISING` need not be exact.
        """
        east, north = np.cos(longitude), np.sin(longitude)

        def of(member: IntArray, latitude: FloatArray) -> FloatArray:
            twists = sphere.twists_on(east, north, self.length, member, latitude)
            values = self.margin(twists, self.minimum - PROMISING)
            return np.subtract(values, self.minimum, dtype=np.float64)

        return of


class Table(NamedTuple):
    """Meridians and their intervals.

    Attributes:
        at: Longitudes (m,), rad.
        counts: Number of intervals (m,) on each meridian.
        ends: Lower and upper ends (m, c, 2) of the intervals, rad; nan beyond the counts.
        bend: Distance (m, c, 2) of an end from the great circle between the two meridians that the new one was put
            between, divided by the product of the distances from both, 1/rad; nan if it is not known.
    """

    at: FloatArray
    counts: IntArray
    ends: FloatArray
    bend: FloatArray

    @classmethod
    def of(cls, at: FloatArray, member: IntArray, ends: FloatArray) -> Table:
        """Return meridians at longitudes (m,) with the intervals `ends` (k, 2) of the sorted members (k,)."""
        counts = np.bincount(member, minlength=len(at))
        slot = np.arange(len(member)) - (np.cumsum(counts) - counts)[member]
        table = np.full((2, len(at), max(counts.max(initial=0), 1), 2), np.nan)
        table[0, member, slot] = ends
        return cls(at, counts, table[0], table[1])

    def joined(self, other: Table) -> Table:
        """Return these meridians followed by those of another table."""
        width = max(self.ends.shape[1], other.ends.shape[1])
        one, more = self._widened(width), other._widened(width)
        return Table(
            np.concatenate([one.at, more.at]),
            np.concatenate([one.counts, more.counts]),
            np.concatenate([one.ends, more.ends]),
            np.concatenate([one.bend, more.bend]),
        )

    def replaced(self, index: IntArray, other: Table) -> Table:
        """Return the table with the meridians `index` replaced by those of another table."""
        kept = np.arange(len(self.at))
        kept[index] = len(self.at) + np.arange(len(index))
        return self.joined(other).chosen(kept)

    def chosen(self, index: IntArray) -> Table:
        """Return the meridians with the given indices."""
        return Table(self.at[index], self.counts[index], self.ends[index], self.bend[index])

    def meridians(self) -> Meridians:
        """Return all intervals as rows."""
        rows = self.ends[np.arange(self.ends.shape[1]) < self.counts[:, None]]
        return Meridians(np.repeat(self.at, self.counts), rows[:, 0], rows[:, 1])

    def _widened(self, width: int) -> Table:
        more = ((0, 0), (0, width - self.ends.shape[1]), (0, 0))
        if not more[1][1]:
            return self
        ends, bend = (np.pad(each, more, constant_values=np.nan) for each in (self.ends, self.bend))
        return Table(self.at, self.counts, ends, bend)


FLOOR = -0.8
_SHAPE = (96, 49)
_STEPS = 48
_STEEPEST = 1e3
"""Assumed largest slope of a margin towards a peak, 1/rad."""
_TURN = np.pi * (3.0 - np.sqrt(5.0))


class SphereSamples(NamedTuple):
    """Margins at equally spaced points of the twist sphere.

    Attributes:
        longitude: Longitudes (n + 1,) from -pi to pi, rad.
        latitude: Latitudes (s,) from pole to pole, rad.
        value: Margins (n + 1, s), exact above the floor.
    """

    longitude: FloatArray
    latitude: FloatArray
    value: FloatArray

    @classmethod
    def of(cls, margin: MarginFunction, length: float, floor: float, shape: tuple[int, int]) -> SphereSamples:
        """Return margins at `shape` longitudes and latitudes; `length` is the characteristic length, m."""
        longitude, latitude = np.linspace(-np.pi, np.pi, shape[0] + 1), np.linspace(-POLE, POLE, shape[1])
        twists = twists_at(longitude[:-1, None], latitude[None, :], length)
        value = margin(twists.reshape(-1, 3), floor).reshape(shape)
        return cls(longitude, latitude, np.concatenate([value, value[:1]]))

    def maxima(self, floor: float) -> tuple[FloatArray, FloatArray]:
        """Return unit vectors (m, 3) and values (m,) of samples above the floor that no neighbour exceeds.

        Samples inside a plateau, for example without friction, are left out, because no neighbour is higher. If all
        samples are equal, the push straight ahead is the maximum.
        """
        value = self.value[:-1]
        most, least = _around(np.maximum, value), _around(np.minimum, value)
        highest = (value >= most) & (value > least) & (value > floor)
        highest[1:, [0, -1]] = False  # all longitudes meet at the poles
        if value.min() == value.max() > 0.0:
            highest[len(value) // 2, value.shape[1] // 2] = True
        i, j = np.nonzero(highest)
        return twists_at(self.longitude[i], self.latitude[j], 1.0), value[i, j]

    def on_meridians(self, floor: float) -> FloatArray:
        """Return the samples (k, 3) of longitudes with a sample above the floor: index, latitude and value."""
        promising = np.flatnonzero(self.value.max(axis=1) > floor)
        latitude = np.tile(self.latitude, len(promising))
        return np.column_stack([np.repeat(promising, len(self.latitude)), latitude, self.value[promising].ravel()])


def _around(of: np.ufunc, value: FloatArray) -> FloatArray:
    """Return the largest or smallest value among each sample and its neighbours, (n, s), periodic in the rows."""
    beside = np.concatenate([value[-1:], value, value[:1]])
    rows = of(of(beside[:-2], value), beside[2:])
    beside = np.concatenate([rows[:, :1], rows, rows[:, -1:]], axis=1)
    return np.asarray(of(of(beside[:, :-2], rows), beside[:, 2:]))


def margin_peaks(margin: MarginFunction, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the local maxima of a margin as unit twists (m, 3) and values (m,)."""
    at, values = SphereSamples.of(margin, length, FLOOR, _SHAPE).maxima(FLOOR)
    climb(margin, length, at, values, np.pi / _SHAPE[1])
    return at / [1.0, 1.0, length], values


def climb(
    margin: MarginFunction, length: float, at: FloatArray, values: FloatArray, first_step: float, goal: float = np.inf
) -> None:
    """Move unit vectors (m, 3) with margins (m,) uphill, each until it is above the goal or cannot reach it.

    This is a pattern search. Its directions rotate, because margins are minima of many functions and have ridges.
    """
    step = np.full(len(at), first_step)
    for k in range(_STEPS):
        live = np.flatnonzero((values <= goal) & (values > goal - _STEEPEST * step) | np.isinf(goal))
        if len(live) == 0:
            break
        around = sphere.neighbours(at, step, live, k * _TURN)
        sphere.move(at, values, step, live, around, margin(around / [1.0, 1.0, length], -2.0))


_WIDER = (1.0, 10.0, 100.0)
"""Factors on the expected distance in the search for ends; next to a corner the second one is needed."""

Gaps = tuple[IntArray, IntArray, FloatArray]
"""Indices (g,) of the meridians to the left and to the right of gaps, and longitudes (g,) in the gaps."""


def put_between(problem: BoundaryProblem, table: Table, gaps: Gaps) -> tuple[Table, BoolArray]:
    """Return the table with a new meridian in each gap, and whether the boundary still bends in each gap (g,)."""
    left, right, middle = gaps
    f, found = problem.excess(middle), []
    lost = table.counts[left] + table.counts[right] > 0
    for wider in _WIDER:
        member, x = boundary.probes(table, gaps, np.flatnonzero(lost), wider)
        if len(x) == 0:
            break
        found.append(Brackets(*boundary.followed(x, f(member, x), member)))
        lost[found[-1].member] = False
    if lost.any():
        found.append(_searched(f, table, gaps, np.flatnonzero(lost)))
    whole = joined(found)
    new = Table.of(middle, whole.member, whole.narrowed(f))
    bend, more = boundary.bends(table, gaps, new)
    return table.joined(new._replace(bend=bend)), more


def search_again(problem: BoundaryProblem, table: Table) -> tuple[Table, IntArray]:
    """Search again on meridians with fewer intervals than a neighbour, around the intervals of both neighbours.

    The first and the last meridian are neighbours or the same.

    Returns:
        The table, and the indices of the meridians that have gained intervals.
    """
    order = np.argsort(table.at)
    before, after = np.roll(order, 1), np.roll(order, -1)
    k = np.flatnonzero(table.counts[order] < np.maximum(table.counts[before], table.counts[after]))
    poor = order[k]
    f = problem.excess(table.at[poor])
    found = _searched(f, table, (before[k], after[k], table.at[poor]), np.arange(len(k)))
    new = Table.of(table.at[poor], found.member, found.narrowed(f))
    gained = np.flatnonzero(new.counts > table.counts[poor])
    return table.replaced(poor[gained], new.chosen(gained)), poor[gained]


def _searched(f: Family, table: Table, gaps: Gaps, chosen: IntArray) -> Brackets:
    member, x = boundary.fans(table, gaps, chosen)
    order = np.lexsort((x, member))
    return find_intervals(f, sampled(f, member[order], x[order]))


SMALLEST_GAP = 1e-6
"""Resolution of the longitudes at which intervals begin, end or merge, rad."""
_FIRST = (72, 37)
"""Numbers of longitudes and latitudes of the first samples, 5 degrees apart."""


@dataclass(frozen=True, eq=False)
class RefinedMeridians:
    """Intervals on meridians; between these, the boundary follows great circles to within `boundary.FLATNESS`.

    Great circles of the twist sphere are straight lines of the COR plane.

    Attributes:
        longitude: All searched longitudes (m,), from -pi to pi, rad.
        meridians: Intervals on these longitudes.
    """

    longitude: FloatArray
    meridians: Meridians


def find_meridians(problem: BoundaryProblem, longitude: FloatArray) -> Meridians:
    """Return all intervals of latitude with margin > minimum at longitudes (m,), rad.

    The margin also exceeds the minimum at the ends.
    """
    table = first_meridians(problem)
    order = np.argsort(table.at)
    around = np.where(np.abs(longitude) > np.pi, np.arctan2(np.sin(longitude), np.cos(longitude)), longitude)
    gap = np.searchsorted(table.at[order[1:-1]], around, "right")
    place = len(table.at) + np.arange(len(around))
    table, _ = put_between(problem, table, (order[gap], order[gap + 1], around))
    gained = place
    while len(gained):
        table, gained = search_again(problem, table)
    found = table.chosen(place)
    return found._replace(at=longitude).meridians()


def refine_meridians(problem: BoundaryProblem) -> RefinedMeridians:
    """Return the meridians of a set, with gaps halved until the boundary is flat to `boundary.FLATNESS`."""
    table = first_meridians(problem)
    doubtful = np.arange(len(table.at))
    while len(doubtful):
        order = np.argsort(table.at)
        k = np.flatnonzero(np.isin(order[:-1], doubtful) | np.isin(order[1:], doubtful))
        table = _refined(problem, table, order[k], order[k + 1])
        table, doubtful = search_again(problem, table)
    table = table.chosen(np.argsort(table.at))
    return RefinedMeridians(table.at, table.meridians())


def _refined(problem: BoundaryProblem, table: Table, left: IntArray, right: IntArray) -> Table:
    """Halve the gaps between meridians until the boundary is flat in them."""
    while True:
        wide = table.at[right] - table.at[left] > SMALLEST_GAP
        k = np.flatnonzero(wide & (table.counts[left] + table.counts[right] > 0))
        if len(k) == 0:
            return table
        left, right, new = left[k], right[k], len(table.at) + np.arange(len(k))
        middle = 0.5 * (table.at[left] + table.at[right])
        table, bent = put_between(problem, table, (left, right, middle))
        left, right, new = left[bent], right[bent], new[bent]
        left, right = np.concatenate([left, new]), np.concatenate([new, right])


def first_meridians(problem: BoundaryProblem) -> Table:
    """Return meridians a few degrees apart, and one through every component that climbing from samples finds.

    If none of them has an interval, the samples are repeated with the spacing of `margin_peaks`.
    """
    table = _sampled_meridians(problem, _FIRST)
    return table if table.counts.any() else _sampled_meridians(problem, _SHAPE)


def _sampled_meridians(problem: BoundaryProblem, shape: tuple[int, int]) -> Table:
    floor = problem.minimum - PROMISING
    samples = SphereSamples.of(problem.margin, problem.length, floor, shape)
    at, values = samples.maxima(floor)
    at, values = at[values <= problem.minimum], values[values <= problem.minimum]
    climb(problem.margin, problem.length, at, values, np.pi / shape[1], problem.minimum)
    seeds = at[values > problem.minimum]
    longitude = np.concatenate([samples.longitude, np.arctan2(seeds[:, 1], seeds[:, 0])])
    f, rows = problem.excess(longitude), samples.on_meridians(floor)
    rows[:, 2] -= problem.minimum
    latitude = np.tile(samples.latitude, (len(seeds), 1))
    latitude = np.sort(np.column_stack([latitude, np.arcsin(seeds[:, 2])]), axis=1)
    member = len(samples.longitude) + np.repeat(np.arange(len(seeds)), latitude.shape[1])
    found = find_intervals(f, np.concatenate([rows, sampled(f, member, latitude.ravel())]))
    return Table.of(longitude, found.member, found.narrowed(f))
