"""A twist as quadratics of time, one after the other, and upper bounds of what they use of the limits in between."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import pushplan.core.timing as timing
from pushplan.mechanics.chain import LimitName, Limits
from pushplan.planners.timing.arc_limits import ROOM, Bounds
from pushplan.util.arrays import FloatArray, IntArray


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

    @classmethod
    def through(cls, levels: FloatArray, centers: FloatArray, widths: FloatArray) -> Pieces:
        """Return the twist through levels (m + 1, 3) by m smooth steps; see `core.timing.step_sum`."""
        return cls(*timing.step_sum(levels, centers, widths))

    @property
    def motion(self) -> FloatArray:
        """(3,) pose at the end, seen from the beginning."""
        return np.asarray(timing.poses_after(np.zeros(3), self.coefficients, self.durations)[-1])


ORDERS = np.array([1.0, 2.0, 3.0, 2.0])
"""With which power of the pace each share grows: speed, acceleration, jerk, contact conditions."""


class Use(NamedTuple):
    """What the pieces of a motion use of its limits.

    Attributes:
        shares: (q, 4) of speed, acceleration, jerk and contact conditions; a limit is kept up to 1.
        slowing: (q,) factor by which the same twists have to change more slowly for the contacts to hold.
    """

    shares: FloatArray
    slowing: FloatArray


def bounds_use(pieces: Pieces, bounds: Bounds) -> Use:
    """Return what each piece uses of its limits.

    The first three shares bound the whole piece. The last one looks at its beginning and its middle, how much inertia
    uses up of what the contacts have to spare above the margin to keep (`arc_limits.ROOM` of it).
    """
    pusher = limit_use(pieces, bounds.limits)
    held, slowing = np.zeros(len(pusher)), np.ones(len(pusher))
    if bounds.contacts is not None:
        twists, rates, piece = timing.instants(pieces.durations, pieces.coefficients)
        floor, inertia = bounds.contacts.quasi_static(twists), bounds.contacts.inertia(twists, rates)
        steady = bounds.contacts.inertia(twists, np.zeros_like(rates))
        held, slowing = timing.contact_use(floor, inertia, steady, piece, len(pusher), bounds.margin, ROOM)
    return Use(np.column_stack([pusher, held]), slowing)


def limit_use(pieces: Pieces, limits: Limits) -> FloatArray:
    """Return bounds (q, 3) on the share of the pusher's limits of speed, acceleration and jerk that each piece uses.

    Each is the larger one of the linear and the angular share.
    """
    names: tuple[LimitName, ...] = ("speed", "acceleration", "angular_speed", "angular_acceleration")
    sides = np.array([limits.both(name) for name in names])
    return timing.limit_use(*pieces[:2], sides, limits.jerk, limits.angular_jerk)
