"""Rigorous bounds on a trajectory's speed, acceleration and jerk in the world, piece by piece.

With the twist (v, omega) a quadratic of time in the body frame, the contact midpoint has, in that frame,

    acceleration  v' + omega J v                                    of degree 4,
    jerk          v'' + 2 omega J v' + omega' J v - omega^2 v        of degree 6.

A polynomial curve lies in the convex hull of its Bernstein coefficients, so none of its points is longer than
the longest of these.
"""

from __future__ import annotations

import math
from math import comb

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.compiled import compiled, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.mechanics.chain import Limits

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
    linear = np.array([limits.speed, limits.acceleration, limits.jerk])
    angular = np.array([limits.angular_speed, limits.angular_acceleration, limits.angular_jerk])
    return _limit_use(durations, coefficients, linear, angular)


@compiled
def _limit_use(
    durations: FloatArray, coefficients: FloatArray, linear: FloatArray, angular: FloatArray
) -> FloatArray:
    out = np.empty((len(durations), 3))
    for i in range(len(durations)):
        _piece_use(durations[i], coefficients[i], linear, angular, out[i])
    return out


@no_refcount
def _piece_use(
    duration: float, coefficients: FloatArray, linear: FloatArray, angular: FloatArray, out: FloatArray
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
    out[0] = max(_longest(twist[:, :2]) / linear[0], _longest(twist[:, 2:]) / angular[0])
    out[1] = max(_longest(acceleration) / linear[1], _longest(first[:, 2:]) / angular[1])
    out[2] = max(_longest(jerk) / linear[2], _longest(second[:, 2:]) / angular[2])


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
