"""The boundary between meridians: followed, refined where it bends, and taken apart into intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

import pushplan.core.boundary as boundary
from pushplan.mechanics.sphere import Meridians
from pushplan.sets.meridians import Asked, Family, SphereSamples, Table, climb, inner_ends, maximise
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

_WIDER = (1.0, 10.0, 100.0)
"""How many times farther than expected ends are looked for; next to a corner the second is what it takes."""

Gaps = tuple[IntArray, IntArray, FloatArray]
"""Meridians (g,) of a table to the left and to the right, and longitudes (g,) between these."""


def put_between(asked: Asked, table: Table, gaps: Gaps) -> tuple[Table, BoolArray]:
    """Return the table with meridians put into gaps, and in which gaps (g,) the boundary is not flat yet."""
    left, right, middle = gaps
    f, found = asked.excess(middle), []
    lost = table.counts[left] + table.counts[right] > 0
    for wider in _WIDER:
        member, x = boundary.probes(table, gaps, np.flatnonzero(lost), wider)
        if len(x) == 0:
            break
        found.append(Brackets(*boundary.followed(x, f(member, x), member)))
        lost[found[-1].member] = False
    if lost.any():
        found.append(_searched(f, table, gaps, np.flatnonzero(lost)))
    whole = joined(found)
    new = Table.of(middle, whole.member, whole.narrowed(f))
    bend, more = boundary.bends(table, gaps, new)
    return table.joined(new._replace(bend=bend)), more


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
    member, x = boundary.fans(table, gaps, chosen)
    order = np.lexsort((x, member))
    return find_intervals(f, sampled(f, member[order], x[order]))


_STEPS = 14


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
        f: f(i, x), continuous or not; values at or below -`boundary.PROMISING` need not be exact.
        samples: (k, 3) member, place and value, sorted by member, then by place.
    """
    member, x = boundary.between(samples)
    if len(x):
        samples = _joined(samples, sampled(f, member, x))
    at = boundary.extremes(samples)
    if len(at):
        before, here, after = samples[at - 1], samples[at], samples[at + 1]
        member, sign = here[:, 0].astype(np.int64), np.where(here[:, 2] > 0.0, -1.0, 1.0)
        ends = sign * before[:, 2], sign * after[:, 2]
        x, best = maximise(lambda i, x: sign[i] * f(member[i], x), before[:, 1], after[:, 1], 0.0, _STEPS, ends)
        beyond = best > 0.0
        if beyond.any():
            samples = _joined(samples, np.column_stack([member, x, sign * best])[beyond])
    return Brackets(*boundary.runs(samples))


def _joined(*samples: FloatArray) -> FloatArray:
    """Return samples (k, 3), sorted by member, then by place."""
    rows = np.concatenate(samples)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]


SMALLEST_GAP = 1e-6
"""Longitudes between which intervals begin, end or merge are found to this angle, rad."""
_SHAPE = (72, 37)
"""Samples to begin with: 5 degrees apart."""


@dataclass(frozen=True, eq=False)
class RefinedMeridians:
    """Intervals on meridians between which the boundary runs along great circles, to `boundary.FLATNESS`.

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
    """Return the meridians of a set, halving gaps until the boundary is known to `boundary.FLATNESS`."""
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
    floor = asked.minimum - boundary.PROMISING
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
