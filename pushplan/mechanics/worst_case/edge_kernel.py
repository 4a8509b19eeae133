"""A row of contact conditions along the edges of a support polygon, for a unit load that slides there.

A load at x that moves with v = v0 + omega J x adds to a row (gamma, kappa) the amount

    q(x) = u . (gamma + kappa J x),   u = v / |v|.

On an edge x = p + s t the velocity is a t + rho J t with a constant a and rho = rho_0 + omega s, and

    gamma + kappa J x = d t + e J t,    d constant, e = e_0 + kappa s,
    q   = (a d + rho e) / r,            r = sqrt(a^2 + rho^2),
    q'  = kappa rho / r + omega a (a e - d rho) / r^3,
    q'' = omega a ((2 omega d - kappa a) rho^2 - 3 a (omega e_0 - kappa rho_0) rho
                   + a^2 (2 kappa a - omega d)) / r^5,

so that q has at most three stretches on each of which it is convex or concave.
"""

from __future__ import annotations

import math

from pushplan.compiled import no_refcount
from pushplan.mechanics.worst_case.area_table import (
    ASKED,
    C_X,
    C_Y,
    FOUND,
    HEAD,
    LENGTH,
    OMEGA,
    PARTS,
    SEEN,
    SIZE,
    STRETCH,
    T_X,
    T_Y,
    V_X,
    V_Y,
)
from pushplan.util.arrays import FloatArray

A, RHO, D, E, CURVE = FOUND, FOUND + 1, FOUND + 2, FOUND + 3, FOUND + 4
"""Columns of an edge: a, rho_0, d, e_0, the polynomial of q'' (factors of 1, rho, rho^2). From STRETCH on, two
convex stretches: begin, end and the slopes of q there, which are equal where there is no such stretch."""

TINY = 1e-9
"""Part of the size of a support that counts as no distance from the centre of rotation."""
_STEPS = 60


@no_refcount
def edge_value(table: FloatArray, k: int, s: float) -> float:
    """Return q at s on the edge in row k."""
    a, rho = table[k, A], table[k, RHO] + table[ASKED, OMEGA] * s
    e = table[k, E] + table[ASKED, SEEN + 2] * s
    return float((a * table[k, D] + rho * e) / math.sqrt(a * a + rho * rho))


@no_refcount
def edge_slope(table: FloatArray, k: int, s: float) -> float:
    """Return dq / ds at s on the edge in row k."""
    omega, kappa, a = table[ASKED, OMEGA], table[ASKED, SEEN + 2], table[k, A]
    rho, e = table[k, RHO] + omega * s, table[k, E] + kappa * s
    r = 1.0 / math.sqrt(a * a + rho * rho)
    return float(r * (kappa * rho + omega * a * (a * e - table[k, D] * rho) * r * r))


@no_refcount
def describe_edge(table: FloatArray, k: int) -> None:
    """Fill the columns from FOUND on of the edge in row k, for the twist and the row that edges see.

    With the centre of rotation on the line of the edge there are no stretches: q is affine on either side.
    """
    x, y, tx, ty = table[k, C_X], table[k, C_Y], table[k, T_X], table[k, T_Y]
    omega, kappa = table[ASKED, OMEGA], table[ASKED, SEEN + 2]
    vx, vy = table[ASKED, V_X] - omega * y, table[ASKED, V_Y] + omega * x
    cx, cy = table[ASKED, SEEN] - kappa * y, table[ASKED, SEEN + 1] + kappa * x
    a, rho, d, e = vx * tx + vy * ty, vy * tx - vx * ty, cx * tx + cy * ty, cy * tx - cx * ty
    table[k, A], table[k, RHO], table[k, D], table[k, E] = a, rho, d, e
    for column in range(STRETCH, STRETCH + 2 * PARTS):
        table[k, column] = 0.0
    if omega == 0.0 or math.fabs(a) <= TINY * table[HEAD, SIZE] * math.fabs(omega):
        return
    table[k, CURVE] = omega * a * a * a * (2.0 * kappa * a - omega * d)
    table[k, CURVE + 1] = -3.0 * omega * a * a * (omega * e - kappa * rho)
    table[k, CURVE + 2] = omega * a * (2.0 * omega * d - kappa * a)
    _find_stretches(table, k)


@no_refcount
def _find_stretches(table: FloatArray, k: int) -> None:
    """Fill the convex stretches of an edge from the roots of the polynomial of q''."""
    c, b, a = table[k, CURVE], table[k, CURVE + 1], table[k, CURVE + 2]
    rho, omega, length = table[k, RHO], table[ASKED, OMEGA], table[k, LENGTH]
    disc = b * b - 4.0 * a * c
    first, second = 0.0, 0.0
    if disc > 0.0:
        half = -0.5 * (b + math.copysign(math.sqrt(disc), b))
        one = (c / half - rho) / omega if half != 0.0 else 0.0
        two = (half / a - rho) / omega if a != 0.0 else 0.0
        first, second = min(max(min(one, two), 0.0), length), min(max(max(one, two), 0.0), length)
    begin, column = 0.0, STRETCH
    for part in range(3):
        end = first if part == 0 else (second if part == 1 else length)
        middle = rho + omega * 0.5 * (begin + end)
        if end > begin and c + middle * (b + middle * a) > 0.0:
            table[k, column], table[k, column + 1] = begin, end
            table[k, column + 2], table[k, column + 3] = (
                edge_slope(table, k, begin),
                edge_slope(table, k, end),
            )
            column += PARTS
        begin = max(begin, end)


@no_refcount
def lowest_gap(
    table: FloatArray, k: int, column: int, start: float, height: float, slope: float, accuracy: float
) -> tuple[float, float]:
    """Return where q(s) - height - slope s is least on a convex stretch whose end slopes enclose `slope`.

    Args:
        table: See `area_table`.
        k: Row of the edge.
        column: Where the stretch begins.
        start: First guess of s.
        height: Of the straight line at s = 0.
        slope: Of the straight line.
        accuracy: How exact the least has to be where it is not far below 0.

    Returns:
        s, and a number that no value on the stretch falls below.
    """
    omega, kappa, a, d = table[ASKED, OMEGA], table[ASKED, SEEN + 2], table[k, A], table[k, D]
    low, high = table[k, column], table[k, column + 1]
    s = start if low < start < high else 0.5 * (low + high)
    bound = 0.0
    for _ in range(_STEPS):
        rho, e = table[k, RHO] + omega * s, table[k, E] + kappa * s
        r = 1.0 / math.sqrt(a * a + rho * rho)
        value = (a * d + rho * e) * r - height - slope * s
        miss = r * (kappa * rho + omega * a * (a * e - d * rho) * r * r) - slope
        if miss > 0.0:
            high = s
        else:
            low = s
        bound = value - math.fabs(miss) * (high - low)
        if value - bound <= max(accuracy, -0.05 * value):
            break
        curve = (table[k, CURVE] + rho * (table[k, CURVE + 1] + rho * table[k, CURVE + 2])) * r**5
        step = s - miss / curve if curve > 0.0 else low
        s = step if low < step < high else 0.5 * (low + high)
    return s, bound
