"""The contact conditions in the worst case over loads and frictions in intervals, compiled; see `interval_rows`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, no_refcount
from pushplan.mechanics.friction.kernel import carried_wrench
from pushplan.mechanics.friction.packed import PackedChain
from pushplan.mechanics.worst_case.pressure_error import CELLS_MISS, center, row_loss, size_loss
from pushplan.util.arrays import BoolArray, FloatArray, IntArray


class PackedIntervals(NamedTuple):
    """A chain with intervals, for compiled code.

    Attributes:
        parts: Every object, or each foot of one whose fractions are intervals, with a unit friction load, (p,).
        first_part: (n + 1,) where the parts of each object begin.
        spans: (p, 2) interval of each part's share of its object's load.
        cells: (c, 3) x, y (m) and share of the load of every cell of the pressures that may be off.
        first_cell: (n + 1,) where the cells of each object begin.
        errors: (n,) share by which each object's pressure may be off.
        loads: (n, 2) least and largest friction load of every object, N.
        carried: (n, n) whether contact k carries object i.
        facets: (n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length) > 0.
        length: Characteristic length of the chain, m.
    """

    parts: PackedChain
    first_part: IntArray
    spans: FloatArray
    cells: FloatArray
    first_cell: IntArray
    errors: FloatArray
    loads: FloatArray
    carried: BoolArray
    facets: FloatArray
    length: float


class Bounds(NamedTuple):
    """What is asked for at one twist, and room to work in; moments are divided by the length.

    Attributes:
        rows: (n, 4) least value of every facet.
        size: (n,) largest size of every contact's wrench.
        wrenches: (p, 3) of all parts.
        pulls: (c, 3) of all cells.
        middle: (n, 3) wrenches at the intervals' middles.
        values: (p,) of one row.
    """

    rows: FloatArray
    size: FloatArray
    wrenches: FloatArray
    pulls: FloatArray
    middle: FloatArray
    values: FloatArray


@compiled
def make_bounds(packed: PackedIntervals) -> Bounds:
    """Return arrays to be filled."""
    n, p = len(packed.loads), len(packed.spans)
    return Bounds(
        np.empty((n, 4)),
        np.empty(n),
        np.empty((p, 3)),
        np.empty((len(packed.cells), 3)),
        np.empty((n, 3)),
        np.empty(p),
    )


@no_refcount
def _pull_parts(packed: PackedIntervals, vx: float, vy: float, omega: float, bounds: Bounds) -> None:
    """Fill in the wrenches that unit friction loads on all parts ask for at a body twist other than 0."""
    scale = max(abs(vx), abs(vy), abs(omega) * packed.length)
    vx, vy, omega = vx / scale, vy / scale, omega / scale
    objects, parts, series, links, _, _ = packed.parts
    for p in range(len(packed.spans)):
        fx, fy, m = carried_wrench(objects, parts, series, links, p, vx, vy, omega)
        bounds.wrenches[p, 0], bounds.wrenches[p, 1], bounds.wrenches[p, 2] = fx, fy, m / packed.length


@no_refcount
def _pull_cells(packed: PackedIntervals, vx: float, vy: float, omega: float, bounds: Bounds) -> None:
    """Fill in the same for unit friction loads in all cells."""
    for c in range(len(packed.cells)):
        x, y = packed.cells[c, 0], packed.cells[c, 1]
        u, v = vx - omega * y, vy + omega * x
        speed = math.sqrt(u * u + v * v)
        if speed > 0.0:  # where nothing moves, nothing pulls
            u, v = u / speed, v / speed
        bounds.pulls[c, 0], bounds.pulls[c, 1], bounds.pulls[c, 2] = u, v, (x * v - y * u) / packed.length


@no_refcount
def _least_sum(values: FloatArray, spans: FloatArray, first: int, stop: int) -> float:
    """Return the least of sum_p phi_p values (p,) over shares phi_p in their intervals that sum to 1.

    What the lower ends leave goes to the smallest values first.
    """
    total, left = 0.0, 1.0
    for p in range(first, stop):
        total += spans[p, 0] * values[p]
        left -= spans[p, 0]
    for p in range(first, stop):
        before = 0.0
        for q in range(first, stop):
            if values[q] < values[p] or (values[q] == values[p] and q < p):
                before += spans[q, 1] - spans[q, 0]
        total += min(max(left - before, 0.0), spans[p, 1] - spans[p, 0]) * values[p]
    return total


@no_refcount
def _middle(packed: PackedIntervals, i: int, bounds: Bounds) -> tuple[float, float, float, float]:
    """Return the wrench of object i, per unit, at the middles of its shares, and by how much these may change it."""
    x = y = m = spread = 0.0
    for p in range(packed.first_part[i], packed.first_part[i + 1]):
        fx, fy, mz = bounds.wrenches[p, 0], bounds.wrenches[p, 1], bounds.wrenches[p, 2]
        low, high = packed.spans[p, 0], packed.spans[p, 1]
        half = 0.5 * (low + high)
        x, y, m = x + half * fx, y + half * fy, m + half * mz
        spread += 0.5 * (high - low) * math.sqrt(fx * fx + fy * fy + mz * mz)
    return x, y, m, spread


@no_refcount
def _least_row(packed: PackedIntervals, i: int, gx: float, gy: float, gm: float, bounds: Bounds) -> float:
    """Return the least of a row of object i, per unit, over its shares."""
    first, stop = packed.first_part[i], packed.first_part[i + 1]
    for p in range(first, stop):
        bounds.values[p] = (
            gx * bounds.wrenches[p, 0] + gy * bounds.wrenches[p, 1] + gm * bounds.wrenches[p, 2]
        )
    return _least_sum(bounds.values, packed.spans, first, stop)


@no_refcount
def _sum_up(
    packed: PackedIntervals, factors: FloatArray, constant: float, pressures: bool, bounds: Bounds
) -> None:
    """Fill in rows and sizes from the wrenches and pulls of units, times factors (n, 2) in their intervals.

    Args:
        packed: The chain.
        factors: Friction loads (N) or masses (kg), least and largest.
        constant: What cells may miss of a pressure's loss; see `pressure_error`.
        pressures: Whether errors of the pressures count.
        bounds: Wrenches and pulls are read, rows and sizes filled in.
    """
    rows, size, _, pulls, middle, _ = bounds
    rows[:], size[:], middle[:] = 0.0, 0.0, 0.0
    for i in range(len(factors)):
        low, high, error = factors[i, 0], factors[i, 1], packed.errors[i] if pressures else 0.0
        begin, end = packed.first_cell[i], packed.first_cell[i + 1]
        x, y, m, spread = _middle(packed, i, bounds)
        if error > 0.0:
            center(pulls, packed.cells, begin, end)
            spread += error * size_loss(pulls, packed.cells, begin, end, constant)
        half = 0.5 * (low + high)
        added = 0.5 * (high - low) * math.sqrt(x * x + y * y + m * m) + high * spread
        for k in range(len(factors)):
            if not packed.carried[k, i]:
                continue
            middle[k, 0], middle[k, 1] = middle[k, 0] + half * x, middle[k, 1] + half * y
            middle[k, 2], size[k] = middle[k, 2] + half * m, size[k] + added
            for j in range(4):
                gx, gy, gm = packed.facets[k, j, 0], packed.facets[k, j, 1], packed.facets[k, j, 2]
                row = _least_row(packed, i, gx, gy, gm, bounds)
                if error > 0.0:
                    row -= error * row_loss(pulls, packed.cells, begin, end, gx, gy, gm, constant)
                rows[k, j] += min(low * row, high * row)
    for k in range(len(size)):
        size[k] += math.sqrt(middle[k, 0] ** 2 + middle[k, 1] ** 2 + middle[k, 2] ** 2)


@no_refcount
def _bound(packed: PackedIntervals, vx: float, vy: float, omega: float, bounds: Bounds) -> None:
    """Fill in the quasi-static rows and sizes at a body twist other than 0."""
    _pull_parts(packed, vx, vy, omega, bounds)
    _pull_cells(packed, vx, vy, omega, bounds)
    _sum_up(packed, packed.loads, CELLS_MISS[1], True, bounds)


@no_refcount
def _margin_of_contact(bounds: Bounds, k: int) -> float:
    """Return the least row of contact k divided by the largest size of its wrench; 0 for no wrench."""
    rows, size = bounds.rows, bounds.size[k]
    if size == 0.0:
        return 0.0
    return float(min(rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3]) / size)


@no_refcount
def _least_margin(
    packed: PackedIntervals, vx: float, vy: float, omega: float, floor: float, bounds: Bounds
) -> float:
    """Return what `interval_margin_down_to` does.

    Errors of the pressures only take away, and cost most: they are left out where the margin is too small without.
    """
    _pull_parts(packed, vx, vy, omega, bounds)
    lowest = 1.0
    for pressures in range(2):
        if pressures == 1:
            _pull_cells(packed, vx, vy, omega, bounds)
        _sum_up(packed, packed.loads, CELLS_MISS[1], pressures == 1, bounds)
        lowest = 1.0
        for k in range(len(bounds.size)):
            lowest = min(lowest, _margin_of_contact(bounds, k))
        if lowest <= floor or len(packed.cells) == 0:
            break
    return lowest


@compiled
def interval_margin_down_to(
    packed: PackedIntervals, vx: float, vy: float, omega: float, floor: float
) -> float:
    """Return the smallest margin at a body twist other than 0; any number up to `floor` for a smaller one."""
    return _least_margin(packed, vx, vy, omega, floor, make_bounds(packed))


@compiled
def interval_margins_of(packed: PackedIntervals, twists: FloatArray, floor: float) -> FloatArray:
    """Return `interval_margin_down_to` (k,) of many twists (k, 3)."""
    out, bounds = np.empty(len(twists)), make_bounds(packed)
    for i in range(len(twists)):
        out[i] = _least_margin(packed, twists[i, 0], twists[i, 1], twists[i, 2], floor, bounds)
    return out


@compiled
def interval_contact_margins_of(packed: PackedIntervals, twists: FloatArray) -> FloatArray:
    """Return the margin (k, n) of each contact at many twists (k, 3), none of them 0."""
    bounds = make_bounds(packed)
    out = np.empty((len(twists), len(bounds.size)))
    for i in range(len(twists)):
        _bound(packed, twists[i, 0], twists[i, 1], twists[i, 2], bounds)
        for k in range(len(bounds.size)):
            out[i, k] = _margin_of_contact(bounds, k)
    return out


@compiled
def quasi_static_rows_of(packed: PackedIntervals, twists: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least rows (k, n, 4) and the largest wrenches (k, n), N, at many twists (k, 3), none of them 0."""
    bounds = make_bounds(packed)
    rows, size = np.empty((len(twists), len(bounds.size), 4)), np.empty((len(twists), len(bounds.size)))
    for i in range(len(twists)):
        _bound(packed, twists[i, 0], twists[i, 1], twists[i, 2], bounds)
        rows[i], size[i] = bounds.rows, bounds.size
    return rows, size


@compiled
def inertia_rows_of(
    packed: PackedIntervals, masses: FloatArray, wrenches: FloatArray, pulls: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the least that inertia adds to the rows (k, n, 4), and its largest wrenches (k, n), N.

    The wrench of a mass point is a polynomial of its place, so that the cells miss next to nothing of it.

    Args:
        packed: The chain.
        masses: (n, 2) least and largest, kg.
        wrenches: (k, p, 3) that 1 kg of every part asks for, N, moments about the chain frame's origin, N m.
        pulls: (k, c, 3) that 1 kg in every cell asks for.
    """
    bounds = make_bounds(packed)
    rows, size = np.empty((len(wrenches), len(bounds.size), 4)), np.empty((len(wrenches), len(bounds.size)))
    for i in range(len(wrenches)):
        bounds.wrenches[:], bounds.pulls[:] = wrenches[i], pulls[i]
        bounds.wrenches[:, 2] /= packed.length
        bounds.pulls[:, 2] /= packed.length
        _sum_up(packed, masses, 0.0, True, bounds)
        rows[i], size[i] = bounds.rows, bounds.size
    return rows, size
