"""Stable intervals on meridians of the twist sphere: given ones, or as close together as a boundary needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.mechanics.sphere import Meridians
from pushplan.sets.boundary.asked import PROMISING, Asked
from pushplan.sets.boundary.between import put_between, search_again
from pushplan.sets.boundary.intervals import find_intervals, sampled
from pushplan.sets.boundary.peaks import SphereSamples, climb
from pushplan.sets.boundary.table import Table
from pushplan.util.arrays import FloatArray, IntArray

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
