"""The moments of a plan that matter to its contacts: as few as have the same least margins as all of them.

Along an arc of constant twist V = s' xi every contact condition, whatever the chain, is linear in (s'', s'^2): among
all samples of the arc it is least at a corner of their convex hull in that plane.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from pushplan.util.arrays import BoolArray, FloatArray, IntArray

SAME = 1e-11
"""Difference up to which two directions, or a rate and its part along the twist, count as the same."""


class Instants(NamedTuple):
    """Moments of a motion, in the chain frame.

    Attributes:
        directions: (m, 3) twists per max(|v_x|, |v_y|, |omega| length): what the floor's friction depends on.
        twists: (m, 3) m/s, rad/s.
        rates: (m, 3) their time derivatives, m/s^2, rad/s^2.
        group: (m,) equal for neighbours of the same direction.
    """

    directions: FloatArray
    twists: FloatArray
    rates: FloatArray
    group: IntArray

    def chosen(self, which: IntArray) -> Instants:
        """Return the moments with the indices `which` (k,)."""
        return Instants(self.directions[which], self.twists[which], self.rates[which], self.group[which])


def thinned_instants(twists: FloatArray, rates: FloatArray, length: float) -> Instants:
    """Return the moments of a motion that can be the worst ones.

    Args:
        twists: (m, 3) body twists, none zero.
        rates: (m, 3) their time derivatives.
        length: The chain's characteristic length, m.
    """
    size = np.abs(twists * [1.0, 1.0, length]).max(axis=1)
    directions = twists / size[:, None]
    acceleration = (rates * directions).sum(axis=1) / (directions**2).sum(axis=1)
    astray = np.abs(rates - acceleration[:, None] * directions).max(axis=1)
    along = astray <= SAME * np.maximum(1.0, np.abs(acceleration))
    alike = (np.abs(np.diff(directions, axis=0)).max(axis=1) <= SAME) & along[1:] & along[:-1]
    group = np.concatenate([[0], np.cumsum(~alike)]).astype(np.int64)
    first = np.flatnonzero(np.concatenate([[True], ~alike]))
    return _corners(directions[first], along[first], group, np.stack([acceleration, size**2], axis=1), rates)


def _corners(
    directions: FloatArray, along: BoolArray, group: IntArray, points: FloatArray, rates: FloatArray
) -> Instants:
    """Return the corners of each group's hull of (s'', s'^2); a moment that is no arc's is a group of its own."""
    twice = 1 + (np.diff(group, prepend=-1) > 0)  # a line has two points, also where a group has but one
    lines = shapely.linestrings(np.repeat(points, twice, axis=0), indices=np.repeat(group, twice))
    hulls = shapely.convex_hull(lines)
    corners, which = shapely.get_coordinates(hulls, return_index=True)
    unit = directions[which]
    found = corners[:, :1] * unit
    alone = np.logical_not(along[which])
    found[alone] = rates[np.searchsorted(group, which[alone])]
    return Instants(unit, np.sqrt(corners[:, 1:]) * unit, np.ascontiguousarray(found), which.astype(np.int64))
