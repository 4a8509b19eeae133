"""Where members of a family of functions are positive, from nothing but their values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pushplan.basics.arrays import BoolArray, FloatArray, IntArray
from pushplan.stable_sets.boundary.bracketing import Family, inner_ends, maximise

PROMISING = 0.35
"""A largest sample below minus this is not searched for a peak, a smallest one above this for no dip."""
_STEPS = 14
_PARTS = 5


class Intervals(NamedTuple):
    """Intervals in which a member is positive, sorted by member, then by place; the ends are inside."""

    member: IntArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True, eq=False)
class Samples:
    """Places x (k,) at which to look at the members (k,) of a family."""

    member: IntArray
    x: FloatArray

    @classmethod
    def on_grid(cls, members: int, grid: FloatArray) -> Samples:
        """Return the samples of `members` members at the same places."""
        return cls(np.repeat(np.arange(members), len(grid)), np.tile(grid, members))

    def joined(self, *others: Samples) -> Samples:
        """Return these samples and the others."""
        parts = (self, *others)
        return Samples(np.concatenate([p.member for p in parts]), np.concatenate([p.x for p in parts]))


@dataclass(frozen=True, eq=False)
class _Values:
    """Samples with values, sorted by member, then by place."""

    member: IntArray
    x: FloatArray
    value: FloatArray

    @classmethod
    def sorted(cls, member: IntArray, x: FloatArray, value: FloatArray) -> _Values:
        order = np.lexsort((x, member))
        return cls(member[order], x[order], value[order])

    def joined(self, member: IntArray, x: FloatArray, value: FloatArray) -> _Values:
        """Return these values and further ones."""
        return _Values.sorted(
            np.concatenate([self.member, member]),
            np.concatenate([self.x, x]),
            np.concatenate([self.value, value]),
        )

    def has_next(self) -> BoolArray:
        """Return (k,) whether the sample after each one belongs to the same member."""
        return np.append(self.member[1:] == self.member[:-1], False)


def find_intervals(f: Family, samples: Samples) -> Intervals:
    """Return all intervals with f > 0 that samples, or peaks and dips between samples, tell of.

    Args:
        f: f(i, x), continuous or not; values at or below -PROMISING need not be exact.
        samples: Places to look at, the ends of the domain among them.

    Returns:
        Intervals whose ends are enclosed to `bracketing.TOLERANCE`.
    """
    values = _Values.sorted(samples.member, samples.x, f(samples.member, samples.x))
    return _positive_runs(f, _with_extremes(f, _with_edges(f, values)))


def _with_edges(f: Family, values: _Values) -> _Values:
    """Return the samples with some more in every gap with a change of sign, as there may be several."""
    positive = values.value > 0.0
    k = np.flatnonzero(values.has_next() & (positive != np.roll(positive, -1)))
    shares = np.arange(1, _PARTS) / _PARTS
    x = values.x[k][:, None] + (values.x[k + 1] - values.x[k])[:, None] * shares
    member = np.repeat(values.member[k], len(shares))
    return values.joined(member, x.ravel(), f(member, x.ravel()))


def _with_extremes(f: Family, values: _Values) -> _Values:
    """Return the samples with peaks above 0 and dips below 0 that lie between them."""
    after = values.has_next()
    inner, found = after & np.roll(after, 1), values
    for sign in (+1.0, -1.0):
        v = sign * values.value
        extreme = (v >= np.roll(v, 1)) & (v >= np.roll(v, -1)) & (v <= 0.0) & (v > -PROMISING)
        k = np.flatnonzero(inner & extreme)
        x, best = maximise(_signed(f, values.member[k], sign), values.x[k - 1], values.x[k + 1], 0.0, _STEPS)
        beyond = best > 0.0
        found = found.joined(values.member[k][beyond], x[beyond], sign * best[beyond])
    return found


def _signed(f: Family, members: IntArray, sign: float) -> Family:
    return lambda i, x: sign * f(members[i], x)


def _positive_runs(f: Family, values: _Values) -> Intervals:
    """Return the runs of positive samples, extended to their exact ends."""
    positive, after = values.value > 0.0, values.has_next()
    before = np.roll(after, 1)
    begins = np.flatnonzero(positive & ~(before & np.roll(positive, 1)))
    stops = np.flatnonzero(positive & ~(after & np.roll(positive, -1)))
    lower = _ends(f, values, begins, np.where(before[begins], begins - 1, begins))
    upper = _ends(f, values, stops, np.where(after[stops], stops + 1, stops))
    return Intervals(values.member[begins], lower, upper)


def _ends(f: Family, values: _Values, inside: IntArray, outside: IntArray) -> FloatArray:
    """Return the exact ends between samples inside and outside, the same sample at the domain's end."""
    x, value = values.x, values.value
    family = _signed(f, values.member[inside], 1.0)
    return inner_ends(family, x[inside], x[outside], value[inside], value[outside])
