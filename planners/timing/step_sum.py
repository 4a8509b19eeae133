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

from typing import NamedTuple

import numpy as np

from pushplan.basics.arrays import FloatArray, IntArray
from pushplan.compiled import compiled, no_refcount
from pushplan.planners.timing.motion_kernel import poses_after

FINEST = 0.02
"""Longest piece (s) on which the twist changes direction: a Magnus step over it is good to about 1e-11 m."""

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


def ordered_widths(centers: FloatArray, widths: FloatArray) -> FloatArray:
    """Return the smallest widths (m, 2), none below `widths`, whose steps keep the levels' weights positive."""
    apart = np.abs(centers[:, None] - centers[None, :])
    return np.asarray(np.max(widths[None] - apart[:, :, None], axis=1))


def step_sum(levels: FloatArray, centers: FloatArray, widths: FloatArray) -> Pieces:
    """Return the twist through `levels`.

    Args:
        levels: (m + 1, 3) body twists.
        centers: (m,) times of the steps between them, never decreasing, s.
        widths: (m, 2) their long and short windows, s; those of a step between equal levels do not matter.
    """
    moving = np.abs(np.diff(levels, axis=0)).max(axis=1) > 0.0
    widths = np.where(moving[:, None], widths, 0.0)
    begin, end = centers - widths.sum(axis=1) / 2.0, centers + widths.sum(axis=1) / 2.0
    breaks = _breaks(begin, end, widths)
    coefficients = np.empty((len(breaks) - 1, 3, 3))
    _add_steps(levels, begin, widths, breaks, coefficients)
    level = (0.5 * (breaks[:-1] + breaks[1:])[:, None] > end).sum(axis=1)
    return Pieces(np.diff(breaks), coefficients, level)


def _breaks(begin: FloatArray, end: FloatArray, widths: FloatArray) -> FloatArray:
    """Times at which a phase begins or ends, and finer ones in between wherever a step is under way."""
    short = widths[:, 1]
    phases = np.unique(np.concatenate([begin, begin + short, end - short, end]))
    phases = phases[np.concatenate([[True], np.diff(phases) > SAME_TIME])]
    middle = 0.5 * (phases[:-1] + phases[1:])
    busy = ((begin < middle[:, None]) & (middle[:, None] < end)).any(axis=1)
    counts = np.where(busy, np.ceil(np.diff(phases) / FINEST), 1.0).astype(int)
    owner = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[owner]
    return np.append(phases[owner] + share * np.diff(phases)[owner], phases[-1])


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
