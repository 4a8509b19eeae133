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

from pushplan.arrays import FloatArray, IntArray
from pushplan.geometry import se2
from pushplan.trajectory import advance

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
        steps = advance(self.coefficients, np.zeros(len(self.durations)), self.durations)
        theta = np.concatenate([[0.0], np.cumsum(steps[:, 2])])
        xy = se2.rotate(theta[:-1], steps[:, :2]).sum(axis=0)
        return np.append(xy, theta[-1])


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
    middle = 0.5 * (breaks[:-1] + breaks[1:])
    shape = _phases(breaks[:-1], middle, begin, widths)
    coefficients = np.einsum("qmc,md->qcd", shape, np.diff(levels, axis=0))
    coefficients[:, 0] += levels[0]
    level = (middle[:, None] > end).sum(axis=1)
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


def _phases(at: FloatArray, middle: FloatArray, begin: FloatArray, widths: FloatArray) -> FloatArray:
    """Coefficients (q, m, 3) of every step b_j on every piece, about the piece's beginning `at` (q,)."""
    long, short = widths[:, 0], widths[:, 1]
    area = np.where(long * short > 0.0, long * short, 1.0)
    rising = np.where(long > 0.0, long, 1.0)
    total = long + short
    u = at[:, None] - begin
    w = total - u
    one, zero = np.ones_like(u), np.zeros_like(u)
    into = middle[:, None] - begin
    phase = (into >= 0.0).astype(int) + (into > short) + (into > long) + (into > total)
    forms = np.stack(
        [
            np.stack([zero, zero, zero], axis=-1),
            np.stack([u * u / (2.0 * area), u / area, one / (2.0 * area)], axis=-1),
            np.stack([(u - short / 2.0) / rising, one / rising, zero], axis=-1),
            np.stack([one - w * w / (2.0 * area), w / area, -one / (2.0 * area)], axis=-1),
            np.stack([one, zero, zero], axis=-1),
        ]
    )
    return np.asarray(np.take_along_axis(forms, phase[None, :, :, None], axis=0)[0])
