"""The contact conditions [C1]-[C4] of Harada et al. 2006 for every contact of a tree, as one margin.

Contact k has to transmit w_k, minus the friction wrenches of all objects that it carries. In a wrench space
where moments are divided by the chain's characteristic length, the wrenches it can transmit form a cone with
four unit facets g, and

    margin_k = min over g of  g . w_k / |w_k|,

the sine of the angle between w_k and the nearest facet: positive exactly where the contact holds.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import compiled, inlined, no_refcount
from pushplan.mechanics.friction.kernel import carried_wrench
from pushplan.mechanics.friction.packed import PackedChain
from pushplan.util.arrays import FloatArray


@no_refcount
def contact_wrenches(packed: PackedChain, vx: float, vy: float, omega: float, out: FloatArray) -> None:
    """Fill `out` (n, 3) with the wrench that each contact transmits: f_x, f_y (N), moment (N m) about 0.

    Only the twist's direction matters; the zero twist gives zero wrenches.
    """
    objects, parts, series, links, _, length = packed
    out[:] = 0.0
    size = max(abs(vx), abs(vy), abs(omega) * length)
    if not size > 0.0:
        return
    vx, vy, omega = vx / size, vy / size, omega / size
    for k in range(len(links) - 1, -1, -1):
        wrench = carried_wrench(objects, parts, series, links, k, vx, vy, omega)
        _load(out, k, links[k, 3], wrench)


@inlined
def _load(carried: FloatArray, k: int, pusher: int, wrench: tuple[float, float, float]) -> None:
    """Add object k's wrench to `carried[k]` (n, 3), which then is whole, and that to its pusher's."""
    for j in range(3):
        carried[k, j] += wrench[j]
        if pusher >= 0:
            carried[pusher, j] += carried[k, j]


@no_refcount
def wrench_margin(rows: FloatArray, k: int, fx: float, fy: float, m: float) -> float:
    """Return the margin of contact k for a transmitted wrench, m divided by the length; 0 for no wrench."""
    size = math.sqrt(fx * fx + fy * fy + m * m)
    if size == 0.0:
        return 0.0
    lowest = math.inf
    for j in range(4):
        lowest = min(lowest, rows[k, j, 0] * fx + rows[k, j, 1] * fy + rows[k, j, 2] * m)
    return lowest / size


@compiled
def contact_margins(packed: PackedChain, vx: float, vy: float, omega: float, out: FloatArray) -> None:
    """Fill `out` (n,) with the margin of each contact at a body twist in the chain frame, in [-1, 1]."""
    wrenches = np.empty((len(packed.links), 3))
    contact_wrenches(packed, vx, vy, omega, wrenches)
    for k in range(len(wrenches)):
        w = wrenches[k]
        out[k] = wrench_margin(packed.rows, k, w[0], w[1], w[2] / packed.length)


@compiled
def margin_down_to(packed: PackedChain, vx: float, vy: float, omega: float, floor: float) -> float:
    """Return `margin`, or, as soon as a contact's margin is at most `floor`, that one."""
    return _least_margin(packed, vx, vy, omega, floor, np.empty((len(packed.links), 3)))


@no_refcount
def _least_margin(
    packed: PackedChain, vx: float, vy: float, omega: float, floor: float, carried: FloatArray
) -> float:
    """Return what `margin_down_to` does; `carried` (n, 3) is overwritten."""
    objects, parts, series, links, rows, length = packed
    size = max(abs(vx), abs(vy), abs(omega) * length)
    if not size > 0.0:
        return 0.0
    vx, vy, omega = vx / size, vy / size, omega / size
    carried[:] = 0.0
    lowest = 1.0
    for k in range(len(links) - 1, -1, -1):
        wrench = carried_wrench(objects, parts, series, links, k, vx, vy, omega)
        _load(carried, k, links[k, 3], wrench)
        lowest = min(lowest, wrench_margin(rows, k, carried[k, 0], carried[k, 1], carried[k, 2] / length))
        if lowest <= floor:
            break
    return lowest


@compiled
def margin(packed: PackedChain, vx: float, vy: float, omega: float) -> float:
    """Return the smallest margin over the contacts: > 0 exactly when the body twist keeps all of them."""
    return margin_down_to(packed, vx, vy, omega, -2.0)


@compiled
def margins_of(packed: PackedChain, twists: FloatArray, floor: float) -> FloatArray:
    """Return `margin_down_to` (k,) of many twists (k, 3)."""
    out, carried = np.empty(len(twists)), np.empty((len(packed.links), 3))
    for i in range(len(twists)):
        out[i] = _least_margin(packed, twists[i, 0], twists[i, 1], twists[i, 2], floor, carried)
    return out


@compiled
def wrenches_of(packed: PackedChain, twists: FloatArray) -> FloatArray:
    """Return `contact_wrenches` (k, n, 3) of many twists (k, 3)."""
    out = np.empty((len(twists), len(packed.links), 3))
    for i in range(len(twists)):
        contact_wrenches(packed, twists[i, 0], twists[i, 1], twists[i, 2], out[i])
    return out


@compiled
def facet_rows(facets: FloatArray, wrenches: FloatArray, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the rows g . w (k, n, 4) of facets (n, 4, 3) and wrenches (k, n, 3), and the wrenches' sizes (k, n).

    Moments are divided by `length`, m.
    """
    rows, size = np.empty((len(wrenches), len(facets), 4)), np.empty((len(wrenches), len(facets)))
    for i in range(len(wrenches)):
        for k in range(len(facets)):
            x, y, m = wrenches[i, k, 0], wrenches[i, k, 1], wrenches[i, k, 2] / length
            size[i, k] = math.sqrt(x * x + y * y + m * m)
            for j in range(4):
                g = facets[k, j]
                rows[i, k, j] = g[0] * x + g[1] * y + g[2] * m
    return rows, size


@compiled
def contact_margins_of(packed: PackedChain, wrenches: FloatArray) -> FloatArray:
    """Return the margins (k, n) of transmitted wrenches (k, n, 3)."""
    out = np.empty((len(wrenches), len(packed.links)))
    for i in range(len(out)):
        for k in range(len(packed.links)):
            w = wrenches[i, k]
            out[i, k] = wrench_margin(packed.rows, k, w[0], w[1], w[2] / packed.length)
    return out


@compiled
def object_wrenches_of(packed: PackedChain, twists: FloatArray) -> FloatArray:
    """Return the wrenches (k, 3) that move the first object at many twists (k, 3), none of them zero."""
    objects, parts, series, links, _, length = packed
    out = np.empty((len(twists), 3))
    for i in range(len(twists)):
        vx, vy, omega = twists[i, 0], twists[i, 1], twists[i, 2]
        size = max(abs(vx), abs(vy), abs(omega) * length)
        wrench = carried_wrench(objects, parts, series, links, 0, vx / size, vy / size, omega / size)
        out[i, 0], out[i, 1], out[i, 2] = wrench
    return out
