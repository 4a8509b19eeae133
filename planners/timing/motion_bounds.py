"""Upper bounds of what a motion uses of its limits between samples: of speeds, accelerations, jerks, and contacts."""

from __future__ import annotations

import math
from math import comb
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.mechanics.chain import LimitName, Limits
from pushplan.planners.timing.arc_limits import ROOM, Bounds
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


ROUNDING = 1e-9
"""Signs are not told of coefficients that are smaller by this factor than the largest one."""

_MOST = 6
_TO_BERNSTEIN = np.array(
    [
        [
            [comb(k, j) / comb(n, j) if j <= min(k, n) else 0.0 for j in range(_MOST + 1)]
            for k in range(_MOST + 1)
        ]
        for n in range(_MOST + 1)
    ]
)
"""[n] is the matrix from power to Bernstein coefficients on [0, 1] of polynomials of degree n."""


def limit_use(durations: FloatArray, coefficients: FloatArray, limits: Limits) -> FloatArray:
    """Return bounds on the share of its limits that each piece of a trajectory uses.

    Args:
        durations: (q,) of the pieces, s.
        coefficients: (q, 3, 3) of the twist, lowest order first.
        limits: Of the pusher.

    Returns:
        (q, 3): of speed, acceleration and jerk, the larger of the linear and the angular share.
    """
    names: tuple[LimitName, ...] = ("speed", "acceleration", "angular_speed", "angular_acceleration")
    sides = np.array([limits.both(name) for name in names])
    return _limit_use(durations, coefficients, sides, np.array([limits.jerk, limits.angular_jerk]))


@compiled
def _limit_use(
    durations: FloatArray, coefficients: FloatArray, sides: FloatArray, jerks: FloatArray
) -> FloatArray:
    out = np.empty((len(durations), 3))
    for i in range(len(durations)):
        _piece_use(durations[i], coefficients[i], sides, jerks, out[i])
    return out


@no_refcount
def _piece_use(
    duration: float, coefficients: FloatArray, sides: FloatArray, jerks: FloatArray, out: FloatArray
) -> None:
    """Fill in the shares (3,) of one piece; polynomials have rows (x, y, turn) and are those of time / duration."""
    twist, first, second = scratch(3, 3), scratch(2, 3), scratch(1, 3)
    for c in range(3):
        for j in range(3):
            twist[j, c] = coefficients[j, c] * duration**j
        first[0, c], first[1, c] = twist[1, c] / duration, 2.0 * twist[2, c] / duration
        second[0, c] = first[1, c] / duration
    acceleration, jerk = scratch(5, 2), scratch(7, 2)
    acceleration[:], jerk[:] = 0.0, 0.0
    for c in range(2):
        jerk[0, c] = second[0, c]
        for j in range(2):
            acceleration[j, c] = first[j, c]
    for i in range(3):
        for j in range(3):
            acceleration[i + j, 0] -= twist[i, 2] * twist[j, 1]
            acceleration[i + j, 1] += twist[i, 2] * twist[j, 0]
            if j < 2:
                jerk[i + j, 0] -= 2.0 * twist[i, 2] * first[j, 1]
                jerk[i + j, 1] += 2.0 * twist[i, 2] * first[j, 0]
                jerk[i + j, 0] -= first[j, 2] * twist[i, 1]
                jerk[i + j, 1] += first[j, 2] * twist[i, 0]
            for k in range(3):
                for c in range(2):
                    jerk[i + j + k, c] -= twist[i, 2] * twist[j, 2] * twist[k, c]
    power = scratch(7, 1)  # whether the speed grows: acceleration . v
    power[:] = 0.0
    for i in range(5):
        for j in range(3):
            power[i + j, 0] += acceleration[i, 0] * twist[j, 0] + acceleration[i, 1] * twist[j, 1]
    speed, gain = _longest(twist[:, :2]), _longest(acceleration)
    out[0] = max(speed / _bound_of(twist[:, :1], sides[0]), _used(twist[:, 2:], sides[2]))
    out[1] = max(gain / _bound_of(power, sides[1]), _used(first[:, 2:], sides[3]))
    out[2] = max(_longest(jerk) / jerks[0], _longest(second[:, 2:]) / jerks[1])


@no_refcount
def _bound_of(sign: FloatArray, both: FloatArray) -> float:
    """Bound on what has another one where a polynomial (n, 1) is negative; the smaller one where that is unclear."""
    low, high = _hull(sign)
    tiny = ROUNDING * max(-low, high)
    if low >= -tiny:
        return float(both[1])
    return float(min(both[0], both[1]) if high > tiny else both[0])


@no_refcount
def _used(p: FloatArray, both: FloatArray) -> float:
    """Largest share of its bounds that a polynomial (n, 1) takes on either side."""
    low, high = _hull(p)
    return float(max(-low / both[0], high / both[1]))


@no_refcount
def _hull(p: FloatArray) -> tuple[float, float]:
    """Smallest and largest Bernstein coefficient over [0, 1] of a polynomial (n, 1), lowest order first."""
    low, high, degree = math.inf, -math.inf, p.shape[0] - 1
    for k in range(degree + 1):
        value = 0.0
        for j in range(k + 1):
            value += _TO_BERNSTEIN[degree, k, j] * p[j, 0]
        low, high = min(low, value), max(high, value)
    return low, high


@compiled
def top_rates(durations: FloatArray, coefficients: FloatArray, reach: float) -> FloatArray:
    """Return bounds (q,) on the speed of any point within `reach` (m) of the origin on each piece, m/s."""
    out, twist = np.empty(len(durations)), np.empty((3, 3))
    for i in range(len(durations)):
        for j in range(3):
            twist[j] = coefficients[i, j] * durations[i] ** j
        out[i] = _longest(twist[:, :2]) + reach * _longest(twist[:, 2:])
    return out


@no_refcount
def _longest(p: FloatArray) -> float:
    """Length of the longest Bernstein coefficient over [0, 1] of a polynomial (n, d), lowest order first."""
    longest, degree = 0.0, p.shape[0] - 1
    for k in range(degree + 1):
        square = 0.0
        for c in range(p.shape[1]):
            value = 0.0
            for j in range(k + 1):
                value += _TO_BERNSTEIN[degree, k, j] * p[j, c]
            square += value * value
        longest = max(longest, square)
    return math.sqrt(longest)
