"""Rigorous bounds on a trajectory's speed, acceleration and jerk in the world, piece by piece.

With the twist (v, omega) a quadratic of time in the body frame, the contact midpoint has, in that frame,

    acceleration  v' + omega J v                                    of degree 4,
    jerk          v'' + 2 omega J v' + omega' J v - omega^2 v        of degree 6.

A polynomial curve lies in the convex hull of its Bernstein coefficients, so none of its points is longer than
the longest of these.
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.mechanics.chain import Limits

ROUNDING = 1e-9
"""Signs are not told of coefficients that are smaller by this factor than the largest one."""


def limit_use(durations: FloatArray, coefficients: FloatArray, limits: Limits) -> FloatArray:
    """Return bounds on the share of its limits that each piece of a trajectory uses.

    Args:
        durations: (q,) of the pieces, s.
        coefficients: (q, 3, 3) of the twist, lowest order first.
        limits: Of the pusher.

    Returns:
        (q, 3): of speed, acceleration and jerk, the larger of the linear and the angular share.
    """
    powers = durations[:, None, None] ** np.arange(3)[:, None]
    twist = coefficients * powers  # polynomials of time / duration
    per_time = 1.0 / durations[:, None, None]
    v, omega = twist[:, :, :2], twist[:, :, 2:]
    dv, domega = _derivative(v) * per_time, _derivative(omega) * per_time
    ddv, ddomega = _derivative(dv) * per_time, _derivative(domega) * per_time
    turned = _turned(v)
    acceleration = _sum(dv, _product(omega, turned))
    jerk = _sum(
        ddv,
        2.0 * _product(omega, _turned(dv)),
        _product(domega, turned),
        -_product(_product(omega, omega), v),
    )
    power = np.sum(_products(acceleration, v), axis=2, keepdims=True)
    shares = [
        np.maximum(
            _longest(v) / _bound_of(v[:, :, :1], limits.both("speed")),
            _used(omega, limits.both("angular_speed")),
        ),
        np.maximum(
            _longest(acceleration) / _bound_of(power, limits.both("acceleration")),
            _used(domega, limits.both("angular_acceleration")),
        ),
        np.maximum(_longest(jerk) / limits.jerk, _longest(ddomega) / limits.angular_jerk),
    ]
    return np.stack(shares, axis=1)


def _bound_of(sign: FloatArray, both: tuple[float, float]) -> FloatArray:
    """Bound (q,) on what has another one where polynomials (q, n, 1) are negative; the smaller where unclear."""
    hull = _bernstein(sign)[..., 0]
    tiny = ROUNDING * np.abs(hull).max(initial=0.0)
    negative, positive = hull.min(axis=1) < -tiny, hull.max(axis=1) > tiny
    return np.where(negative, np.where(positive, min(both), both[0]), both[1])


def _used(p: FloatArray, both: tuple[float, float]) -> FloatArray:
    """Largest share (q,) of their bounds that polynomials (q, n, 1) take on either side."""
    hull = _bernstein(p)[..., 0]
    return np.asarray(np.maximum(-hull.min(axis=1) / both[0], hull.max(axis=1) / both[1]))


def top_rates(durations: FloatArray, coefficients: FloatArray, reach: float) -> FloatArray:
    """Return bounds (q,) on the speed of any point within `reach` (m) of the origin on each piece, m/s."""
    twist = coefficients * durations[:, None, None] ** np.arange(3)[:, None]
    return _longest(twist[:, :, :2]) + reach * _longest(twist[:, :, 2:])


def _derivative(p: FloatArray) -> FloatArray:
    return p[:, 1:] * np.arange(1, p.shape[1])[:, None]


def _turned(p: FloatArray) -> FloatArray:
    return np.stack([-p[..., 1], p[..., 0]], axis=-1)


def _product(scalar: FloatArray, p: FloatArray) -> FloatArray:
    """Products (q, m + n - 1, d) of polynomials (q, m, 1) and (q, n, d)."""
    out = np.zeros((len(p), scalar.shape[1] + p.shape[1] - 1, p.shape[2]))
    for i in range(scalar.shape[1]):
        out[:, i : i + p.shape[1]] += scalar[:, i : i + 1] * p
    return out


def _products(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products (q, m + n - 1, d) of polynomials (q, m, d) and (q, n, d), component by component."""
    parts = [_product(a[..., k : k + 1], b[..., k : k + 1]) for k in range(a.shape[2])]
    return np.concatenate(parts, axis=2)


def _sum(*polynomials: FloatArray) -> FloatArray:
    out = np.zeros((len(polynomials[0]), max(p.shape[1] for p in polynomials), polynomials[0].shape[2]))
    for p in polynomials:
        out[:, : p.shape[1]] += p
    return out


def _longest(p: FloatArray) -> FloatArray:
    """Length (q,) of the longest Bernstein coefficient of polynomials (q, n, d) over [0, 1]."""
    return np.asarray(np.linalg.norm(_bernstein(p), axis=2).max(axis=1))


def _bernstein(p: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("kj,qjd->qkd", _to_bernstein(p.shape[1] - 1), p))


@cache
def _to_bernstein(degree: int) -> FloatArray:
    """Matrix from power to Bernstein coefficients on [0, 1]."""
    return np.array(
        [
            [comb(k, j) / comb(degree, j) if j <= k else 0.0 for j in range(degree + 1)]
            for k in range(degree + 1)
        ]
    )
