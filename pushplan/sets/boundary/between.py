"""Meridians put between others, where these let their intervals be expected, and searched where they do not."""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import compiled
from pushplan.mechanics.sphere import POLE
from pushplan.sets.boundary.asked import Asked
from pushplan.sets.boundary.bracketing import Family
from pushplan.sets.boundary.following import Gaps, chord, followed, probes
from pushplan.sets.boundary.intervals import Brackets, find_intervals, joined, sampled
from pushplan.sets.boundary.table import Table
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

FLATNESS = 1e-6
"""Largest angle by which the boundary may leave the great circle between neighbouring meridians, rad."""
_SMOOTH = 0.3
"""Halving a gap divides the bend of a smooth boundary by 4; by less than 1 / this next to a corner."""
_WIDER = (1.0, 10.0, 100.0)
"""How many times farther than expected ends are looked for; next to a corner the second is what it takes."""
_WIDE_GAP = 0.02
"""Meridians that are no closer to the next than this, rad, are sampled from pole to pole when in doubt."""
_ROUNDING = 1e-14
"""What is left of a bend is rounding where the distances from both neighbours have no larger product, rad^2."""
_GRID = np.linspace(-POLE, POLE, 17)
_FAN = np.linspace(-1.5, 1.5, 13)


def put_between(asked: Asked, table: Table, gaps: Gaps) -> tuple[Table, BoolArray]:
    """Return the table with meridians put into gaps, and in which gaps (g,) the boundary is not flat yet."""
    left, right, middle = gaps
    f, found = asked.excess(middle), []
    lost = table.counts[left] + table.counts[right] > 0
    for wider in _WIDER:
        member, x = probes(table, gaps, np.flatnonzero(lost), wider)
        if len(x) == 0:
            break
        found.append(Brackets(*followed(x, f(member, x), member)))
        lost[found[-1].member] = False
    if lost.any():
        found.append(_searched(f, table, gaps, np.flatnonzero(lost)))
    whole = joined(found)
    new = Table.of(middle, whole.member, whole.narrowed(f))
    more = _bends(table, gaps, new)
    return table.joined(new), more


def search_again(asked: Asked, table: Table) -> tuple[Table, IntArray]:
    """Search meridians with fewer intervals than a neighbour again, around those of both.

    The first and the last meridian are neighbours, or at the same place.

    Returns:
        The table, and which meridians of it have more intervals than before.
    """
    order = np.argsort(table.at)
    before, after = np.roll(order, 1), np.roll(order, -1)
    k = np.flatnonzero(table.counts[order] < np.maximum(table.counts[before], table.counts[after]))
    poor = order[k]
    f = asked.excess(table.at[poor])
    found = _searched(f, table, (before[k], after[k], table.at[poor]), np.arange(len(k)))
    new = Table.of(table.at[poor], found.member, found.narrowed(f))
    gained = np.flatnonzero(new.counts > table.counts[poor])
    return table.replaced(poor[gained], new.chosen(gained)), poor[gained]


def _searched(f: Family, table: Table, gaps: Gaps, chosen: IntArray) -> Brackets:
    member, x = _fans(table, gaps, chosen)
    order = np.lexsort((x, member))
    return find_intervals(f, sampled(f, member[order], x[order]))


@compiled
def _fans(table: Table, gaps: Gaps, chosen: IntArray) -> tuple[IntArray, FloatArray]:
    """Return gaps (k,) and latitudes (k,) around the intervals to both sides of chosen gaps, and the poles.

    A fan opens with the distance in longitude, as intervals may lean. Where gaps are wide, there are more.
    """
    left, right, middle = gaps
    most = len(chosen) * (2 * len(_FAN) * table.ends.shape[1] + len(_GRID))
    member, x, k = np.empty(most, np.int64), np.empty(most), 0
    for g in chosen:
        for side in (left[g], right[g]):
            apart = abs(table.at[side] - middle[g]) % (2.0 * math.pi)
            for i in range(table.counts[side]):
                low, high = table.ends[side, i]
                for share in _FAN:
                    member[k], x[k] = g, 0.5 * (low + high) + max(high - low, 1.5 * apart) * share
                    k += abs(x[k]) < POLE
        for latitude in _GRID:
            member[k], x[k] = g, latitude
            k += abs(latitude) >= POLE or apart > _WIDE_GAP
    return member[:k], x[:k]


@compiled
def _bends(table: Table, gaps: Gaps, found: Table) -> BoolArray:
    """Fill in the bends of meridians found in gaps; return in which gaps (g,) the boundary is not flat yet."""
    left, right, middle = gaps
    more = np.ones(len(left), np.bool_)
    for g in range(len(left)):
        a, b = left[g], right[g]
        if not table.counts[a] == table.counts[b] == found.counts[g]:
            continue
        span, worst, worst_above = (middle[g] - table.at[a]) * (table.at[b] - middle[g]), 0.0, 0.0
        for i in range(found.counts[g]):
            for j in range(2):
                off = found.ends[g, i, j] - chord(table, a, b, middle[g], i, j)
                worst = max(worst, abs(off))
                found.bend[g, i, j] = off / span if span > _ROUNDING else math.nan
                worst_above = max(worst_above, 4.0 * span * abs(table.bend[max(a, b), i, j]))
        smooth = worst <= 4.0 * FLATNESS and worst <= _SMOOTH * worst_above
        more[g] = not (worst <= FLATNESS or smooth)
    return more
