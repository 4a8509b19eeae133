"""The intervals on a meridian between two others, where these let them be expected.

Great circles join the ends on both sides. One level up, they missed by `bend` times the distances from both.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import compiled, inlined
from pushplan.mechanics.sphere import POLE
from pushplan.sets.boundary.table import Table
from pushplan.util.arrays import FloatArray, IntArray

_UNKNOWN = 0.5
"""How large a bend may be, for a start, 1/rad."""
_DOUBTFUL = 0.4
"""By how much of itself a bend may change from one level to the next; at corners by more."""
_LEAST_REACH = 1e-10

Gaps = tuple[IntArray, IntArray, FloatArray]
"""Meridians (g,) of a table to the left and to the right, and longitudes (g,) between these."""


@compiled
def chord(table: Table, a: int, b: int, x: float, i: int, j: int) -> float:
    """Return the latitude at longitude x of the great circle that joins an end on two meridians."""
    first, last = math.sin(table.at[b] - x), math.sin(x - table.at[a])
    height = first * math.tan(table.ends[a, i, j]) + last * math.tan(table.ends[b, i, j])
    return math.atan(height / math.sin(table.at[b] - table.at[a]))


@inlined
def _expected(table: Table, a: int, b: int, x: float, i: int, j: int) -> tuple[float, float]:
    """Return where an end may be at longitude x between two meridians, and how far away from there."""
    span, bend = (x - table.at[a]) * (table.at[b] - x), table.bend[max(a, b), i, j]
    guess = chord(table, a, b, x, i, j)
    if math.isnan(bend):
        return guess, max(_UNKNOWN * span, _LEAST_REACH)
    return guess + bend * span, max(_DOUBTFUL * abs(bend) * span, _LEAST_REACH)


@compiled
def probes(table: Table, gaps: Gaps, chosen: IntArray, wider: float) -> tuple[IntArray, FloatArray]:
    """Return gaps (k,) and latitudes (k,) that tell whether as many intervals as to both sides are as expected.

    They are, for each interval, outside and inside of its lower end, its middle, inside and outside of the upper one;
    and one between two intervals.
    """
    left, right, middle = gaps
    most = 6 * len(chosen) * table.ends.shape[1]
    member, x, k = np.empty(most, np.int64), np.empty(most), 0
    for g in chosen:
        a, b = left[g], right[g]
        for i in range(table.counts[a] if table.counts[a] == table.counts[b] else 0):
            first, half = k + min(i, 1), 0.0
            for j in range(2):
                outward = 2.0 * j - 1.0
                guess, reach = _expected(table, a, b, middle[g], i, j)
                x[first + 4 * j] = min(max(guess + outward * wider * reach, -POLE), POLE)
                x[first + 1 + 2 * j] = guess - outward * wider * reach
                if outward * guess >= POLE:
                    x[first + 1 + 2 * j] = outward * POLE
                half += 0.5 * guess
            x[first + 1], x[first + 2], x[first + 3] = min(x[first + 1], half), half, max(x[first + 3], half)
            if i > 0:
                x[k] = 0.5 * (x[k - 1] + x[first])
            while k < first + 5:
                member[k], k = g, k + 1
    return member[:k], x[:k]


@compiled
def followed(x: FloatArray, value: FloatArray, member: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the members (c,) of the intervals that are as expected, and brackets (c, 2, 4) of their ends.

    Args:
        x: (k,) latitudes; see `probes`.
        value: (k,) excess there.
        member: (k,) whose it is.
    """
    who, ends, c, k = np.empty(len(x), np.int64), np.empty((len(x), 2, 4)), 0, 0
    while k < len(x):
        first, before, good = c, -math.inf, True
        member_now = member[k]
        while True:
            for j in range(2):
                outside, inside = (k, k + 1) if j == 0 else (k + 4, k + 3)
                pole = abs(x[inside]) >= POLE
                good &= value[inside] > 0.0 and (pole or not value[outside] > 0.0)
                ends[c, j, 0], ends[c, j, 1] = x[inside], x[outside]
                ends[c, j, 2], ends[c, j, 3] = value[inside], value[outside]
            good &= value[k + 2] > 0.0 and x[k] > before and x[k] <= x[k + 2] <= x[k + 4]
            who[c], c, before, k = member_now, c + 1, x[k + 4], k + 5
            if k == len(x) or member[k] != member_now:
                break
            good &= not value[k] > 0.0
            k += 1
        if not good:
            c = first
    return who[:c], ends[:c]
