"""The least of every contact condition over all that loads and frictions may be, compiled: one kernel for all of it.

A row of contact k is sum_i F_i q_i over the objects it carries: linear in the friction load F_i = mu_i m_i g of each
and in how that load is spread. With F_i in [low_i, high_i] and spreads that are independent, its least value is

    sum_i min over F_i in {low_i, high_i} of F_i e_i ,    e_i the least of q_i over the spreads of object i.

A unit load at x that moves with v gives q(x) = g . w(x), w = (u, x x u / L), u = v / |v|. A spread is one of

- known: e = g . w, w in closed form;
- parts p_j of points x_j with l_j <= p_j <= u_j and sum p_j = t: feet with intervals (t = 1), and cells of a pressure
  that is off by a share (t = 0, beside the known w). A fractional knapsack; its dual has one variable,
  e = max over c of t c + sum_j min(l_j (q_j - c), u_j (q_j - c)): any c gives a lower bound, the best the least;
- any with the centre g0: sum p_j = 1, sum p_j y_j = g0, p_j >= 0, y_j = x_j (a push at height h shifts the load by
  its friction: y_j = x_j - h mu u_j). A linear program whose dual has three variables, a plane a + b . (y - g0) <= q.
  On rays from the centre of rotation (COR) q and y are affine, so that points of the outline and the COR, where the
  direction of friction is free, suffice. Edges are sampled in steps that grow with the distance from the COR, and
  beside the optimum once more between the samples; the plane moved down by what they may miss is a safe answer.

The margin of contact k is its least row over a bound of |w_k| (`_sizes`, `_centred_sizes`), so that it is at most the
sine that known loads would give, and equal to it where everything is known.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.mechanics.friction_kernel import carried_wrench
from pushplan.mechanics.packed import PackedChain
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

EDGE_POINTS, BETWEEN, INTERVALS = 16, 12, 32
"""Samples of every edge of an outline that may carry any load, and those between two of them, where these are asked
for; and between how many they may be at one twist."""

MISS = 1e-4
"""What a sampled outline may miss of the least of a unit row; taken off the answer."""

COARSE_MISS = 3e-2
"""The same before anything was sampled in between."""

HALVINGS = 6
"""Of the interval in which the dual of a knapsack of many points is largest: second order in what is left of it."""

_FLAT, _TINY, _PIVOTS, _ROUNDS, _BIG = 1e-12, 1e-9, 60, 6, 1e3


class PackedLoads(NamedTuple):
    """The loads and contacts of n objects.

    Attributes:
        units: Those objects whose load is known, with a unit friction load.
        unit: (n,) where an object is among `units`, -1 where it is not.
        points: (p, 4) x, y (m), least and largest part of the load of what is uncertain on points.
        first: (n + 1,) where the points of each object begin.
        total: (n,) what the parts of an object's points sum to.
        miss: (n, 2) share, and part of the load, by which points miss what varies between them.
        centers: (n, 5) of objects of which only the centre is known: its place x, y (m), shift h mu (m) and the nudge
            that takes it off edges between loads (2).
        free: (n,) 0 for objects of other kinds, 1 for feet, 2 for a whole outline that carries the load.
        corners: (c, 2) feet, or corners of the convex outline, counter-clockwise, about that centre, m.
        corner: (n + 1,) where the corners of each object begin.
        centred: Whether of any object only the centre is known.
        loads: (n, 2) least and largest friction load of every object, N.
        carried: (n, n) whether contact k carries object i.
        facets: (n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length) > 0.
        length: Characteristic length of the chain, m.
    """

    units: PackedChain
    unit: IntArray
    points: FloatArray
    first: IntArray
    total: FloatArray
    miss: FloatArray
    centers: FloatArray
    free: IntArray
    corners: FloatArray
    corner: IntArray
    centred: bool
    loads: FloatArray
    carried: BoolArray
    facets: FloatArray
    length: float


class Room(NamedTuple):
    """What is worked out at one twist; moments are divided by the length.

    Attributes:
        twist: (3,) scaled.
        known: (n, 3) wrenches of unit loads that are known.
        pulls: (p, 3) wrenches of unit loads on the points.
        values: (p,) of one row.
        columns: (n, c, 6) loads that may be basic: y about the centre, w (3), 1 where there are more between this one
            and the next.
        counts: (n, 2) of the columns, and of those among them that are the first samples, in their order.
        basis: (n, 3, 6) basic loads: y, w, and the column, -1 for the COR, -2 for none yet.
        inside: (n,) whether a load may rest on the COR.
        middle: (n, 3) wrenches in the middle of what may be, or least and largest moments.
        rows: (n, 4) least rows.
        size: (n,) bounds of the wrenches.
    """

    twist: FloatArray
    known: FloatArray
    pulls: FloatArray
    values: FloatArray
    columns: FloatArray
    counts: IntArray
    basis: FloatArray
    inside: BoolArray
    middle: FloatArray
    rows: FloatArray
    size: FloatArray


@compiled
def make_room(packed: PackedLoads) -> Room:
    """Return arrays to be filled."""
    n, p, most = len(packed.loads), len(packed.points), 1
    for i in range(n):
        most = max(most, EDGE_POINTS * (packed.corner[i + 1] - packed.corner[i]) + BETWEEN * INTERVALS)
    return Room(
        np.empty(3),
        np.zeros((n, 3)),
        np.empty((p, 3)),
        np.empty(p),
        np.empty((n, most, 6)),
        np.zeros((n, 2), np.int64),
        np.empty((n, 3, 6)),
        np.zeros(n, np.bool_),
        np.empty((n, 3)),
        np.empty((n, 4)),
        np.empty(n),
    )


@no_refcount
def start(packed: PackedLoads, vx: float, vy: float, omega: float, room: Room) -> None:
    """Set a body twist other than 0."""
    scale = 1.0 / max(abs(vx), abs(vy), abs(omega) * packed.length)
    vx, vy, omega = vx * scale, vy * scale, omega * scale
    room.twist[0], room.twist[1], room.twist[2] = vx, vy, omega
    objects, parts, series, links, _, _ = packed.units
    for i in range(len(packed.unit)):
        if packed.unit[i] >= 0:
            w = carried_wrench(objects, parts, series, links, packed.unit[i], vx, vy, omega)
            room.known[i, 0], room.known[i, 1], room.known[i, 2] = w[0], w[1], w[2] / packed.length
        if packed.free[i] > 0:
            _sample(packed, i, room)
    for p in range(len(packed.points)):
        x, y = packed.points[p, 0], packed.points[p, 1]
        u, v = vx - omega * y, vy + omega * x
        speed = math.sqrt(u * u + v * v)
        if speed > 0.0:  # where nothing moves, nothing pulls
            u, v = u / speed, v / speed
        room.pulls[p, 0], room.pulls[p, 1], room.pulls[p, 2] = u, v, (x * v - y * u) / packed.length


# ---- spreads of which only the centre is known


@no_refcount
def _add_column(packed: PackedLoads, i: int, room: Room, x: float, y: float, ux: float, uy: float) -> None:
    """Add a unit load at (x, y) about the centre that moves in a direction (ux, uy) to the columns of object i."""
    c, k = packed.centers[i], room.counts[i, 0]
    column = room.columns[i, k]
    column[0], column[1] = x - c[2] * ux, y - c[2] * uy
    column[2], column[3] = ux, uy
    column[4] = ((c[0] + x) * uy - (c[1] + y) * ux) / packed.length
    column[5] = 0.0
    room.counts[i, 0] = k + 1


@no_refcount
def _sample(packed: PackedLoads, i: int, room: Room) -> None:
    """Fill the columns of object i: its feet, or its outline in steps that grow with the distance from the COR."""
    omega, c = room.twist[2], packed.centers[i]
    vx, vy = room.twist[0] - omega * c[1], room.twist[1] + omega * c[0]  # of the centre
    begin, end = packed.corner[i], packed.corner[i + 1]
    room.counts[i, 0], size = 0, 1e-9
    for k in range(begin, end):
        size = max(size, math.hypot(packed.corners[k, 0], packed.corners[k, 1]))
    still = _TINY * size * abs(omega)
    room.inside[i] = packed.free[i] == 2 and omega != 0.0
    for k in range(begin, end):
        x, y = packed.corners[k, 0], packed.corners[k, 1]
        ux, uy = vx - omega * y, vy + omega * x
        speed = math.sqrt(ux * ux + uy * uy)
        if packed.free[i] == 1:
            if speed <= still:
                room.inside[i] = True  # this foot is the COR
            else:
                _add_column(packed, i, room, x, y, ux / speed, uy / speed)
            continue
        following = k + 1 if k + 1 < end else begin
        tx, ty = packed.corners[following, 0] - x, packed.corners[following, 1] - y
        edge = math.hypot(tx, ty)
        if edge == 0.0:
            continue
        tx, ty = tx / edge, ty / edge
        a, rho = (
            ux * tx + uy * ty,
            uy * tx - ux * ty,
        )  # along the edge, constant, and to its left, rho + omega s
        if math.copysign(1.0, omega) * a < -still:
            room.inside[i] = False
        if abs(a) <= still:  # the COR lies on the edge's line: q is affine on either side of it
            _add_on_line(packed, i, room, x, y, tx, ty, edge, rho)
        else:
            _add_edge(packed, i, room, x, y, tx, ty, edge, a, rho)
    room.counts[i, 1] = room.counts[i, 0] if packed.free[i] == 2 else 0
    reach = 4.0 * (size + c[2])
    for j in range(3):
        angle = 2.0 + 2.0 * math.pi * j / 3.0
        basic = room.basis[i, j]
        basic[0], basic[1] = reach * math.cos(angle), reach * math.sin(angle)
        basic[2] = basic[3] = basic[4] = 0.0
        basic[5] = -2.0


@no_refcount
def _add_on_line(
    packed: PackedLoads, i: int, room: Room, x: float, y: float, tx: float, ty: float, edge: float, rho: float
) -> None:
    """Add the ends of an edge whose line the COR lies on, where they move."""
    omega = room.twist[2]
    for s in (0.0, edge):
        across = rho + omega * s
        if across != 0.0:
            sign = math.copysign(1.0, across)
            _add_column(packed, i, room, x + s * tx, y + s * ty, -sign * ty, sign * tx)


@no_refcount
def _add_edge(
    packed: PackedLoads,
    i: int,
    room: Room,
    x: float,
    y: float,
    tx: float,
    ty: float,
    edge: float,
    a: float,
    rho: float,
) -> None:
    """Add the begin of an edge and points on it; v = (a, rho + omega s) by its tangent and normal."""
    omega = room.twist[2]
    begin, end = math.asinh(rho / abs(a)), math.asinh((rho + omega * edge) / abs(a))
    sign, step = math.copysign(1.0, a), (end - begin) / EDGE_POINTS
    even = abs(end - begin) < 1e-3
    cosh, sinh, c, s = math.cosh(begin), math.sinh(begin), math.cosh(step), math.sinh(step)
    for j in range(EDGE_POINTS):
        along = j * edge / EDGE_POINTS
        if not even:
            along = min(max((abs(a) * sinh - rho) / omega, 0.0), edge) if j > 0 else 0.0
        across = rho + omega * along
        speed = math.sqrt(a * a + across * across)
        ux, uy = (sign * abs(a) * tx - across * ty) / speed, (sign * abs(a) * ty + across * tx) / speed
        _add_column(packed, i, room, x + along * tx, y + along * ty, ux, uy)
        cosh, sinh = cosh * c + sinh * s, sinh * c + cosh * s


@no_refcount
def _row_of(load: FloatArray, first: int, gx: float, gy: float, gm: float) -> float:
    """Return a row of a unit load whose wrench begins in a column."""
    return float(gx * load[first] + gy * load[first + 1] + gm * load[first + 2])


@no_refcount
def _heights(room: Room, i: int, gx: float, gy: float, gm: float) -> tuple[float, float, float]:
    """Return the heights q of the basic loads; high where there is none yet."""
    basis = room.basis[i]
    one, two, three = _BIG, _BIG, _BIG
    if basis[0, 5] > -2.0:
        one = _row_of(basis[0], 2, gx, gy, gm)
    if basis[1, 5] > -2.0:
        two = _row_of(basis[1], 2, gx, gy, gm)
    if basis[2, 5] > -2.0:
        three = _row_of(basis[2], 2, gx, gy, gm)
    return one, two, three


@no_refcount
def shares(basis: FloatArray, x: float, y: float) -> tuple[float, float, float]:
    """Return the barycentric coordinates of a point about the centre in the triangle of the basic loads (3, ...)."""
    ax, ay, bx, by = basis[0, 0] - x, basis[0, 1] - y, basis[1, 0] - x, basis[1, 1] - y
    cx, cy = basis[2, 0] - x, basis[2, 1] - y
    one, two, three = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    scale = 1.0 / (one + two + three)
    return one * scale, two * scale, three * scale


@no_refcount
def _plane(room: Room, i: int, gx: float, gy: float, gm: float) -> tuple[float, float, float]:
    """Return the height at the centre and the slope b of the plane through the basic loads: the dual variables."""
    basis = room.basis[i]
    q0, q1, q2 = _heights(room, i, gx, gy, gm)
    x1, y1 = basis[1, 0] - basis[0, 0], basis[1, 1] - basis[0, 1]
    x2, y2 = basis[2, 0] - basis[0, 0], basis[2, 1] - basis[0, 1]
    scale = 1.0 / (x1 * y2 - x2 * y1)
    bx, by = ((q1 - q0) * y2 - (q2 - q0) * y1) * scale, ((q2 - q0) * x1 - (q1 - q0) * x2) * scale
    return q0 - bx * basis[0, 0] - by * basis[0, 1], bx, by


@no_refcount
def _at_cor(
    packed: PackedLoads,
    i: int,
    room: Room,
    gx: float,
    gy: float,
    gm: float,
    bx: float,
    by: float,
    out: FloatArray,
) -> float:
    """Fill `out` (6,) with the load on the COR that lies lowest against a plane; return its height less b . y."""
    omega, c, kappa = room.twist[2], packed.centers[i], gm / packed.length
    x, y = -room.twist[1] / omega, room.twist[0] / omega
    # u . (gamma + shift b + kappa J x) is least for u against it.
    ax, ay = gx + c[2] * bx - kappa * y, gy + c[2] * by + kappa * x
    size = math.sqrt(ax * ax + ay * ay)
    ux, uy = (-ax / size, -ay / size) if size > 0.0 else (0.0, 0.0)
    out[0], out[1] = x - c[0] - c[2] * ux, y - c[1] - c[2] * uy
    out[2], out[3], out[4], out[5] = ux, uy, (x * uy - y * ux) / packed.length, -1.0
    return float(_row_of(out, 2, gx, gy, gm) - bx * out[0] - by * out[1])


@no_refcount
def _lowest(
    packed: PackedLoads,
    i: int,
    room: Room,
    gx: float,
    gy: float,
    gm: float,
    plane: tuple[float, float, float],
    out: FloatArray,
) -> float:
    """Fill `out` (6,) with the load that lies lowest against a plane; return by how much it lies above it."""
    height, bx, by = plane
    best, least = -1, math.inf
    columns = room.columns[i]
    for k in range(room.counts[i, 0]):
        gap = (
            gx * columns[k, 2]
            + gy * columns[k, 3]
            + gm * columns[k, 4]
            - bx * columns[k, 0]
            - by * columns[k, 1]
        )
        if gap < least:
            best, least = k, gap
    if room.inside[i]:
        gap = _at_cor(packed, i, room, gx, gy, gm, bx, by, out)
        if gap < least:
            return gap - height
    for j in range(5):
        out[j] = columns[best, j]
    out[5] = best
    return least - height


@no_refcount
def _enter(packed: PackedLoads, i: int, room: Room, load: FloatArray) -> bool:
    """Exchange a basic load for another (6,), so that the centre stays between them; tell whether that is so."""
    basis = room.basis[i]
    one, two, three = shares(basis, packed.centers[i, 3], packed.centers[i, 4])
    first, second, third = shares(basis, load[0], load[1])
    leaving, ratio = -1, math.inf
    if first > _FLAT:
        leaving, ratio = 0, max(one, 0.0) / first
    if second > _FLAT and max(two, 0.0) < ratio * second:
        leaving, ratio = 1, max(two, 0.0) / second
    if third > _FLAT and max(three, 0.0) < ratio * third:
        leaving = 2
    if leaving < 0:
        return False
    for j in range(6):
        basis[leaving, j] = load[j]
    return True


@no_refcount
def _add_between(packed: PackedLoads, i: int, room: Room, k: int) -> None:
    """Add columns between a sample and the next one, on the same edge."""
    omega, c = room.twist[2], packed.centers[i]
    vx, vy = room.twist[0] - omega * c[1], room.twist[1] + omega * c[0]
    one, other = room.columns[i, k], room.columns[i, k + 1 if k + 1 < room.counts[i, 1] else 0]
    x, y = one[0] + c[2] * one[2], one[1] + c[2] * one[3]
    dx, dy = other[0] + c[2] * other[2] - x, other[1] + c[2] * other[3] - y
    for j in range(BETWEEN):
        t = (j + 1.0) / (BETWEEN + 1.0)
        px, py = x + t * dx, y + t * dy
        ux, uy = vx - omega * py, vy + omega * px
        speed = math.sqrt(ux * ux + uy * uy)
        if speed > 0.0:
            _add_column(packed, i, room, px, py, ux / speed, uy / speed)
    one[5] = 1.0


@no_refcount
def _bend(packed: PackedLoads, i: int, room: Room) -> float:
    """Return the share of what samples miss at most: none of feet or translations, where q is affine."""
    if packed.free[i] < 2:
        return 0.0
    omega, c = room.twist[2], packed.centers[i]
    vx, vy = room.twist[0] - omega * c[1], room.twist[1] + omega * c[0]
    near, speed = abs(omega) * packed.length, math.sqrt(vx * vx + vy * vy)
    return float(near / speed if near < speed else 1.0)


@no_refcount
def _above(load: FloatArray, gx: float, gy: float, gm: float, plane: tuple[float, float, float]) -> float:
    """Return how far a column lies above a plane."""
    height, bx, by = plane
    return float(_row_of(load, 2, gx, gy, gm) - bx * load[0] - by * load[1] - height)


@no_refcount
def _refine(
    packed: PackedLoads,
    i: int,
    room: Room,
    gx: float,
    gy: float,
    gm: float,
    plane: tuple[float, float, float],
) -> bool:
    """Add columns on both sides of samples that lie lowest above the plane; tell if there are new ones.

    Between two samples q may be lower than at either, by COARSE_MISS.
    """
    count, new, columns = room.counts[i, 1], False, room.columns[i]
    if count == 0:
        return False
    before = _above(columns[count - 1], gx, gy, gm, plane)
    here = _above(columns[0], gx, gy, gm, plane)
    for k in range(count):
        after = _above(columns[k + 1 if k + 1 < count else 0], gx, gy, gm, plane)
        if here < COARSE_MISS and here <= before and here <= after:
            for first in (k, k - 1 if k > 0 else count - 1):
                if columns[first, 5] == 0.0 and room.counts[i, 0] + BETWEEN <= columns.shape[0]:
                    _add_between(packed, i, room, first)
                    new = True
        before, here = here, after
    return new


@no_refcount
def least_centred(packed: PackedLoads, i: int, room: Room, gx: float, gy: float, gm: float) -> float:
    """Return the least of a row of a unit load on object i with its centre; leave the worst spread in the basis."""
    load = scratch(1, 6)[0]
    height = 0.0
    for _ in range(_ROUNDS):
        gap = 0.0
        for _ in range(_PIVOTS):
            plane = _plane(room, i, gx, gy, gm)
            gap = _lowest(packed, i, room, gx, gy, gm, plane, load)
            height = plane[0]
            if gap >= -1e-9 or not _enter(packed, i, room, load):
                break
        height += min(gap, 0.0)
        if not _refine(packed, i, room, gx, gy, gm, _plane(room, i, gx, gy, gm)):
            break
    return height - MISS * _bend(packed, i, room)


@no_refcount
def _quick_centred(packed: PackedLoads, i: int, room: Room, gx: float, gy: float, gm: float) -> float:
    """Return a lower bound of `least_centred`: the plane that touches q at the centre, moved down below all q."""
    omega, c, kappa = room.twist[2], packed.centers[i], gm / packed.length
    load = scratch(1, 6)[0]
    vx, vy = room.twist[0] - omega * c[1], room.twist[1] + omega * c[0]
    ax, ay = gx - kappa * c[1], gy + kappa * c[0]
    speed = math.sqrt(vx * vx + vy * vy)
    if speed <= _TINY * abs(omega) * packed.length or (packed.free[i] == 2 and room.counts[i, 1] == 0):
        return -math.inf
    ux, uy = vx / speed, vy / speed
    # The gradient of u . (a + kappa J x) at the centre: u turns by omega / speed along itself.
    turn = (ax * -uy + ay * ux) * omega / speed
    bx, by = turn * ux + kappa * uy, turn * uy - kappa * ux
    plane = (ux * ax + uy * ay + c[2] * (bx * ux + by * uy), bx, by)
    miss = COARSE_MISS * _bend(packed, i, room)
    return float(plane[0] + min(_lowest(packed, i, room, gx, gy, gm, plane, load), 0.0) - miss)


# ---- spreads on points


@no_refcount
def least_sum(values: FloatArray, points: FloatArray, first: int, stop: int, total: float) -> float:
    """Return the least of sum_p phi_p values (p,) over parts phi_p in their intervals that sum to `total`.

    The dual sum over p of min(low (v - c), high (v - c)) + c total is a lower bound for every c, concave, and the
    least for the c up to which parts have to be high: one of the values, found by halving.
    """
    if stop - first <= 8:
        best = -math.inf
        for p in range(first, stop):
            best = max(best, _dual_sum(values, points, first, stop, total, values[p]))
        return best
    mean = spread = weight = 0.0
    for p in range(first, stop):
        part = points[p, 3] - points[p, 2]
        mean, spread, weight = mean + part * values[p], spread + part * values[p] * values[p], weight + part
    mean /= weight
    sigma = math.sqrt(max(spread / weight - mean * mean, 0.0))
    low, high = mean - 2.0 * sigma, mean + 2.0 * sigma  # a median is at most sigma away from the mean
    for _ in range(HALVINGS):
        c, filled = 0.5 * (low + high), 0.0
        for p in range(first, stop):
            filled += points[p, 3] if values[p] < c else points[p, 2]
        if filled > total:
            high = c
        else:
            low = c
    return _dual_sum(values, points, first, stop, total, 0.5 * (low + high))


@no_refcount
def _dual_sum(values: FloatArray, points: FloatArray, first: int, stop: int, total: float, c: float) -> float:
    least = c * total
    for p in range(first, stop):
        over = values[p] - c
        least += (points[p, 2] if over > 0.0 else points[p, 3]) * over
    return float(least)


@no_refcount
def least_on_points(packed: PackedLoads, i: int, room: Room, gx: float, gy: float, gm: float) -> float:
    """Return the least of a row of what is uncertain on the points of object i, per unit."""
    first, stop = packed.first[i], packed.first[i + 1]
    for p in range(first, stop):
        room.values[p] = _row_of(room.pulls[p], 0, gx, gy, gm)
    least = least_sum(room.values, packed.points, first, stop, packed.total[i])
    if packed.total[i] == 0.0:  # a loss
        return float((1.0 + packed.miss[i, 0]) * least - packed.miss[i, 1])
    return least


# ---- rows, sizes, margins


EXACT, LOWER, UPPER = 0, 1, 2
"""How a least row is asked for: itself, a quick lower bound where only centres are known, or the row without what
pressures that are off take from it."""


@no_refcount
def _least(packed: PackedLoads, i: int, room: Room, gx: float, gy: float, gm: float, how: int) -> float:
    """Return the least e_i of a row of a unit load on object i, or a bound of it (see `EXACT`)."""
    if packed.free[i] > 0:
        if how == LOWER:
            return _quick_centred(packed, i, room, gx, gy, gm)
        return least_centred(packed, i, room, gx, gy, gm)
    least = _row_of(room.known[i], 0, gx, gy, gm) if packed.unit[i] >= 0 else 0.0
    if packed.first[i] < packed.first[i + 1] and not (how == UPPER and packed.total[i] == 0.0):
        least += least_on_points(packed, i, room, gx, gy, gm)
    return least


@no_refcount
def _middle(packed: PackedLoads, i: int, room: Room) -> tuple[float, float, float, float]:
    """Return the wrench of a unit load in the middle of what it may be on points, and by how much it may differ."""
    x, y, m, spread = 0.0, 0.0, 0.0, 0.0
    if packed.unit[i] >= 0:
        x, y, m = room.known[i, 0], room.known[i, 1], room.known[i, 2]
    first, stop = packed.first[i], packed.first[i + 1]
    cx, cy, cm, weight = 0.0, 0.0, 0.0, 0.0
    if packed.total[i] == 0.0 and first < stop:  # what sums to 0 is about the mean
        for p in range(first, stop):
            part = packed.points[p, 3]
            cx, cy = cx + part * room.pulls[p, 0], cy + part * room.pulls[p, 1]
            cm, weight = cm + part * room.pulls[p, 2], weight + part
        cx, cy, cm = cx / weight, cy / weight, cm / weight
    for p in range(first, stop):
        low, high = packed.points[p, 2], packed.points[p, 3]
        dx, dy, dm, half = (
            room.pulls[p, 0] - cx,
            room.pulls[p, 1] - cy,
            room.pulls[p, 2] - cm,
            0.5 * (low + high),
        )
        x, y, m = x + half * dx, y + half * dy, m + half * dm
        spread += 0.5 * (high - low) * math.sqrt(dx * dx + dy * dy + dm * dm)
    return x, y, m, (1.0 + packed.miss[i, 0]) * spread + packed.miss[i, 1]


@no_refcount
def _sizes(packed: PackedLoads, factors: FloatArray, room: Room) -> None:
    """Fill in bounds |sum F_i w_i in the middle| + half the widths of what they may be, for loads on points."""
    n = len(factors)
    room.size[:], room.middle[:] = 0.0, 0.0
    for i in range(n):
        low, high = factors[i, 0], factors[i, 1]
        x, y, m, spread = _middle(packed, i, room)
        half = 0.5 * (low + high)
        added = 0.5 * (high - low) * math.sqrt(x * x + y * y + m * m) + high * spread
        for k in range(n):
            if packed.carried[k, i]:
                room.middle[k, 0], room.middle[k, 1] = (
                    room.middle[k, 0] + half * x,
                    room.middle[k, 1] + half * y,
                )
                room.middle[k, 2], room.size[k] = room.middle[k, 2] + half * m, room.size[k] + added
    for k in range(n):
        m = room.middle[k]
        room.size[k] += math.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])


@no_refcount
def _centred_sizes(packed: PackedLoads, factors: FloatArray, room: Room) -> None:
    """Fill in the lengths of the largest force, sum F_i, and the largest moment, where only centres are known."""
    n = len(factors)
    room.size[:], room.middle[:] = 0.0, 0.0
    for i in range(n):
        low, high = (
            _least(packed, i, room, 0.0, 0.0, 1.0, EXACT),
            -_least(packed, i, room, 0.0, 0.0, -1.0, EXACT),
        )
        for k in range(n):
            if packed.carried[k, i]:
                room.middle[k, 0] += min(factors[i, 0] * low, factors[i, 1] * low)
                room.middle[k, 1] += max(factors[i, 0] * high, factors[i, 1] * high)
                room.size[k] += factors[i, 1]
    for k in range(n):
        room.size[k] = math.hypot(room.size[k], max(-room.middle[k, 0], room.middle[k, 1]))


@no_refcount
def _row(packed: PackedLoads, factors: FloatArray, k: int, j: int, room: Room, how: int) -> float:
    """Return the least of row j of contact k, N, or a quick bound of it (see `EXACT`)."""
    gx, gy, gm = packed.facets[k, j, 0], packed.facets[k, j, 1], packed.facets[k, j, 2]
    total = 0.0
    for i in range(len(factors)):
        if packed.carried[k, i] and factors[i, 1] > 0.0:
            least = _least(packed, i, room, gx, gy, gm, how)
            total += min(factors[i, 0] * least, factors[i, 1] * least)
    return total


@no_refcount
def _bound(packed: PackedLoads, factors: FloatArray, room: Room) -> None:
    """Fill in all rows and sizes for factors (n, 2) in their intervals: friction loads (N) or masses (kg)."""
    if packed.centred:
        _centred_sizes(packed, factors, room)
    else:
        _sizes(packed, factors, room)
    for k in range(len(factors)):
        for j in range(4):
            room.rows[k, j] = _row(packed, factors, k, j, room, EXACT)


@no_refcount
def _margin(packed: PackedLoads, floor: float, room: Room) -> float:
    """Return the smallest margin, or any number up to `floor` for a smaller one.

    Rows are asked from the lowest quick bound on, until the next one cannot be the least any more.
    """
    n, lowest = len(packed.loads), math.inf
    if packed.centred:
        _centred_sizes(packed, packed.loads, room)
    else:
        _sizes(packed, packed.loads, room)
    for k in range(n):
        if room.size[k] == 0.0:
            lowest = 0.0
        for j in range(4):
            room.rows[k, j] = math.inf
            if room.size[k] > 0.0:
                room.rows[k, j] = (
                    _row(packed, packed.loads, k, j, room, LOWER if packed.centred else UPPER) / room.size[k]
                )
    if not packed.centred:
        bound = lowest
        for k in range(n):
            bound = min(bound, room.rows[k, 0], room.rows[k, 1], room.rows[k, 2], room.rows[k, 3])
        if floor >= 0.0 and bound <= floor:
            return bound
        for k in range(n):
            for j in range(4):
                if room.size[k] > 0.0:
                    lowest = min(lowest, _row(packed, packed.loads, k, j, room, EXACT) / room.size[k])
    while packed.centred and lowest > floor:
        best, row = 0, 0
        for k in range(n):
            for j in range(4):
                if room.rows[k, j] < room.rows[best, row]:
                    best, row = k, j
        if room.rows[best, row] >= lowest:
            break
        room.rows[best, row] = math.inf
        lowest = min(lowest, _row(packed, packed.loads, best, row, room, EXACT) / room.size[best])
    return lowest


@compiled
def margin_down_to(packed: PackedLoads, vx: float, vy: float, omega: float, floor: float) -> float:
    """Return the smallest margin at a body twist other than 0; any number up to `floor` for a smaller one."""
    room = make_room(packed)
    start(packed, vx, vy, omega, room)
    return _margin(packed, floor, room)


@compiled
def margins_of(packed: PackedLoads, twists: FloatArray, floor: float) -> FloatArray:
    """Return `margin_down_to` (m,) of many twists (m, 3)."""
    out, room = np.empty(len(twists)), make_room(packed)
    for t in range(len(twists)):
        start(packed, twists[t, 0], twists[t, 1], twists[t, 2], room)
        out[t] = _margin(packed, floor, room)
    return out


@compiled
def contact_margins_of(packed: PackedLoads, twists: FloatArray) -> FloatArray:
    """Return the margin (m, n) of each contact at many twists (m, 3), none of them 0."""
    n, room = len(packed.loads), make_room(packed)
    out = np.zeros((len(twists), n))
    for t in range(len(twists)):
        start(packed, twists[t, 0], twists[t, 1], twists[t, 2], room)
        _bound(packed, packed.loads, room)
        for k in range(n):
            if room.size[k] > 0.0:
                r = room.rows[k]
                out[t, k] = min(r[0], r[1], r[2], r[3]) / room.size[k]
    return out


@compiled
def rows_of(packed: PackedLoads, twists: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least rows (m, n, 4) and bounds of the wrenches (m, n), N, at many twists (m, 3), none of them 0."""
    n, room = len(packed.loads), make_room(packed)
    rows, size = np.empty((len(twists), n, 4)), np.empty((len(twists), n))
    for t in range(len(twists)):
        start(packed, twists[t, 0], twists[t, 1], twists[t, 2], room)
        _bound(packed, packed.loads, room)
        rows[t], size[t] = room.rows, room.size
    return rows, size


@compiled
def inertia_rows_of(
    packed: PackedLoads, masses: FloatArray, known: FloatArray, pulls: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the least that inertia adds to the rows (m, n, 4), and its largest wrenches (m, n), N.

    The wrench of a mass point is a polynomial of its place, so that points miss next to nothing of it.

    Args:
        packed: The chain, nothing of it known by its centre alone, its `miss` 0.
        masses: (n, 2) least and largest, kg.
        known: (m, n, 3) that 1 kg of each object with a known load asks for, N, moments about the origin, N m.
        pulls: (m, p, 3) that 1 kg on each of the points asks for.
    """
    n, room = len(masses), make_room(packed)
    rows, size = np.empty((len(known), n, 4)), np.empty((len(known), n))
    for t in range(len(known)):
        room.known[:], room.pulls[:] = known[t], pulls[t]
        room.known[:, 2] /= packed.length
        room.pulls[:, 2] /= packed.length
        _bound(packed, masses, room)
        rows[t], size[t] = room.rows, room.size
    return rows, size


@compiled
def worst_spreads(packed: PackedLoads, twist: FloatArray, k: int, j: int) -> tuple[FloatArray, FloatArray]:
    """Return row j of contact k from each object's worst spread (n,), N, and these spreads (n, 3, 3): x, y, part."""
    n, room = len(packed.loads), make_room(packed)
    start(packed, twist[0], twist[1], twist[2], room)
    values, spreads = np.zeros(n), np.zeros((n, 3, 3))
    gx, gy, gm = packed.facets[k, j, 0], packed.facets[k, j, 1], packed.facets[k, j, 2]
    for i in range(n):
        if packed.carried[k, i] and packed.free[i] > 0:
            least = least_centred(packed, i, room, gx, gy, gm)
            values[i] = min(packed.loads[i, 0] * least, packed.loads[i, 1] * least)
            parts, c = shares(room.basis[i], 0.0, 0.0), packed.centers[i]
            for b in range(3):
                load = room.basis[i, b]
                spreads[i, b, 0] = load[0] + c[0] + c[2] * load[2]
                spreads[i, b, 1] = load[1] + c[1] + c[2] * load[3]
                spreads[i, b, 2] = parts[b]
    return values, spreads
