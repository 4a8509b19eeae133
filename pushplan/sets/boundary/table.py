"""Meridians of the twist sphere and the stable intervals on them, in the order in which they were looked at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.mechanics.sphere import Meridians
from pushplan.util.arrays import FloatArray, IntArray


class Table(NamedTuple):
    """Meridians and their intervals.

    Attributes:
        at: (m,) longitudes, rad.
        counts: (m,) number of intervals on each.
        ends: (m, c, 2) their lower and upper ends, rad; nan beyond the counts.
        bend: (m, c, 2) how far an end is from the great circle between the neighbours that the meridian was put
            between, divided by the product of the distances from both, 1/rad; nan where that is not known.
    """

    at: FloatArray
    counts: IntArray
    ends: FloatArray
    bend: FloatArray

    @classmethod
    def of(cls, at: FloatArray, member: IntArray, ends: FloatArray) -> Table:
        """Return meridians at longitudes (m,) with the intervals `ends` (k, 2) of the members (k,), in order."""
        counts = np.bincount(member, minlength=len(at))
        slot = np.arange(len(member)) - (np.cumsum(counts) - counts)[member]
        table = np.full((2, len(at), max(counts.max(initial=0), 1), 2), np.nan)
        table[0, member, slot] = ends
        return cls(at, counts, table[0], table[1])

    def joined(self, other: Table) -> Table:
        """Return these meridians, and others after them."""
        width = max(self.ends.shape[1], other.ends.shape[1])
        one, more = self._widened(width), other._widened(width)
        return Table(
            np.concatenate([one.at, more.at]),
            np.concatenate([one.counts, more.counts]),
            np.concatenate([one.ends, more.ends]),
            np.concatenate([one.bend, more.bend]),
        )

    def replaced(self, index: IntArray, other: Table) -> Table:
        """Return the table with others in the place of the meridians `index`."""
        kept = np.arange(len(self.at))
        kept[index] = len(self.at) + np.arange(len(index))
        return self.joined(other).chosen(kept)

    def chosen(self, index: IntArray) -> Table:
        """Return some of the meridians."""
        return Table(self.at[index], self.counts[index], self.ends[index], self.bend[index])

    def meridians(self) -> Meridians:
        """Return the rows of all intervals."""
        rows = self.ends[np.arange(self.ends.shape[1]) < self.counts[:, None]]
        return Meridians(np.repeat(self.at, self.counts), rows[:, 0], rows[:, 1])

    def _widened(self, width: int) -> Table:
        more = ((0, 0), (0, width - self.ends.shape[1]), (0, 0))
        if not more[1][1]:
            return self
        ends, bend = (np.pad(each, more, constant_values=np.nan) for each in (self.ends, self.bend))
        return Table(self.at, self.counts, ends, bend)
