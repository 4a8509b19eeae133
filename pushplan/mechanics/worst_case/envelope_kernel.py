"""The least that a row of contact conditions can get from one object, over all pressures with its centre.

A unit load at x adds q(x) to a row (see `edge_kernel`). The least of the integral of q over all pressures p
with the centre g is the lower convex envelope of q at g: a linear program with three equations,

    min  sum p_j q(x_j)   with  sum p_j = 1,  sum p_j x_j = g,

whose optimum needs three points. On rays from the centre of rotation c, q is affine; so these are feet, or
points of the outline, or c itself, where the direction of friction is free and q = -|gamma + kappa J c|.
When the push at height h shifts the load, friction moves its centre by -h mu times itself, and x_j - h mu u_j
takes the place of x_j in the last equation.

The simplex method with all points of all edges as columns solves it: the plane a + b . y through the three
basic loads is compared with q on every edge; the lowest points found, all corners and c form a pool, on which
the simplex method runs to its end before the edges are searched again. Whatever has been reached when that
stops, the plane moved down by the largest shortfall lies below q everywhere: its height at g is a safe answer.
"""

from __future__ import annotations

import math

from pushplan.compiled import no_refcount
from pushplan.mechanics.worst_case.area_table import (
    ASKED,
    AT,
    BASIS,
    C_X,
    C_Y,
    CORNERS,
    COUNT,
    EDGE,
    FILLED,
    G_X,
    G_Y,
    HEAD,
    INSIDE,
    LOAD,
    NUDGE_X,
    NUDGE_Y,
    OMEGA,
    PART,
    PARTS,
    ROW,
    SEEN,
    SHIFT,
    SIZE,
    SOLID,
    STRETCH,
    T_X,
    T_Y,
    U_X,
    U_Y,
    V_X,
    V_Y,
    X_X,
    X_Y,
    Y_X,
    Y_Y,
    Q,
)
from pushplan.mechanics.worst_case.edge_kernel import TINY, describe_edge, lowest_gap
from pushplan.mechanics.worst_case.touching_kernel import touching_plane
from pushplan.util.arrays import FloatArray

TOLERANCE = 1e-10
"""Within how much of the row's size the least is found."""
_ROUNDS, _PIVOTS = 60, 60
_FLAT = 1e-12


@no_refcount
def start_twist(table: FloatArray, vx: float, vy: float, omega: float) -> None:
    """Ask about a twist with the largest of |vx|, |vy|, |omega| length near 1; forget all loads."""
    table[ASKED, V_X], table[ASKED, V_Y], table[ASKED, OMEGA] = vx, vy, omega
    reach = 4.0 * (table[HEAD, SIZE] + table[HEAD, SHIFT])
    for j in range(3):
        angle = 2.0 + 2.0 * math.pi * j / 3.0
        table[BASIS + j, Y_X], table[BASIS + j, Y_Y] = reach * math.cos(angle), reach * math.sin(angle)
        table[BASIS + j, U_X] = table[BASIS + j, U_Y] = table[BASIS + j, PART] = 0.0
        table[BASIS + j, EDGE] = -1.0
    table[ASKED, INSIDE] = 0.0
    if table[HEAD, SOLID] > 0.0 and omega != 0.0 and _turns_inside(table):
        table[ASKED, INSIDE] = 1.0


@no_refcount
def _turns_inside(table: FloatArray) -> bool:
    """Return whether the centre of rotation lies in the polygon, its edges included."""
    omega = table[ASKED, OMEGA]
    for k in range(CORNERS, CORNERS + int(table[HEAD, COUNT])):
        ax, ay = table[ASKED, V_X] - omega * table[k, C_Y], table[ASKED, V_Y] + omega * table[k, C_X]
        across = ax * table[k, T_X] + ay * table[k, T_Y]
        if math.copysign(1.0, omega) * across < -TINY * table[HEAD, SIZE] * math.fabs(omega):
            return False
    return True


@no_refcount
def shares(table: FloatArray, x: float, y: float) -> tuple[float, float, float]:
    """Return the barycentric coordinates of a point about g in the triangle of the basic loads."""
    ax, ay = table[BASIS, Y_X] - x, table[BASIS, Y_Y] - y
    bx, by = table[BASIS + 1, Y_X] - x, table[BASIS + 1, Y_Y] - y
    cx, cy = table[BASIS + 2, Y_X] - x, table[BASIS + 2, Y_Y] - y
    one, two, three = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    scale = 1.0 / (one + two + three)
    return one * scale, two * scale, three * scale


@no_refcount
def _plane(table: FloatArray) -> tuple[float, float, float]:
    """Return the height at g and the slope b of the plane through the basic loads."""
    x0, y0, q0 = table[BASIS, Y_X], table[BASIS, Y_Y], table[BASIS, Q]
    x1, y1, q1 = table[BASIS + 1, Y_X] - x0, table[BASIS + 1, Y_Y] - y0, table[BASIS + 1, Q] - q0
    x2, y2, q2 = table[BASIS + 2, Y_X] - x0, table[BASIS + 2, Y_Y] - y0, table[BASIS + 2, Q] - q0
    scale = 1.0 / (x1 * y2 - x2 * y1)
    bx, by = (q1 * y2 - q2 * y1) * scale, (q2 * x1 - q1 * x2) * scale
    one, two, three = shares(table, 0.0, 0.0)
    return one * q0 + two * table[BASIS + 1, Q] + three * table[BASIS + 2, Q], bx, by


@no_refcount
def _load_at(table: FloatArray, k: int, x: float, y: float) -> None:
    """Fill row k with a load at x; where it rests, its friction goes against the row that edges see."""
    omega, kappa = table[ASKED, OMEGA], table[ASKED, ROW + 2]
    ux, uy = table[ASKED, V_X] - omega * y, table[ASKED, V_Y] + omega * x
    speed = math.sqrt(ux * ux + uy * uy)
    if speed <= TINY * table[HEAD, SIZE] * math.fabs(omega):
        ux, uy = kappa * y - table[ASKED, SEEN], -kappa * x - table[ASKED, SEEN + 1]
        speed = math.sqrt(ux * ux + uy * uy)
    scale = 1.0 / speed if speed > 0.0 else 0.0
    ux, uy = ux * scale, uy * scale
    table[k, Y_X] = x - table[HEAD, SHIFT] * ux - table[HEAD, G_X]
    table[k, Y_Y] = y - table[HEAD, SHIFT] * uy - table[HEAD, G_Y]
    table[k, X_X], table[k, X_Y], table[k, U_X], table[k, U_Y] = x, y, ux, uy
    table[k, Q] = ux * (table[ASKED, ROW] - kappa * y) + uy * (table[ASKED, ROW + 1] + kappa * x)


@no_refcount
def _ask(table: FloatArray, gamma_x: float, gamma_y: float, kappa: float) -> None:
    """Ask about a row: give the basic loads their new heights, empty the pool, describe the edges."""
    table[ASKED, ROW], table[ASKED, ROW + 1], table[ASKED, ROW + 2] = gamma_x, gamma_y, kappa
    for k in range(BASIS, BASIS + 3):
        ux, uy = table[k, U_X], table[k, U_Y]
        table[k, Q] = ux * (gamma_x - kappa * table[k, X_Y]) + uy * (gamma_y + kappa * table[k, X_X])
        if ux == 0.0 and uy == 0.0:
            table[k, Q] = 1e6  # an artificial point that costs more than any that is there
    count = int(table[HEAD, COUNT])
    pool = CORNERS + count
    for e in range(count):
        table[pool + 3 * e, FILLED] = 1.0
        table[pool + 3 * e + 1, FILLED] = table[pool + 3 * e + 2, FILLED] = 0.0
        table[pool + 3 * e + 1, AT] = table[pool + 3 * e + 2, AT] = -1.0
    table[pool + 3 * count, FILLED] = table[ASKED, INSIDE]
    _see(table, gamma_x, gamma_y)


@no_refcount
def _see(table: FloatArray, gamma_x: float, gamma_y: float) -> None:
    """Let the edges see a row with this gamma, and set the loads at corners and at c accordingly."""
    table[ASKED, SEEN], table[ASKED, SEEN + 1] = gamma_x, gamma_y
    table[ASKED, SEEN + 2] = table[ASKED, ROW + 2]
    count = int(table[HEAD, COUNT])
    pool = CORNERS + count
    for e in range(count):
        _load_at(table, pool + 3 * e, table[CORNERS + e, C_X], table[CORNERS + e, C_Y])
        if table[HEAD, SOLID] > 0.0:
            describe_edge(table, CORNERS + e)
    if table[ASKED, INSIDE] > 0.0:
        omega = table[ASKED, OMEGA]
        _load_at(table, pool + 3 * count, -table[ASKED, V_Y] / omega, table[ASKED, V_X] / omega)


@no_refcount
def _search_edges(table: FloatArray, height: float, bx: float, by: float) -> float:
    """Put the lowest points of all edges above the plane into the pool; return a bound of their gaps."""
    count = int(table[HEAD, COUNT])
    least = 0.0
    for e in range(count):
        k, slot = CORNERS + e, CORNERS + count + 3 * e
        x, y, tx, ty = table[k, C_X], table[k, C_Y], table[k, T_X], table[k, T_Y]
        slope = bx * tx + by * ty
        begin = height + bx * (x - table[HEAD, G_X]) + by * (y - table[HEAD, G_Y])
        for part in range(2):
            slot, column = slot + 1, STRETCH + PARTS * part
            table[slot, FILLED] = 0.0
            if table[k, column + 2] < slope < table[k, column + 3]:
                s, bound = lowest_gap(table, k, column, table[slot, AT], begin, slope, 0.1 * TOLERANCE)
                least = min(least, bound)
                table[slot, FILLED], table[slot, AT] = 1.0, s
                _load_at(table, slot, x + s * tx, y + s * ty)
    return least


@no_refcount
def _lowest_in_pool(table: FloatArray, height: float, bx: float, by: float) -> tuple[int, float]:
    """Return the row and the gap of the load of the pool that lies lowest against the plane."""
    first = CORNERS + int(table[HEAD, COUNT])
    best, least = -1, math.inf
    for k in range(first, first + 3 * int(table[HEAD, COUNT]) + 1):
        if table[k, FILLED] > 0.0:
            gap = table[k, Q] - height - bx * table[k, Y_X] - by * table[k, Y_Y]
            if gap < least:
                best, least = k, gap
    return best, least


@no_refcount
def _exchange(table: FloatArray, k: int) -> bool:
    """Exchange a basic load for that in row k, so that g stays between them; return whether that was possible."""
    one, two, three = shares(table, table[HEAD, NUDGE_X], table[HEAD, NUDGE_Y])
    first, second, third = shares(table, table[k, Y_X], table[k, Y_Y])
    leaving, ratio = -1, math.inf
    if first > _FLAT:
        leaving, ratio = 0, max(one, 0.0) / first
    if second > _FLAT and max(two, 0.0) < ratio * second:
        leaving, ratio = 1, max(two, 0.0) / second
    if third > _FLAT and max(three, 0.0) < ratio * third:
        leaving = 2
    if leaving < 0:
        return False
    for column in range(LOAD):
        table[BASIS + leaving, column] = table[k, column]
    return True


@no_refcount
def _exhaust_pool(table: FloatArray) -> None:
    """Run the simplex method on the pool."""
    for _ in range(_PIVOTS):
        height, bx, by = _plane(table)
        k, gap = _lowest_in_pool(table, height, bx, by)
        if gap >= -0.1 * TOLERANCE or not _exchange(table, k):
            return


@no_refcount
def least_load(table: FloatArray, gamma_x: float, gamma_y: float, kappa: float, goal: float) -> float:
    """Return a number that is at most, and to rounding equal to, the least of a row over all pressures.

    Args:
        table: The object, at a twist that `start_twist` has set; left with the worst pressure.
        gamma_x: Of the row, like `gamma_y` and `kappa` (1/m).
        gamma_y: See `gamma_x`.
        kappa: See `gamma_x`.
        goal: Any number above it is as good as the exact one.
    """
    _ask(table, gamma_x, gamma_y, kappa)
    shift, solid = table[HEAD, SHIFT], table[HEAD, SOLID] > 0.0
    best = -math.inf
    for turn in range(_ROUNDS):
        _exhaust_pool(table)
        height, bx, by = _plane(table)
        if best >= height - TOLERANCE:
            break
        if shift > 0.0:
            _see(table, gamma_x + shift * bx, gamma_y + shift * by)
        elif solid and turn % 2 == 1:
            height, bx, by = touching_plane(table, height, bx, by)
        least = _search_edges(table, height, bx, by) if solid else 0.0
        best = max(best, height + min(least, _lowest_in_pool(table, height, bx, by)[1]))
        if best >= goal:
            break
    return best


@no_refcount
def worst_loads(table: FloatArray, gamma_x: float, gamma_y: float, kappa: float, out: FloatArray) -> float:
    """Fill `out` (3, 5) with the loads of `least_load`: place, direction of travel, part of the load.

    Returns:
        What these loads give to the row.
    """
    least_load(table, gamma_x, gamma_y, kappa, math.inf)
    parts = shares(table, 0.0, 0.0)
    total = 0.0
    for j in range(3):
        for column in range(4):
            out[j, column] = table[BASIS + j, X_X + column]
        out[j, 4] = parts[j]
        total += parts[j] * table[BASIS + j, Q]
    return total
