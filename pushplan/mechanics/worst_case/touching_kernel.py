"""A plane that touches the edges at two loads, where two loads with the centre between them are the worst.

The simplex method only knows planes through three loads: it would bring two of them together on one convex
stretch of an edge, halving their distance again and again. They are replaced by one load between them, with
the slope of q there.
"""

from __future__ import annotations

import math

from pushplan.compiled import no_refcount
from pushplan.mechanics.worst_case.area_table import (
    AT,
    BASIS,
    C_X,
    C_Y,
    CORNERS,
    COUNT,
    EDGE,
    G_X,
    G_Y,
    HEAD,
    LENGTH,
    PART,
    T_X,
    T_Y,
    Y_X,
    Y_Y,
    Q,
)
from pushplan.mechanics.worst_case.edge_kernel import edge_slope, edge_value
from pushplan.util.arrays import FloatArray


@no_refcount
def _place_on(table: FloatArray, k: int, edge: int, part: int) -> float:
    """Return s of the load in row k on a stretch, or -1 when it does not lie there."""
    s = -1.0
    if table[k, EDGE] == edge:
        s = table[k, AT]
    elif table[k, PART] == 0.0 and table[k, EDGE] >= CORNERS:
        count = int(table[HEAD, COUNT])
        if int(table[k, EDGE]) == CORNERS + (edge - CORNERS + 1) % count:
            s = table[edge, LENGTH]
    return s if table[edge, part] <= s <= table[edge, part + 1] else -1.0


@no_refcount
def _between(table: FloatArray, a: int, b: int, c: int, s: float, other: float) -> float:
    """Return s on the edge of loads a and b where it meets the line from load c through the centre."""
    ax, ay, bx, by = table[a, Y_X], table[a, Y_Y], table[b, Y_X], table[b, Y_Y]
    cx, cy = table[c, Y_X], table[c, Y_Y]
    one, two = ax * cy - ay * cx, bx * cy - by * cx
    if one == two:
        return 0.5 * (s + other)
    return float(s + (other - s) * min(max(one / (one - two), 0.0), 1.0))


@no_refcount
def _opposite(table: FloatArray, edge: int, x: float, y: float) -> float:
    """Return s on an edge where it meets the line from (x, y) about the centre through the centre."""
    px, py = table[edge, C_X] - table[HEAD, G_X], table[edge, C_Y] - table[HEAD, G_Y]
    return float((py * x - px * y) / (table[edge, T_X] * y - table[edge, T_Y] * x))


@no_refcount
def _touch(table: FloatArray, edge: int, s: float, c: int) -> tuple[float, float, float, float]:
    """Return height and slope b of the plane that touches `edge` at s and passes through what is opposite.

    That is load c, or the point of its edge on the line through the centre; then the last number says by how
    much the plane's slope along that edge exceeds that of q.
    """
    tx, ty = table[edge, T_X], table[edge, T_Y]
    x = table[edge, C_X] + s * tx - table[HEAD, G_X]
    y = table[edge, C_Y] + s * ty - table[HEAD, G_Y]
    q, slope, excess = edge_value(table, edge, s), edge_slope(table, edge, s), 0.0
    other, part, z = int(table[c, EDGE]), int(table[c, PART]), 0.0
    ox, oy, height = table[c, Y_X], table[c, Y_Y], table[c, Q]
    if part > 0:
        z = min(max(_opposite(table, other, x, y), table[other, part]), table[other, part + 1])
        ox = table[other, C_X] + z * table[other, T_X] - table[HEAD, G_X]
        oy = table[other, C_Y] + z * table[other, T_Y] - table[HEAD, G_Y]
        height = edge_value(table, other, z)
    dx, dy, rise = ox - x, oy - y, height - q
    scale = 1.0 / (tx * dy - ty * dx)
    bx, by = (slope * dy - rise * ty) * scale, (rise * tx - slope * dx) * scale
    if part > 0:
        excess = bx * table[other, T_X] + by * table[other, T_Y] - edge_slope(table, other, z)
    return q - bx * x - by * y, bx, by, excess


@no_refcount
def touching_plane(table: FloatArray, height: float, bx: float, by: float) -> tuple[float, float, float]:
    """Return height at g and slope b of a touching plane, or what was given when no two loads share a stretch."""
    for a in range(BASIS, BASIS + 3):
        edge, part = int(table[a, EDGE]), int(table[a, PART])
        for b in range(BASIS, BASIS + 3):
            if a == b or part == 0:
                continue
            other = _place_on(table, b, edge, part)
            if other < 0.0:
                continue
            c = 3 * BASIS + 3 - a - b
            s = _between(table, a, b, c, table[a, AT], other)
            return _settle(table, edge, part, s, c, height, bx, by)
    return height, bx, by


@no_refcount
def _settle(
    table: FloatArray, edge: int, part: int, s: float, c: int, height: float, bx: float, by: float
) -> tuple[float, float, float]:
    """Return the touching plane near s whose excess slope on the other edge vanishes (secant method)."""
    low, high = table[edge, part], table[edge, part + 1]
    plane = _touch(table, edge, s, c)
    step = 1e-4 * (high - low)
    new = s + step if s + step <= high else s - step
    for _ in range(12):
        if plane[3] == 0.0:
            break
        trial = _touch(table, edge, new, c)
        if trial[3] == plane[3]:
            break
        following = min(max(new - trial[3] * (new - s) / (trial[3] - plane[3]), low), high)
        s, new, plane = new, following, trial
        if math.fabs(new - s) <= 1e-13 * high:
            break
    if not math.isfinite(plane[0] + plane[1] + plane[2]):
        return height, bx, by
    return plane[0], plane[1], plane[2]
