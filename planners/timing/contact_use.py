"""The share of its limits that a motion uses: the pusher's, and the contacts' where inertia counts."""

from __future__ import annotations

import numpy as np

from pushplan.basics.arrays import FloatArray
from pushplan.mechanics.dynamics.contact_dynamics import ContactDynamics
from pushplan.planners.timing.arc_limits import ROOM
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.timing.motion_bounds import limit_use
from pushplan.planners.timing.step_sum import Pieces

ORDERS = np.array([1.0, 2.0, 3.0, 2.0])
"""With which power of the pace each share grows: speed, acceleration, jerk, contact conditions."""

TINY = 1e-12
"""Room (N) that a contact condition counts with at least, so that none left is much used and not a division by 0."""


def bounds_use(pieces: Pieces, bounds: Bounds) -> FloatArray:
    """Return the share (q, 4) of its limits that each piece uses: speed, acceleration, jerk, contacts.

    The first three bound the whole piece. The last one looks at its beginning and its middle, how much inertia
    uses up of what the contacts have to spare above the margin to keep (`arc_limits.ROOM` of it).
    """
    pusher = limit_use(pieces.durations, pieces.coefficients, bounds.limits)
    held = np.zeros(len(pusher))
    if bounds.contacts is not None:
        uses = [_contact_use(pieces, bounds.contacts, bounds.margin, place) for place in (0.0, 0.5)]
        held = np.max(uses, axis=0)
    return np.column_stack([pusher, held])


def _contact_use(pieces: Pieces, contacts: ContactDynamics, margin: float, place: float) -> FloatArray:
    """Share (q,) that is used at one place of every piece, 0 where the pusher rests."""
    time = place * pieces.durations[:, None]
    c0, c1, c2 = (pieces.coefficients[:, j] for j in range(3))
    twists, rates = c0 + time * (c1 + time * c2), c1 + 2.0 * time * c2
    moving = np.abs(twists).max(axis=1) > 0.0
    floor, inertia = contacts.quasi_static(twists[moving]), contacts.inertia(twists[moving], rates[moving])
    room: FloatArray = ROOM * (floor.rows - margin * floor.size[..., None])
    spent = margin * inertia.size[..., None] - inertia.rows
    shares = np.where(spent > 0.0, spent / np.maximum(room, TINY), 0.0)
    used = np.zeros(len(twists))
    used[moving] = np.max(shares, axis=(1, 2))
    return used
