"""Power series of the friction of a polygon whose COR is far away, where closed forms cancel.

In complex notation, z about the anchor point with velocity v0 there: v = v0 (1 + u), u = i omega z / v0, and

    v / |v| = (v0 / |v0|) (1 + u)^(1/2) (1 + conj u)^(-1/2),

a double power series whose integrals over the polygon are its moments M_pq, the integrals of z^p conj(z)^q. With
kappa = i omega / v0 and its size r and direction e, kappa^p conj(kappa)^q = r^(p + q) e^(p - q): the powers of e with
m = p - q and m = -m are added up together, each with a polynomial in r^2 (Horner's rule). Term by term, every power
would wait for the one before it.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pushplan.compiled import no_refcount
from pushplan.util.arrays import FloatArray

ComplexArray = NDArray[np.complex128]

ORDER = 10
"""Highest power of u kept."""
REACH = 0.05
"""Largest |omega| radius / |v0| at which the series is used: REACH^(ORDER + 1) is below rounding."""
NEGLIGIBLE = 1e-17
"""Powers of |omega| radius / |v0| below this are left out, for pushes that are straight or nearly so."""
_PAIRS = [(m, h) for m in range(ORDER + 1) for h in reversed(range((ORDER - m) // 2 + 1))]
"""Powers m of the direction e, and h of r^2, in the order in which they are added up."""
TERMS = 2 * len(_PAIRS)
WEIGHTS = ((0, 0), (0, 1), (1, 0), (0, 2), (1, 1))
"""Powers (of z, of conj z) of the factors that the integrals of v / |v| are taken with."""


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


_M, _H = np.array(_PAIRS).T
_FACTORS = np.outer(_binomials(0.5), _binomials(-0.5))
_AHEAD, _BACK = _FACTORS[_M + _H, _H], np.where(_M > 0, _FACTORS[_H, _M + _H], 0.0)
_A, _B = np.array(WEIGHTS).T[:, :, None]
_P, _Q, _P_BACK, _Q_BACK = _M + _H + _A, _H + _B, _H + _A, _M + _H + _B
"""Coefficients, and powers of z and conj z, of the columns with p - q = m and with p - q = -m."""


def series_coefficients(outline: FloatArray, radius: float) -> ComplexArray:
    """Return the coefficients (5, TERMS) of (kappa radius)^p conj(kappa radius)^q, kappa = i omega / v0.

    Row w holds the series of the integral of v / |v| times z^a conj(z)^b with (a, b) = WEIGHTS[w], for v0 > 0; for
    each of _PAIRS two columns, sum and difference of the coefficients with p - q = m and p - q = -m. `outline` is
    about the anchor point.
    """
    moments = complex_moments(outline / radius, ORDER + 2) * radius**2
    scale = np.array([radius ** (a + b) for a, b in WEIGHTS])[:, None]
    ahead, back = scale * _AHEAD * moments[_P, _Q], scale * _BACK * moments[_P_BACK, _Q_BACK]
    return np.asarray(np.stack([ahead + back, ahead - back], axis=-1).reshape(len(WEIGHTS), TERMS))


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
    ux, uy = vx / speed, vy / speed
    size = math.fabs(spin) / speed
    square, turned = size * size, math.copysign(size, spin)
    zx, zy = uy * turned, ux * turned  # kappa radius
    top = 1 if square < NEGLIGIBLE else 4 if square * square * size < NEGLIGIBLE else ORDER
    x = y = u = w = 0.0
    px, py, end = 1.0, 0.0, 0
    for m in range(top + 1):
        end += 2 * ((ORDER - m) // 2 + 1)
        ar = ai = br = bi = cr = ci = dr = di = 0.0  # sum and difference, of either row
        for k in range(end - 2 * ((top - m) // 2 + 1), end, 2):
            a, b, c, d = series[row, k], series[row, k + 1], series[row + 1, k], series[row + 1, k + 1]
            ar, ai, br, bi = (
                ar * square + a.real,
                ai * square + a.imag,
                br * square + b.real,
                bi * square + b.imag,
            )
            cr, ci, dr, di = (
                cr * square + c.real,
                ci * square + c.imag,
                dr * square + d.real,
                di * square + d.imag,
            )
        x, y = x + px * ar - py * bi, y + px * ai + py * br
        u, w = u + px * cr - py * di, w + px * ci + py * dr
        px, py = px * zx - py * zy, px * zy + py * zx
    return complex(x * ux - y * uy, x * uy + y * ux), complex(u * ux - w * uy, u * uy + w * ux)


@no_refcount
def in_reach(speed: float, omega: float, radius: float) -> bool:
    """Return whether the COR is so far away that the series applies."""
    return math.fabs(omega) * radius < REACH * speed
