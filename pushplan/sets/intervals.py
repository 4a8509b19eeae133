"""Finds roots, peaks and positive intervals of many functions at once, from their values."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import pushplan.core.boundary as boundary
from pushplan.util.arrays import FloatArray, IntArray

Family = Callable[[IntArray, FloatArray], FloatArray]
"""f(i, x): values (m,) of members i (m,) of a family of functions at points x (m,)."""


def inner_ends(f: Family, brackets: FloatArray) -> FloatArray:
    """Return the last points (m,) with f > 0 between an inside point (f > 0) and an outside point (f <= 0).

    Args:
        f: Function that returns values.
        brackets: Points inside and outside and their values, (m, 4).
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
        f: Function that returns values.
        low: Lower ends (m,) of the search intervals.
        high: Upper ends (m,) of the search intervals.
        goal: Value above which a search stops.
        iterations: Largest number of values after the first two.
        ends: Values (m,) at `low` and at `high`. With them, searches without prospects stop early; see
            `boundary.PeakSearch`.
    """
    search = boundary.PeakSearch(low, high, goal, iterations, ends)
    while search:
        search.take(f(search.member, search.x))
    return search.best


PROMISING = 0.35
"""Samples below minus this value are assumed to have no positive interval next to them."""

PARTS, CLOSE = 5, 0.01
"""Number of parts that a gap between samples is divided into, and the width up to which it is not divided."""

_PEAK_STEPS = 14


class Brackets(NamedTuple):
    """Intervals in which a member is positive, sorted by member, then by position.

    Attributes:
        member: Member (k,) of each interval.
        ends: Brackets (k, 2, 4) of the lower and the upper end; see `inner_ends`.
    """

    member: IntArray
    ends: FloatArray

    def narrowed(self, f: Family) -> FloatArray:
        """Return the ends (k, 2) of the intervals, which are positive points."""
        member = np.repeat(self.member, 2)
        return inner_ends(lambda i, x: f(member[i], x), self.ends.reshape(-1, 4)).reshape(-1, 2)


def joined(parts: list[Brackets]) -> Brackets:
    """Return the brackets of all parts, which share no members."""
    if len(parts) == 1:
        return parts[0]
    member = np.concatenate([np.empty(0, np.int64), *(part.member for part in parts)])
    ends = np.concatenate([np.empty((0, 2, 4)), *(part.ends for part in parts)])
    order = np.argsort(member, kind="stable")
    return Brackets(member[order], ends[order])


def sampled(f: Family, member: IntArray, x: FloatArray) -> FloatArray:
    """Return samples (k, 3) of members: member, position and value."""
    return np.column_stack([member, x, f(member, x)])


def find_intervals(f: Family, samples: FloatArray) -> Brackets:
    """Return all intervals with f > 0 that samples show; peaks and dips between samples are searched for, too.

    Args:
        f: Function f(i, x), continuous or not; values at or below -`PROMISING` need not be exact.
        samples: Samples (k, 3) of member, position and value, sorted by member, then by position.
    """
    member, x = _between(samples)
    if len(x):
        samples = _joined(samples, sampled(f, member, x))
    at = _extremes(samples)
    if len(at):
        before, here, after = samples[at - 1], samples[at], samples[at + 1]
        member, sign = here[:, 0].astype(np.int64), np.where(here[:, 2] > 0.0, -1.0, 1.0)
        ends = sign * before[:, 2], sign * after[:, 2]
        x, best = maximise(lambda i, x: sign[i] * f(member[i], x), before[:, 1], after[:, 1], 0.0, _PEAK_STEPS, ends)
        beyond = best > 0.0
        if beyond.any():
            samples = _joined(samples, np.column_stack([member, x, sign * best])[beyond])
    return _runs(samples)


def _joined(*samples: FloatArray) -> FloatArray:
    """Return samples (k, 3), sorted by member, then by position."""
    rows = np.concatenate(samples)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]


def _between(samples: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return members (k,) and positions (k,) of further samples in every wide gap with a change of sign."""
    member, x, value = samples.T
    wide = (member[:-1] == member[1:]) & (np.diff(x) > CLOSE) & ((value[:-1] > 0.0) != (value[1:] > 0.0))
    first = np.flatnonzero(wide)
    places = x[first, None] + np.diff(x)[first, None] * np.arange(1, PARTS) / PARTS
    return np.repeat(member[first].astype(np.int64), PARTS - 1), places.ravel()


def _extremes(samples: FloatArray) -> IntArray:
    """Return the indices of negative peaks and positive dips that have samples of the same member on both sides."""
    member, _, value = samples.T
    sign = np.where(value[1:-1] > 0.0, -1.0, 1.0)
    beside = np.maximum(np.maximum(-PROMISING, sign * value[:-2]), sign * value[2:])
    return 1 + np.flatnonzero((sign * value[1:-1] >= beside) & (member[:-2] == member[2:]))


def _runs(samples: FloatArray) -> Brackets:
    """Return the runs of positive samples; at an end of the domain, a bracket repeats its sample."""
    member, inside, edge = samples[:, 0], samples[:, 2] > 0.0, np.ones(len(samples) + 1, np.bool_)
    edge[1:-1] = member[1:] != member[:-1]
    cut = edge.copy()
    cut[1:-1] |= inside[1:] != inside[:-1]
    low, high = np.flatnonzero(inside & cut[:-1]), np.flatnonzero(inside & cut[1:])
    at = np.array([[low, np.where(edge[low], low, low - 1)], [high, np.where(edge[high + 1], high, high + 1)]])
    return Brackets(member[low].astype(np.int64), samples[at, 1:].transpose(2, 0, 3, 1).reshape(-1, 2, 4))
