"""The share of its limits that a motion uses: the pusher's, and the contacts' where inertia counts."""

from __future__ import annotations

import numpy as np

from pushplan.basics.arrays import FloatArray, IntArray
from pushplan.compiled import compiled
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
        twists, rates, piece = _instants(pieces.durations, pieces.coefficients)
        floor, inertia = bounds.contacts.quasi_static(twists), bounds.contacts.inertia(twists, rates)
        _note_shares(*floor, *inertia, bounds.margin, piece, held)
    return np.column_stack([pusher, held])


@compiled
def _instants(durations: FloatArray, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return twists and their rates (k, 3) where pieces (k,) begin and half-way, unless at rest."""
    twists, rates = np.empty((2 * len(durations), 3)), np.empty((2 * len(durations), 3))
    piece, k = np.empty(2 * len(durations), np.int64), 0
    for i in range(len(durations)):
        c = coefficients[i]
        for time in (0.0, 0.5 * durations[i]):
            moving = False
            for j in range(3):
                twists[k, j] = c[0, j] + time * (c[1, j] + time * c[2, j])
                rates[k, j] = c[1, j] + 2.0 * time * c[2, j]
                moving = moving or twists[k, j] != 0.0
            piece[k] = i
            k += int(moving)
    return twists[:k], rates[:k], piece[:k]


@compiled
def _note_shares(
    floor: FloatArray,
    floor_size: FloatArray,
    inertia: FloatArray,
    inertia_size: FloatArray,
    margin: float,
    piece: IntArray,
    used: FloatArray,
) -> None:
    """Raise the shares (q,) of pieces to those of their instants (k,), from the rows and sizes of `Wrenches`."""
    for i in range(len(piece)):
        share = used[piece[i]]
        for n in range(floor.shape[1]):
            room, extra = margin * floor_size[i, n], margin * inertia_size[i, n]
            for j in range(4):
                spent = extra - inertia[i, n, j]
                share = max(share, spent / max(ROOM * (floor[i, n, j] - room), TINY))
        used[piece[i]] = share
