"""Power series of the friction of a polygon whose COR is far away, where closed forms cancel.

In complex notation, z about the anchor point with velocity v0 there: v = v0 (1 + u), u = i omega z / v0, and

    v / |v| = (v0 / |v0|) (1 + u)^(1/2) (1 + conj u)^(-1/2),

a double power series whose integrals over the polygon are its moments M_pq, the integrals of z^p conj(z)^q.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pushplan.basics.arrays import FloatArray
from pushplan.compiled import no_refcount

ComplexArray = NDArray[np.complex128]

ORDER = 10
"""Highest power of u kept."""
REACH = 0.05
"""Largest |omega| radius / |v0| at which the series is used: REACH^(ORDER + 1) is below rounding."""
NEGLIGIBLE = 1e-17
"""Powers of |omega| radius / |v0| below this are left out."""
TERMS = (ORDER + 1) * (ORDER + 2) // 2
WEIGHTS = ((0, 0), (0, 1), (1, 0), (0, 2), (1, 1))
"""Powers (of z, of conj z) of the factors that the integrals of v / |v| are taken with."""
_POWERS = np.array([(p, k - p) for k in range(ORDER + 1) for p in range(k + 1)]).T


@cache
def _gauss_rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Return the Gauss-Legendre nodes and weights (count,) on [-1, 1]."""
    return np.polynomial.legendre.leggauss(count)


def complex_moments(outline: FloatArray, order: int) -> ComplexArray:
    """Return M (order + 1, order + 1), M[p, q] the integral of z^p conj(z)^q over a polygon, p + q <= order.

    Exact: a function homogeneous of degree k integrates to sum_e d_e (its edge integral) / (k + 2), and Gauss
    quadrature integrates polynomials along edges exactly.
    """
    z = outline[:, 0] + 1j * outline[:, 1]
    step = np.roll(z, -1) - z
    nodes, weights = _gauss_rule(order // 2 + 1)
    points = (z[:, None] + step[:, None] * (nodes + 1.0) / 2.0).ravel()
    d_ds = (np.imag(np.conj(z) * step)[:, None] * weights / 2.0).ravel()
    powers = np.vander(points, order + 1, increasing=True)
    degree = np.add.outer(np.arange(order + 1), np.arange(order + 1))
    moments = (powers * d_ds[:, None]).T @ powers.conj() / (degree + 2)
    return np.asarray(np.where(degree <= order, moments, 0.0), dtype=np.complex128)


def _binomials(upper: float) -> FloatArray:
    """Return `upper` over 0 ... ORDER (ORDER + 1,)."""
    k = np.arange(ORDER)
    return np.cumprod(np.append(1.0, (upper - k) / (k + 1.0)))


def series_coefficients(outline: FloatArray, radius: float) -> ComplexArray:
    """Return the coefficients (5, TERMS) of (kappa radius)^p conj(kappa radius)^q, kappa = i omega / v0.

    Row w holds the series of the integral of v / |v| times z^a conj(z)^b with (a, b) = WEIGHTS[w], for v0 >
    0; columns run over the total degree p + q, then over p. `outline` is about the anchor point.
    """
    moments = complex_moments(outline / radius, ORDER + 2) * radius**2
    p, q = _POWERS
    factors = _binomials(0.5)[p] * _binomials(-0.5)[q]
    return np.array([factors * moments[p + a, q + b] * radius ** (a + b) for a, b in WEIGHTS])


@no_refcount
def series_pair(series: ComplexArray, row: int, vx: float, vy: float, spin: float) -> tuple[complex, complex]:
    """Return the integrals of rows `row` and `row` + 1 of `series`.

    Args:
        series: Coefficients of all objects.
        row: Index of the first of the two.
        vx: Velocity v0 of the anchor, like `vy` and `spin` in any common unit, not both zero.
        vy: See `vx`.
        spin: omega times the radius.
    """
    speed = math.sqrt(vx * vx + vy * vy)
    turn = complex(vy, vx) * (math.copysign(1.0, spin) / speed)
    forward, size = turn * turn, math.fabs(spin) / speed
    back, scale, term = complex(1.0, 0.0), 1.0, 0
    first = second = complex(0.0, 0.0)
    for k in range(ORDER + 1):
        power = back * scale
        for _ in range(k + 1):
            first += series[row, term] * power
            second += series[row + 1, term] * power
            power *= forward
            term += 1
        scale *= size
        if scale < NEGLIGIBLE:
            break
        back *= turn.conjugate()
    direction = complex(vx / speed, vy / speed)
    return first * direction, second * direction


@no_refcount
def in_reach(speed: float, omega: float, radius: float) -> bool:
    """Return whether the COR is so far away that the series applies."""
    return math.fabs(omega) * radius < REACH * speed
