"""The boundary of a stable set along meridians of the twist sphere, and the peaks of its margin."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, inlined
from pushplan.mechanics.sphere import POLE, Meridians, twists_at
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

TOLERANCE = 1e-12
"""Width of the bracket in which a root is enclosed."""
_PUSH = 1e-3
_DOUBT = 4.0
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def inner_ends(f: Family, brackets: FloatArray) -> FloatArray:
    """Return the last points (m,) with f > 0 on the way from the inside (f > 0) to the outside (f <= 0).

    ITP method (Oliveira & Takahashi 2020): superlinear on smooth functions, never worse than bisection by
    more than a few steps, jumps included.

    Args:
        f: Known by its values.
        brackets: (m, 4) places inside and outside, and the values there.
    """
    state = np.zeros((len(brackets), 6))
    state[:, :4] = brackets
    live, x, value = np.arange(len(state)), state[:, 0].copy(), state[:, 2].copy()
    while n := _enclose(state, live, x, value):
        value = f(live[:n], x[:n])
    return state[:, 0]


@compiled
def _enclose(state: FloatArray, live: IntArray, x: FloatArray, value: FloatArray) -> int:
    """Take the values (n,) at the first n of `x`, and put there where to look next; return how many are open.

    Args:
        state: (m, 6) ends inside and outside, values there, steps left and kappa (0: not begun) of every bracket.
        live: The open brackets, at the front.
        x: Where they are looked at.
        value: What was found there.
    """
    n = 0
    for j in range(len(value)):
        i = live[j]
        side = 0 if value[j] > 0.0 else 1
        state[i, side], state[i, 2 + side] = x[j], value[j]
        a, b, fa, fb, steps, kappa = state[i]
        half, gap = 0.5 * (a + b), abs(b - a)
        if kappa == 0.0:
            width = max(gap, TOLERANCE)
            steps, kappa = math.ceil(math.log2(width / TOLERANCE)) + 3.0, _PUSH / width
        steps -= 1.0
        state[i, 4], state[i, 5] = steps, kappa
        if not (gap > TOLERANCE and half != a):
            continue
        falsi = (fb * a - fa * b) / (fb - fa)
        delta = max(kappa * gap * gap, 0.4 * TOLERANCE)
        towards = 1.0 if half > falsi else -1.0
        point = falsi + towards * delta if delta <= abs(half - falsi) else half
        reach = max(0.5 * TOLERANCE * 2.0 ** max(steps, 0.0) - 0.5 * gap, 0.0)
        if abs(point - half) > reach:
            point = half - towards * reach
        live[n], x[n], n = i, point, n + 1
    return n


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
        ends: (m,) values at `low` and `high`. With them, a search is given up where a rise by `_DOUBT` times what a
            concave function could still have would not reach the goal.
    """
    first, x, live = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low), np.arange(len(low))
    state = np.empty((len(low), 9))
    state[:, 0], state[:, 1], state[:, 2], state[:, 3] = low, first, x, high
    if ends is not None:
        state[:, 4], state[:, 7] = ends
    state[:, 5], value = f(np.concatenate([live, live]), np.concatenate([first, x])).reshape(2, -1)
    state[:, 8] = iterations
    while n := _narrow(state, live, x, value, goal, ends is not None):
        value = f(live[:n], x[:n])
    better = state[:, 5] >= state[:, 6]
    return np.where(better, state[:, 1], state[:, 2]), np.where(better, state[:, 5], state[:, 6])


@compiled
def _narrow(
    state: FloatArray, live: IntArray, x: FloatArray, value: FloatArray, goal: float, concave: bool
) -> int:
    """Do for `maximise` what `_enclose` does; a row of `state` is four places, the values there, and steps left."""
    n = 0
    for j in range(len(value)):
        i = live[j]
        row = state[i]
        row[6 if x[j] == row[2] else 5] = value[j]
        row[8] -= 1.0
        best = max(row[5], row[6])
        if best > goal or row[8] < -0.5 or (concave and best + _DOUBT * (_highest(row) - best) <= goal):
            continue
        if row[5] < row[6]:
            row[0], row[1], row[4], row[5] = row[1], row[2], row[5], row[6]
            row[2] = row[0] + _GOLDEN * (row[3] - row[0])
            x[n] = row[2]
        else:
            row[3], row[2], row[7], row[6] = row[2], row[1], row[6], row[5]
            row[1] = row[3] - _GOLDEN * (row[3] - row[0])
            x[n] = row[1]
        live[n], n = i, n + 1
    return n


@inlined
def _highest(row: FloatArray) -> float:
    """Return the largest value that a concave function with four known ones may have."""
    a, b, c, d, fa, fb, fc, fd, _ = row
    rise, slope, fall = (fb - fa) / (b - a), (fc - fb) / (c - b), (fd - fc) / (d - c)
    crossing = min(max((fc - fb - fall * (c - b)) / (rise - fall), 0.0), c - b)
    return float(max(fb + rise * crossing, fb - slope * (b - a), fc + slope * (d - c)))


FLOOR = -0.8
_SHAPE = (96, 49)
_STEPS = 48
_STEEPEST = 1e3
"""Slope of a margin, 1/rad, above which no peak is hoped for."""
_SPOKES = 8
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
        """Return unit vectors (m, 3) and values (m,) of samples above the floor that no neighbour exceeds."""
        value = self.value[:-1]
        rows = np.maximum(np.maximum(np.roll(value, 1, axis=0), value), np.roll(value, -1, axis=0))
        beside = np.pad(rows, ((0, 0), (1, 1)), mode="edge")
        most = np.maximum(np.maximum(beside[:, :-2], rows), beside[:, 2:])
        highest = (value >= most) & (value > floor)
        highest[1:, [0, -1]] = False  # all longitudes meet at the poles
        i, j = np.nonzero(highest)
        return twists_at(self.longitude[i], self.latitude[j], 1.0), value[i, j]

    def on_meridians(self, floor: float) -> FloatArray:
        """Return the samples (k, 3) of longitudes where one is above the floor: index, latitude and value."""
        hope = np.flatnonzero(self.value.max(axis=1) > floor)
        latitude = np.tile(self.latitude, len(hope))
        return np.column_stack([np.repeat(hope, len(self.latitude)), latitude, self.value[hope].ravel()])


def margin_peaks(margin: MarginFunction, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the local maxima of a margin as unit twists (m, 3) and values (m,)."""
    at, values = SphereSamples.of(margin, length, FLOOR, _SHAPE).maxima(FLOOR)
    climb(margin, length, at, values, np.pi / _SHAPE[1])
    return at / [1.0, 1.0, length], values


def climb(
    margin: MarginFunction,
    length: float,
    at: FloatArray,
    values: FloatArray,
    first_step: float,
    goal: float = np.inf,
) -> None:
    """Move unit vectors (m, 3) with margins (m,) uphill, each until it is above the goal or cannot get there.

    It is a pattern search whose directions turn, as margins have ridges: they are minima of many functions.
    """
    step = np.full(len(at), first_step)
    for k in range(_STEPS):
        live = np.flatnonzero((values <= goal) & (values > goal - _STEEPEST * step) | np.isinf(goal))
        if len(live) == 0:
            break
        around = _neighbours(at, step, live, k * _TURN)
        _move(at, values, step, live, around, margin(around / [1.0, 1.0, length], -2.0))


@compiled
def _neighbours(at: FloatArray, step: FloatArray, live: IntArray, turn: float) -> FloatArray:
    """Return unit vectors (8 m, 3) at angles `step` around m of the unit vectors."""
    out, spoke = np.empty((len(live) * _SPOKES, 3)), np.empty(3)
    for j in range(len(out)):
        i, angle = live[j // _SPOKES], turn + 2.0 * math.pi * (j % _SPOKES) / _SPOKES
        x, y, z = at[i]
        flat = abs(z) < 0.7
        size = math.sqrt(x * x + y * y) if flat else math.sqrt(y * y + z * z)
        ex, ey, ez = (-y / size, x / size, 0.0) if flat else (0.0, -z / size, y / size)
        north = y * ez - z * ey, z * ex - x * ez, x * ey - y * ex
        spoke[0], spoke[1], spoke[2] = ex, ey, ez
        for axis in range(3):
            spoke[axis] = math.cos(angle) * spoke[axis] + math.sin(angle) * north[axis]
            out[j, axis] = math.cos(step[i]) * at[i, axis] + math.sin(step[i]) * spoke[axis]
    return out


@compiled
def _move(
    at: FloatArray,
    values: FloatArray,
    step: FloatArray,
    live: IntArray,
    around: FloatArray,
    found: FloatArray,
) -> None:
    """Go to the highest of the neighbours, or look closer."""
    for j in range(len(live)):
        i, best = live[j], j * _SPOKES
        for k in range(best, best + _SPOKES):
            best = k if found[k] > found[best] else best
        if found[best] > values[i]:
            values[i] = found[best]
            for axis in range(3):
                at[i, axis] = around[best, axis]
        else:
            step[i] *= 0.6
