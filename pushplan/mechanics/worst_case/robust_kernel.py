"""The contact conditions in the worst case over all pressures with the given centres, as one margin.

The row g of contact k is at least sum_i F_i e_i over the objects it carries, e_i the lower convex envelope of
`envelope_kernel` at the centre of object i, as each object's pressure can be the worst one independently. If
F_i is only known as an interval, its end that gives less counts: the sum is linear in every F_i. The margin is

    min over rows of  sum_i F_i e_i / sqrt(F^2 + (M / L)^2),

F the sum of the F_i and M a bound of the moment (see `_largest_wrench`): at most the sine that `ecof` has for
any of the pressures, and equal to it for translations, where nothing but the centres counts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, no_refcount
from pushplan.mechanics.worst_case.area_table import G_X, G_Y, HEAD, SHIFT, SIZE, SOLID
from pushplan.mechanics.worst_case.envelope_kernel import least_load, start_twist
from pushplan.util.arrays import BoolArray, FloatArray


class PackedAreas(NamedTuple):
    """The loads and contacts of n objects for compiled code.

    Attributes:
        tables: (n, rows, WIDTH) see `area_table`; their twist changes, so that every thread needs its own.
        loads: (n, 2) least and largest friction load of each object, N.
        carried: (n, n) whether contact k carries object i.
        facets: (n, 4, 3) gamma and kappa (1/m) of the unit facets of each contact's wrench cone.
        length: Characteristic length of the chain, m.
    """

    tables: FloatArray
    loads: FloatArray
    carried: BoolArray
    facets: FloatArray
    length: float


@no_refcount
def central_loads(areas: PackedAreas, vx: float, vy: float, omega: float, out: FloatArray) -> None:
    """Fill `out` (n, 7) with unit loads on the centres g and bounds of how other pressures differ from them.

    With u = u(g), g x u, rho = |c - g|, r the size of the support around g and s the sense, all friction
    forces and their moments about g are

        f = (1 - A) u + B J u,   m = s M,   0 <= A <= a,  |B| <= b,  M_0 <= M <= M_1.

    For x - g of mean 0 and angles psi in which c sees x and g apart, |sin psi| <= |x - g| / rho and
    | |x - c| - rho | <= |x - g| bound the means A of 1 - cos psi, B of sin psi and M of |x - c| - rho cos psi.
    A load whose centre friction has shifted by n = -h mu f adds |n| / rho to b.

    Columns: u, g x u, a, b, M_0, M_1.
    """
    for i in range(len(areas.tables)):
        x, y = areas.tables[i, HEAD, G_X], areas.tables[i, HEAD, G_Y]
        size, shift = areas.tables[i, HEAD, SIZE], areas.tables[i, HEAD, SHIFT]
        ux, uy = vx - omega * y, vy + omega * x
        speed = math.hypot(ux, uy)
        turn = math.fabs(omega)
        if speed <= 1e-12 * turn * size:  # it turns on the spot
            out[i, 0], out[i, 1], out[i, 2] = 1.0, 0.0, -y
            out[i, 3], out[i, 4], out[i, 5], out[i, 6] = 2.0, 1.0, -size, size
            continue
        out[i, 0], out[i, 1], out[i, 2] = ux / speed, uy / speed, (x * uy - y * ux) / speed
        near = size * turn / speed
        out[i, 3] = min((1.0 if near <= 1.0 else 2.0) * near * near, 2.0)
        out[i, 4] = min(near * near + shift * turn / speed, 1.0)
        away = shift * out[i, 4]
        rise = size * near + 2.0 * away
        grown = rise / (1.0 + math.sqrt(1.0 + rise * turn / speed))
        out[i, 5] = -min(away, size)
        out[i, 6] = min(grown + (out[i, 3] * speed / turn if turn > 0.0 else 0.0), size)


@no_refcount
def _largest_wrench(areas: PackedAreas, k: int, central: FloatArray) -> float:
    """Return a bound of |w_k|, N; 0 when nothing that contact k carries has any floor friction."""
    load = low = high = spread = reach = 0.0
    for i in range(k, len(areas.tables)):
        if not areas.carried[k, i]:
            continue
        x, y = areas.tables[i, HEAD, G_X], areas.tables[i, HEAD, G_Y]
        least, most, moment = areas.loads[i, 0], areas.loads[i, 1], central[i, 2]
        load += most
        low += min(least * moment, most * moment)
        high += max(least * moment, most * moment)
        along = math.fabs(central[i, 0] * x + central[i, 1] * y)
        other = max(-central[i, 5], central[i, 6])
        spread += most * (math.fabs(moment) * central[i, 3] + along * central[i, 4] + other)
        reach += most * (math.hypot(x, y) + areas.tables[i, HEAD, SIZE])
    return math.hypot(load, min(max(-low, high) + spread, reach) / areas.length)


@no_refcount
def _least_of(areas: PackedAreas, i: int, value: float) -> float:
    """Return the least of F_i times `value`."""
    return float(min(areas.loads[i, 0] * value, areas.loads[i, 1] * value))


@no_refcount
def _central_row(areas: PackedAreas, k: int, j: int, i: int, central: FloatArray) -> float:
    """Return row j of contact k for a unit load on the centre of object i."""
    gamma_x, gamma_y, kappa = areas.facets[k, j, 0], areas.facets[k, j, 1], areas.facets[k, j, 2]
    return float(gamma_x * central[i, 0] + gamma_y * central[i, 1] + kappa * central[i, 2])


@no_refcount
def _low_row(areas: PackedAreas, k: int, j: int, i: int, central: FloatArray, omega: float) -> float:
    """Return a quick lower bound of row j of contact k for a unit load on object i, from `central_loads`."""
    kappa = areas.facets[k, j, 2]
    gamma_x = areas.facets[k, j, 0] - kappa * areas.tables[i, HEAD, G_Y]
    gamma_y = areas.facets[k, j, 1] + kappa * areas.tables[i, HEAD, G_X]
    row = gamma_x * central[i, 0] + gamma_y * central[i, 1]
    across = math.fabs(gamma_x * central[i, 1] - gamma_y * central[i, 0])
    lever = math.copysign(kappa, kappa * omega)
    turning = min(lever * central[i, 5], lever * central[i, 6])
    return float(row - max(row, 0.0) * central[i, 3] - across * central[i, 4] + turning)


@no_refcount
def _is_above(areas: PackedAreas, k: int, j: int, central: FloatArray, omega: float, goal: float) -> bool:
    """Return whether row j of contact k is quickly seen to be above `goal`, N, for all pressures."""
    total = 0.0
    for i in range(k, len(areas.tables)):
        if areas.carried[k, i]:
            total += _least_of(areas, i, _low_row(areas, k, j, i, central, omega))
    return total > goal


@no_refcount
def worst_row(areas: PackedAreas, k: int, j: int, central: FloatArray, goal: float) -> float:
    """Return the least of row j of contact k, N; anything from `goal` on is as good as the exact number.

    Every object is asked to leave its share of what the loads on the centres have to spare.
    """
    total, spare, load = 0.0, -goal, 0.0
    for i in range(k, len(areas.tables)):
        if areas.carried[k, i]:
            load += areas.loads[i, 1]
            spare += _least_of(areas, i, _central_row(areas, k, j, i, central))
    gamma_x, gamma_y, kappa = areas.facets[k, j, 0], areas.facets[k, j, 1], areas.facets[k, j, 2]
    for i in range(k, len(areas.tables)):
        if areas.carried[k, i] and areas.loads[i, 1] > 0.0:
            guess = _central_row(areas, k, j, i, central)
            enough = guess - spare / load if spare > 0.0 else math.inf
            least = least_load(areas.tables[i], gamma_x, gamma_y, kappa, enough)
            total += _least_of(areas, i, least)
            spare += _least_of(areas, i, least) - _least_of(areas, i, guess)
            load -= areas.loads[i, 1]
    return total


@no_refcount
def _update(
    areas: PackedAreas, k: int, j: int, central: FloatArray, omega: float, size: float, least: float
) -> float:
    """Return the smaller one of `least` and the margin of row j of contact k."""
    goal = least * size
    if _is_above(areas, k, j, central, omega, goal):
        return least
    if least < math.inf and worst_row(areas, k, j, central, goal) >= goal:
        return least
    return min(least, worst_row(areas, k, j, central, math.inf) / size)


@no_refcount
def _guess_rows(areas: PackedAreas, k: int, central: FloatArray, size: float, guess: FloatArray) -> None:
    """Fill `guess` (n, 4) at contact k with the margins of its rows for loads on the centres."""
    for j in range(4):
        guess[k, j] = 0.0 if size > 0.0 else math.inf
        for i in range(k, len(areas.tables)):
            if areas.carried[k, i] and size > 0.0:
                guess[k, j] += _least_of(areas, i, _central_row(areas, k, j, i, central)) / size


@no_refcount
def _lowest(guess: FloatArray) -> tuple[int, int]:
    """Return where the least element of an (n, 4) array is."""
    best, row = 0, 0
    for k in range(len(guess)):
        for j in range(4):
            if guess[k, j] < guess[best, row]:
                best, row = k, j
    return best, row


@no_refcount
def _begin(areas: PackedAreas, twists: FloatArray, t: int, central: FloatArray, sizes: FloatArray) -> float:
    """Set a twist of all objects, fill the central loads (n, 7) and bounds of wrenches (n,); return omega."""
    vx, vy, omega = twists[t, 0], twists[t, 1], twists[t, 2]
    scale = 1.0 / max(abs(vx), abs(vy), abs(omega) * areas.length)
    vx, vy, omega = vx * scale, vy * scale, omega * scale
    central_loads(areas, vx, vy, omega, central)
    for i in range(len(areas.tables)):
        start_twist(areas.tables[i], vx, vy, omega)
    for k in range(len(areas.tables)):
        sizes[k] = _largest_wrench(areas, k, central)
    return float(omega)


@compiled
def robust_margins_of(areas: PackedAreas, twists: FloatArray, floor: float) -> FloatArray:
    """Return the margins (m,) at twists (m, 3), none of them 0; those up to `floor` need not be exact.

    The rows are looked at in the order of what they are for loads on the centres. Where these are pressures
    that can be, they bound the margin from above.
    """
    n = len(areas.tables)
    central, sizes, guess, out = np.empty((n, 7)), np.empty(n), np.empty((n, 4)), np.empty(len(twists))
    can_be = True
    for i in range(n):
        can_be = can_be and areas.tables[i, HEAD, SOLID] > 0.0 and areas.tables[i, HEAD, SHIFT] == 0.0
    for t in range(len(twists)):
        omega = _begin(areas, twists, t, central, sizes)
        least = math.inf
        for k in range(n):
            _guess_rows(areas, k, central, sizes[k], guess)
            if sizes[k] == 0.0:
                least = 0.0
        for _ in range(4 * n):
            k, j = _lowest(guess)
            if can_be and guess[k, j] <= floor:
                least = min(least, guess[k, j])
            if least <= floor or guess[k, j] == math.inf:
                break
            guess[k, j] = math.inf
            least = _update(areas, k, j, central, omega, sizes[k], least)
        out[t] = least
    return out


@compiled
def robust_margin_down_to(areas: PackedAreas, vx: float, vy: float, omega: float, floor: float) -> float:
    """Return `robust_margins_of` at one twist, in the form of `contact_kernel.margin_down_to`."""
    twists = np.empty((1, 3))
    twists[0, 0], twists[0, 1], twists[0, 2] = vx, vy, omega
    return float(robust_margins_of(areas, twists, floor)[0])


@compiled
def robust_contact_margins_of(areas: PackedAreas, twists: FloatArray) -> FloatArray:
    """Return the margin (m, n) of each contact at twists (m, 3), none of them 0."""
    n = len(areas.tables)
    central, sizes, out = np.empty((n, 7)), np.empty(n), np.zeros((len(twists), n))
    for t in range(len(twists)):
        omega = _begin(areas, twists, t, central, sizes)
        for k in range(n):
            least = math.inf if sizes[k] > 0.0 else 0.0
            for j in range(4):
                if sizes[k] > 0.0:
                    least = _update(areas, k, j, central, omega, sizes[k], least)
            out[t, k] = least
    return out


@compiled
def robust_rows_of(areas: PackedAreas, twists: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least of the rows (m, n, 4) over all pressures at twists (m, 3), none of them 0, N.

    The second array (m, n) bounds the contacts' wrenches for all of them, N; see `_largest_wrench`.
    """
    n = len(areas.tables)
    central, sizes, out = np.empty((n, 7)), np.empty((len(twists), n)), np.empty((len(twists), n, 4))
    for t in range(len(twists)):
        _begin(areas, twists, t, central, sizes[t])
        for k in range(n):
            for j in range(4):
                out[t, k, j] = worst_row(areas, k, j, central, math.inf)
    return out, sizes
