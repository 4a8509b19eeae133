"""The boundary between meridians: followed, refined where it bends, and taken apart into intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, inlined
from pushplan.mechanics.sphere import POLE, Meridians
from pushplan.sets.meridians import (
    PROMISING,
    Asked,
    Family,
    SphereSamples,
    Table,
    climb,
    inner_ends,
    maximise,
)
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


SMALLEST_GAP = 1e-6
"""Longitudes between which intervals begin, end or merge are found to this angle, rad."""
_SHAPE = (72, 37)
"""Samples to begin with: 5 degrees apart."""


@dataclass(frozen=True, eq=False)
class RefinedMeridians:
    """Intervals on meridians between which the boundary runs along great circles, to `FLATNESS`.

    Great circles of the twist sphere are straight lines of the COR plane.

    Attributes:
        longitude: (m,) all longitudes looked at, from -pi to pi, rad.
        meridians: The intervals found on them.
    """

    longitude: FloatArray
    meridians: Meridians


def find_meridians(asked: Asked, longitude: FloatArray) -> Meridians:
    """Return all intervals of latitude with margin > minimum at longitudes (m,), rad.

    The ends returned are inside: the margin exceeds the minimum there.
    """
    table = first_meridians(asked)
    order = np.argsort(table.at)
    around = np.where(np.abs(longitude) > np.pi, np.arctan2(np.sin(longitude), np.cos(longitude)), longitude)
    asked_for = np.argsort(around, kind="stable")
    around = around[asked_for]
    # of each gap, the asked ones from `first` to before `last` are between the meridians `left` and `right`
    cuts = np.searchsorted(around, table.at[order[1:-1]])
    first, last = np.concatenate([[0], cuts]), np.concatenate([cuts, [len(around)]])
    left, right, place = order[:-1], order[1:], np.empty(len(around), np.int64)
    while (first < last).any():
        left, right, first, last = (each[first < last] for each in (left, right, first, last))
        middle, new = (first + last) // 2, len(table.at) + np.arange(len(first))
        table, _ = put_between(asked, table, (left, right, around[middle]))
        place[asked_for[middle]] = new
        left, right = np.concatenate([left, new]), np.concatenate([new, right])
        first, last = np.concatenate([first, middle + 1]), np.concatenate([middle, last])
    gained = place
    while len(gained):
        table, gained = search_again(asked, table)
    found = table.chosen(place)
    return found._replace(at=longitude).meridians()


def refine_meridians(asked: Asked) -> RefinedMeridians:
    """Return the meridians of a set, halving gaps until the boundary is known to `FLATNESS`."""
    table = first_meridians(asked)
    doubtful = np.arange(len(table.at))
    while len(doubtful):
        order = np.argsort(table.at)
        k = np.flatnonzero(np.isin(order[:-1], doubtful) | np.isin(order[1:], doubtful))
        table = _refined(asked, table, order[k], order[k + 1])
        table, doubtful = search_again(asked, table)
    table = table.chosen(np.argsort(table.at))
    return RefinedMeridians(table.at, table.meridians())


def _refined(asked: Asked, table: Table, left: IntArray, right: IntArray) -> Table:
    """Halve the gaps between meridians until the boundary is flat there."""
    while True:
        wide = table.at[right] - table.at[left] > SMALLEST_GAP
        k = np.flatnonzero(wide & (table.counts[left] + table.counts[right] > 0))
        if len(k) == 0:
            return table
        left, right, new = left[k], right[k], len(table.at) + np.arange(len(k))
        middle = 0.5 * (table.at[left] + table.at[right])
        table, bent = put_between(asked, table, (left, right, middle))
        left, right, new = left[bent], right[bent], new[bent]
        left, right = np.concatenate([left, new]), np.concatenate([new, right])


def first_meridians(asked: Asked) -> Table:
    """Return meridians a few degrees apart, and one through every component that samples lead to."""
    floor = asked.minimum - PROMISING
    samples = SphereSamples.of(asked.margin, asked.length, floor, _SHAPE)
    at, values = samples.maxima(floor)
    at, values = at[values <= asked.minimum], values[values <= asked.minimum]
    climb(asked.margin, asked.length, at, values, np.pi / _SHAPE[1], asked.minimum)
    seeds = at[values > asked.minimum]
    longitude = np.concatenate([samples.longitude, np.arctan2(seeds[:, 1], seeds[:, 0])])
    f, rows = asked.excess(longitude), samples.on_meridians(floor)
    rows[:, 2] -= asked.minimum
    latitude = np.tile(samples.latitude, (len(seeds), 1))
    latitude = np.sort(np.column_stack([latitude, np.arcsin(seeds[:, 2])]), axis=1)
    member = len(samples.longitude) + np.repeat(np.arange(len(seeds)), latitude.shape[1])
    found = find_intervals(f, np.concatenate([rows, sampled(f, member, latitude.ravel())]))
    return Table.of(longitude, found.member, found.narrowed(f))
