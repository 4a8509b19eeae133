"""A twist that passes through given levels, one smooth step after the other, several under way at a time.

V(t) = V_0 + sum_j (V_j+1 - V_j) b_j(t), where b_j is a step from 0 to 1 of widths (long, short) around its
centre c_j: a jump averaged over both windows, so that V is a quadratic of time between the steps' phases.

Where steps overlap, V is still a weighted mean of the levels, the weight of level j being b_j-1 - b_j. The
weights are not negative if neither width changes faster along the steps than the centres do: b_j is the
distribution function of X_j = c_j + long_j u + short_j w with the same u, w in [-1/2, 1/2] for all j, and then
X_j-1 <= X_j whatever u and w are. `ordered_widths` sees to that. Hence a convex set that contains the levels
contains V.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, inlined, no_refcount
from pushplan.util.arrays import FloatArray, IntArray

_GAUSS = math.sqrt(3.0) / 6.0


@inlined
def _twist(c: FloatArray, tau: float) -> tuple[float, float, float]:
    """Return c0 + c1 tau + c2 tau^2 for c (3, 3)."""
    return (
        c[0, 0] + tau * (c[1, 0] + tau * c[2, 0]),
        c[0, 1] + tau * (c[1, 1] + tau * c[2, 1]),
        c[0, 2] + tau * (c[1, 2] + tau * c[2, 2]),
    )


@no_refcount
def _step(c: FloatArray, begin: float, end: float) -> tuple[float, float, float]:
    """Return the motion under the twist c0 + c1 tau + c2 tau^2, (3, 3), from `begin` to `end`; see `advance`."""
    h, middle = end - begin, 0.5 * (begin + end)
    early, late = middle - _GAUSS * h, middle + _GAUSS * h
    ax, ay, aw = _twist(c, early)
    bx, by, bw = _twist(c, late)
    bracket = math.sqrt(3.0) / 12.0 * h * h
    x = 0.5 * h * (ax + bx) + bracket * (bw * ay - aw * by)
    y = 0.5 * h * (ay + by) + bracket * (aw * bx - bw * ax)
    half = 0.25 * h * (aw + bw)
    chord = 1.0 if abs(half) < 1e-8 else math.sin(half) / half
    p, q = chord * math.cos(half), chord * math.sin(half)
    return p * x - q * y, q * x + p * y, 2.0 * half


@compiled
def poses_after(start: FloatArray, coefficients: FloatArray, durations: FloatArray) -> FloatArray:
    """Return the poses (q + 1, 3) at the ends of pieces with twists `coefficients` (q, 3, 3), from `start` on."""
    out = np.empty((len(durations) + 1, 3))
    out[0] = start
    for i in range(len(durations)):
        x, y, turn = _step(coefficients[i], 0.0, durations[i])
        c, s = math.cos(out[i, 2]), math.sin(out[i, 2])
        out[i + 1, 0] = out[i, 0] + c * x - s * y
        out[i + 1, 1] = out[i, 1] + s * x + c * y
        out[i + 1, 2] = out[i, 2] + turn
    return out


FINEST = 0.02
"""Longest piece (s) on which the twist changes direction: a Magnus step over it is good to about 1e-11 m."""

MOST_OF_PHASE = 500
"""Pieces of one phase of a step, at most: 10 s of the finest. A slower step needs no more of them, since the error of
Magnus steps falls with the fourth power of their number, however long the phase takes."""

SAME_TIME = 1e-9
"""Phases that begin closer together (s) are one."""


class Pieces(NamedTuple):
    """A twist as one quadratic of time after the other.

    Attributes:
        durations: (q,) s.
        coefficients: (q, 3, 3) of the twist from the beginning of each piece on, lowest order first.
        level: (q,) index of the level that a piece belongs to: that of the last step that is over.
    """

    durations: FloatArray
    coefficients: FloatArray
    level: IntArray

    @property
    def motion(self) -> FloatArray:
        """(3,) pose at the end, seen from the beginning."""
        return np.asarray(poses_after(np.zeros(3), self.coefficients, self.durations)[-1])


@compiled
def ordered_widths(centers: FloatArray, widths: FloatArray) -> FloatArray:
    """Return the smallest widths (m, 2), none below `widths`, whose steps keep the levels' weights positive."""
    found = widths.copy()
    for i in range(len(centers)):
        for j in range(len(centers)):
            apart = abs(centers[i] - centers[j])
            for k in range(2):
                found[i, k] = max(found[i, k], widths[j, k] - apart)
    return found


def step_sum(levels: FloatArray, centers: FloatArray, widths: FloatArray) -> Pieces:
    """Return the twist through `levels`.

    Args:
        levels: (m + 1, 3) body twists.
        centers: (m,) times of the steps between them, never decreasing, s.
        widths: (m, 2) their long and short windows, s; those of a step between equal levels do not matter.
    """
    return Pieces(*_step_sum(levels, centers, widths))


@compiled
def _step_sum(
    levels: FloatArray, centers: FloatArray, widths: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    begin, end, widths = centers.copy(), centers.copy(), widths.copy()
    for j in range(len(centers)):
        if (levels[j + 1] == levels[j]).all():
            widths[j] = 0.0
        half = (widths[j, 0] + widths[j, 1]) / 2.0
        begin[j], end[j] = centers[j] - half, centers[j] + half
    breaks = _breaks(begin, end, widths)
    coefficients, level = np.empty((len(breaks) - 1, 3, 3)), np.zeros(len(breaks) - 1, np.int64)
    _add_steps(levels, begin, widths, breaks, coefficients)
    for i in range(len(level)):
        for j in range(len(end)):
            level[i] += int(0.5 * (breaks[i] + breaks[i + 1]) > end[j])
    return np.diff(breaks), coefficients, level


@compiled
def _breaks(begin: FloatArray, end: FloatArray, widths: FloatArray) -> FloatArray:
    """Times at which a phase begins or ends, and finer ones in between wherever a step is under way."""
    phases = _phases(begin, end, widths)
    counts = np.ones(len(phases) - 1, np.int64)
    for i in range(len(counts)):
        middle = 0.5 * (phases[i] + phases[i + 1])
        if ((begin < middle) & (middle < end)).any():
            counts[i] = min(math.ceil((phases[i + 1] - phases[i]) / FINEST), MOST_OF_PHASE)
    breaks, q = np.empty(counts.sum() + 1), 0
    for i in range(len(counts)):
        for k in range(counts[i]):
            breaks[q] = phases[i] + k / counts[i] * (phases[i + 1] - phases[i])
            q += 1
    breaks[q] = phases[-1]
    return breaks


@compiled
def _phases(begin: FloatArray, end: FloatArray, widths: FloatArray) -> FloatArray:
    """Times at which a phase of a step begins or ends, increasing by more than `SAME_TIME`."""
    times, count = np.empty(4 * len(begin)), 0
    for j in range(len(begin)):
        short = widths[j, 1]
        for time in (begin[j], begin[j] + short, end[j] - short, end[j]):
            k = count
            while k > 0 and times[k - 1] > time:  # in order nearly: neighbours overlap at most
                times[k] = times[k - 1]
                k -= 1
            times[k] = time
            count += 1
    kept, last = 1, times[0]
    for k in range(1, count):
        if times[k] - last > SAME_TIME:
            times[kept] = times[k]
            kept += 1
        last = times[k]
    return times[:kept]


@compiled
def _add_steps(
    levels: FloatArray, begin: FloatArray, widths: FloatArray, breaks: FloatArray, coefficients: FloatArray
) -> None:
    """Fill in the coefficients (q, 3, 3) of first level and steps on the pieces between `breaks` (q + 1,)."""
    for i in range(len(coefficients)):
        piece, middle = coefficients[i], 0.5 * (breaks[i] + breaks[i + 1])
        for d in range(3):
            piece[0, d], piece[1, d], piece[2, d] = levels[0, d], 0.0, 0.0
        for j in range(len(begin)):
            if middle >= begin[j]:
                shape = _phase(breaks[i] - begin[j], middle - begin[j], widths[j, 0], widths[j, 1])
                for d in range(3):
                    step = levels[j + 1, d] - levels[j, d]
                    piece[0, d] += shape[0] * step
                    piece[1, d] += shape[1] * step
                    piece[2, d] += shape[2] * step


@no_refcount
def _phase(u: float, into: float, long: float, short: float) -> tuple[float, float, float]:
    """Coefficients of a step b_j about a time `u` after its beginning, in the phase at the time `into` after it."""
    w = long + short - u
    if into > long + short:
        return 1.0, 0.0, 0.0
    if into > long:
        return 1.0 - w * w / (2.0 * long * short), w / (long * short), -1.0 / (2.0 * long * short)
    if into > short:
        return (u - short / 2.0) / long, 1.0 / long, 0.0
    return u * u / (2.0 * long * short), u / (long * short), 1.0 / (2.0 * long * short)
