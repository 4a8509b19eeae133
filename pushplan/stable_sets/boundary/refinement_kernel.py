"""Meridians as close together as a boundary needs, compiled: `refined_meridians` for compiled margins.

Where neighbouring meridians hold the same number of intervals, the ends between them are looked for where the
neighbours let them be expected; elsewhere meridians are searched as a whole.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.basics.arrays import BoolArray, FloatArray, IntArray
from pushplan.compiled import compiled, inlined, no_refcount
from pushplan.stable_sets.boundary.margin_kernel import Packed
from pushplan.stable_sets.boundary.meridian_kernel import Line, follow, scan
from pushplan.stable_sets.boundary.meridian_tracking import FAN
from pushplan.stable_sets.boundary.refined_meridians import FLATNESS, SMALLEST_GAP
from pushplan.stable_sets.boundary.seed_kernel import is_hopeful

_SMOOTH = 0.3
"""Halving a gap divides the bend of a smooth boundary by 4; by less than 1 / this next to a corner."""
_UNKNOWN = 1e-3
"""How far from the chord an end may be, for a start, rad."""
_LEAST_REACH = 1e-10


@inlined
def _line(longitude: float, length: float, minimum: float) -> Line:
    return np.cos(longitude), np.sin(longitude), length, minimum


@compiled
def _fans(left: FloatArray, right: FloatArray, gap_left: float, gap_right: float) -> FloatArray:
    """Return latitudes around intervals (c, 2) on meridians to both sides; see `meridian_tracking.fan`."""
    out, k = np.empty((len(left) + len(right)) * len(FAN)), 0
    for i in range(len(left) + len(right)):
        low, high = left[i] if i < len(left) else right[i - len(left)]
        reach = max(high - low, 1.5 * (gap_left if i < len(left) else gap_right))
        for share in FAN:
            x = 0.5 * (low + high) + reach * share
            if abs(x) < 0.5 * np.pi:
                out[k], k = x, k + 1
    return out[:k]


@compiled
def _complete(
    packed: Packed, length: float, minimum: float, at: list[float], ends: list[FloatArray], order: IntArray
) -> list[int]:
    """Search meridians with fewer intervals than a neighbour again, around the neighbour's; return which have more.

    The places in `order` (m,) are returned, as a list that begins with -1.
    """
    m, gained = len(order), [-1]
    counts = [len(ends[i]) for i in order]
    for i in range(m):
        before, here, after = order[i - 1], order[i], order[(i + 1) % m]
        if counts[i] < max(counts[i - 1], counts[(i + 1) % m]):
            gaps = [abs(at[side] - at[here]) % (2.0 * np.pi) for side in (before, after)]
            hints = _fans(ends[before], ends[after], gaps[0], gaps[1])
            found = scan(packed, _line(at[here], length, minimum), hints)
            if len(found) > counts[i]:
                ends[here] = found
                gained.append(i)
    return gained


@no_refcount
def _expect(
    left: FloatArray, right: FloatArray, gap: float, bend: FloatArray, guess: FloatArray, reach: FloatArray
) -> None:
    """Fill in where ends (c, 2) may be in the middle of a gap, and how far away from there.

    Great circles join the ends to both sides. One level up, they missed by `bend`: now by a quarter of that.
    """
    for i in range(len(left)):
        for j in range(2):
            chord = math.atan(0.5 * (math.tan(left[i, j]) + math.tan(right[i, j])) / math.cos(0.5 * gap))
            guess[i, j], reach[i, j] = chord, _UNKNOWN
            if len(bend) == len(left):
                guess[i, j] += 0.25 * bend[i, j]
                reach[i, j] = max(0.1 * abs(bend[i, j]), _LEAST_REACH)


@no_refcount
def _largest(bend: FloatArray) -> float:
    largest = 0.0
    for i in range(len(bend)):
        largest = max(largest, abs(bend[i, 0]), abs(bend[i, 1]))
    return largest


@inlined
def _halved(
    packed: Packed, line: Line, left: FloatArray, right: FloatArray, gap: float, bend: FloatArray
) -> tuple[FloatArray, FloatArray, bool]:
    """Return the intervals (c, 2) in the middle of a gap, their distances from the chords, and whether to go on.

    Args:
        packed: Has a compiled margin.
        line: The meridian in the middle.
        left: Intervals on the left side of the gap.
        right: Intervals on its right side.
        gap: Width, rad.
        bend: (c, 2) distances from the chords one level up; another shape when they are not known.
    """
    alike, good = len(left) == len(right), False
    guess, reach = np.empty_like(left), np.empty_like(left)
    found = left
    if alike:
        _expect(left, right, gap, bend, guess, reach)
        good, found = follow(packed, line, guess, reach)
    if not good:
        found = scan(packed, line, _fans(left, right, 0.5 * gap, 0.5 * gap))
    off = np.empty((0, 2))
    if not alike or len(found) != len(left):
        return found, off, True
    known, off = len(bend) == len(left), np.empty_like(found)
    for i in range(len(off)):
        for j in range(2):
            off[i, j] = found[i, j] - guess[i, j] + (0.25 * bend[i, j] if known else 0.0)
    worst = _largest(off)
    smooth = known and worst <= 4.0 * FLATNESS and worst <= _SMOOTH * _largest(bend)
    return found, off, not (worst <= FLATNESS or smooth)


@compiled
def _refine(
    packed: Packed,
    length: float,
    minimum: float,
    at: list[float],
    after: list[int],
    ends: list[FloatArray],
    left: list[int],
) -> None:
    """Halve the gaps to the right of some meridians until the boundary is flat; append what is found.

    `after` holds the index of the next meridian, so that they keep their order.
    """
    right, bends = [after[i] for i in left], [np.empty((0, 2)) for _ in left]
    while len(left):
        i, j, bend = left.pop(), right.pop(), bends.pop()
        gap = at[j] - at[i]
        if gap <= SMALLEST_GAP or len(ends[i]) + len(ends[j]) == 0:
            continue
        line = _line(0.5 * (at[i] + at[j]), length, minimum)
        found, off, more = _halved(packed, line, ends[i], ends[j], gap, bend)
        k = len(at)
        at.append(0.5 * (at[i] + at[j]))
        ends.append(found)
        after.append(j)
        after[i] = k
        if more:
            for first, last in ((i, k), (k, j)):
                left.append(first)
                right.append(last)
                bends.append(off)


@compiled
def _in_order(after: list[int]) -> IntArray:
    """Return the indices of all meridians from the first to the last."""
    order, i = np.empty(len(after), dtype=np.int64), 0
    for k in range(len(after)):
        order[k], i = i, after[i]
    return order


@compiled
def refined(
    packed: Packed, length: float, minimum: float, longitude: FloatArray, hope: BoolArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return all longitudes (m,) in order, the number of intervals (m,) on each, and these (k, 2).

    Args:
        packed: Has a compiled margin.
        length: Characteristic length, m.
        minimum: Margin that the intervals exceed.
        longitude: To begin with, in order, from -pi to pi, one in every component that may be narrow.
        hope: Where meridians are worth a search; see `seeds`.
    """
    at, after = list(longitude), [i + 1 for i in range(len(longitude))]
    ends = [np.empty((0, 2)) for _ in at]
    for i in range(len(at)):
        if is_hopeful(hope, at[i]):
            ends[i] = scan(packed, _line(at[i], length, minimum), np.empty(0))
    order = _in_order(after)
    while len(_complete(packed, length, minimum, at, ends, order)) > 1:
        pass
    todo = list(range(len(at) - 1))
    while len(todo):
        _refine(packed, length, minimum, at, after, ends, todo)
        order = _in_order(after)
        m = len(order)
        for i in _complete(packed, length, minimum, at, ends, order)[1:]:
            if i > 0:
                todo.append(order[i - 1])
            if i < m - 1:
                todo.append(order[i])
    counts = np.array([len(ends[i]) for i in order])
    rows, k = np.empty((counts.sum(), 2)), 0
    for i in order:
        for low, high in ends[i]:
            rows[k, 0], rows[k, 1], k = low, high, k + 1
    return np.array(at)[order], counts, rows
