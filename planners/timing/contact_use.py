"""The share of its limits that a motion uses: the pusher's, and the contacts' where inertia counts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled
from pushplan.planners.timing.arc_limits import ROOM
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.timing.motion_bounds import limit_use
from pushplan.planners.timing.step_sum import Pieces
from pushplan.util.arrays import FloatArray, IntArray

ORDERS = np.array([1.0, 2.0, 3.0, 2.0])
"""With which power of the pace each share grows: speed, acceleration, jerk, contact conditions."""

TINY = 1e-12
"""Room (N) that a contact condition counts with at least, so that none left is much used and not a division by 0."""


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
    pusher = limit_use(pieces.durations, pieces.coefficients, bounds.limits)
    held, slowing = np.zeros(len(pusher)), np.ones(len(pusher))
    if bounds.contacts is not None:
        twists, rates, piece = _instants(pieces.durations, pieces.coefficients)
        floor, inertia = bounds.contacts.quasi_static(twists), bounds.contacts.inertia(twists, rates)
        steady = bounds.contacts.inertia(twists, np.zeros_like(rates))
        _note_shares(*floor, *inertia, *steady, bounds.margin, piece, held, slowing)
    return Use(np.column_stack([pusher, held]), slowing)


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
    steady: FloatArray,
    steady_size: FloatArray,
    margin: float,
    piece: IntArray,
    used: FloatArray,
    slowing: FloatArray,
) -> None:
    """Raise shares and slowing (q,) of pieces to those of their instants (k,), from the rows and sizes of `Wrenches`.

    What inertia asks for at a steady twist stays when the twist changes more slowly; the rest shrinks in proportion.
    """
    for i in range(len(piece)):
        share, factor = used[piece[i]], slowing[piece[i]]
        for n in range(floor.shape[1]):
            for j in range(4):
                room = max(ROOM * (floor[i, n, j] - margin * floor_size[i, n]), TINY)
                spent = margin * inertia_size[i, n] - inertia[i, n, j]
                share = max(share, spent / room)
                if spent > room:
                    kept = margin * steady_size[i, n] - steady[i, n, j]
                    factor = max(factor, (spent - kept) / max(room - kept, TINY))
        used[piece[i]], slowing[piece[i]] = share, factor
