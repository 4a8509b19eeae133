"""Where members of a family of functions are positive, from nothing but their values."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled
from pushplan.sets.boundary.asked import PROMISING
from pushplan.sets.boundary.bracketing import Family, inner_ends, maximise
from pushplan.util.arrays import FloatArray, IntArray

_STEPS = 14
_PARTS, _CLOSE = 5, 0.01


class Brackets(NamedTuple):
    """Intervals in which a member is positive, sorted by member, then by place.

    Attributes:
        member: (k,) whose they are.
        ends: (k, 2, 4) brackets of the lower and the upper end; see `inner_ends`.
    """

    member: IntArray
    ends: FloatArray

    def narrowed(self, f: Family) -> FloatArray:
        """Return the ends (k, 2); they are inside."""
        member = np.repeat(self.member, 2)
        return inner_ends(lambda i, x: f(member[i], x), self.ends.reshape(-1, 4)).reshape(-1, 2)


def joined(parts: list[Brackets]) -> Brackets:
    """Return the brackets of all parts, of which each has members of its own."""
    if len(parts) == 1:
        return parts[0]
    member = np.concatenate([np.empty(0, np.int64), *(part.member for part in parts)])
    ends = np.concatenate([np.empty((0, 2, 4)), *(part.ends for part in parts)])
    order = np.argsort(member, kind="stable")
    return Brackets(member[order], ends[order])


def sampled(f: Family, member: IntArray, x: FloatArray) -> FloatArray:
    """Return samples (k, 3) of members: member, place and value."""
    return np.column_stack([member, x, f(member, x)])


def find_intervals(f: Family, samples: FloatArray) -> Brackets:
    """Return all intervals with f > 0 that samples, or peaks and dips between samples, tell of.

    Args:
        f: f(i, x), continuous or not; values at or below -PROMISING need not be exact.
        samples: (k, 3) member, place and value, sorted by member, then by place.
    """
    member, x = _between(samples)
    if len(x):
        samples = _joined(samples, sampled(f, member, x))
    at = _extremes(samples)
    if len(at):
        before, here, after = samples[at - 1], samples[at], samples[at + 1]
        member, sign = here[:, 0].astype(np.int64), np.where(here[:, 2] > 0.0, -1.0, 1.0)
        ends = sign * before[:, 2], sign * after[:, 2]
        x, best = maximise(
            lambda i, x: sign[i] * f(member[i], x), before[:, 1], after[:, 1], 0.0, _STEPS, ends
        )
        beyond = best > 0.0
        if beyond.any():
            samples = _joined(samples, np.column_stack([member, x, sign * best])[beyond])
    return Brackets(*_runs(samples))


def _joined(*samples: FloatArray) -> FloatArray:
    """Return samples (k, 3), sorted by member, then by place."""
    rows = np.concatenate(samples)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]


@compiled
def _between(samples: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return where to look closer, in every wide gap with a change of sign, as there may be several."""
    member, x, k = np.empty(len(samples) * _PARTS, np.int64), np.empty(len(samples) * _PARTS), 0
    for i in range(len(samples) - 1):
        here, after = samples[i], samples[i + 1]
        far = here[0] == after[0] and after[1] - here[1] > _CLOSE
        if far and (here[2] > 0.0) != (after[2] > 0.0):
            for j in range(1, _PARTS):
                member[k], x[k], k = int(here[0]), here[1] + (after[1] - here[1]) * j / _PARTS, k + 1
    return member[:k], x[:k]


@compiled
def _extremes(samples: FloatArray) -> IntArray:
    """Return which samples are peaks below 0 or dips above, with samples of the same member to both sides."""
    at, k = np.empty(len(samples), np.int64), 0
    for i in range(1, len(samples) - 1):
        before, here, after = samples[i - 1], samples[i], samples[i + 1]
        sign = -1.0 if here[2] > 0.0 else 1.0
        highest = sign * here[2] >= max(-PROMISING, sign * before[2], sign * after[2])
        if highest and before[0] == here[0] == after[0]:
            at[k], k = i, k + 1
    return at[:k]


@compiled
def _runs(samples: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the runs of positive samples, with brackets of their ends; at the domain's end, a sample twice."""
    member, ends, k = np.empty(len(samples), np.int64), np.empty((len(samples), 2, 4)), 0
    for i in range(len(samples)):
        here = samples[i]
        if not here[2] > 0.0:
            continue
        for j in range(2):
            other = min(max(i + 2 * j - 1, 0), len(samples) - 1)
            other = other if samples[other, 0] == here[0] else i
            if other == i or not samples[other, 2] > 0.0:
                ends[k, j, 0], ends[k, j, 1] = here[1], samples[other, 1]
                ends[k, j, 2], ends[k, j, 3] = here[2], samples[other, 2]
                member[k], k = int(here[0]), k + j
    return member[:k], ends[:k]
