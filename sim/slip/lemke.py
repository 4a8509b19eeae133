"""The fallback of a step: floor friction made linear with K, then more and more with H, and an LCP of the contacts.

Stewart and Trinkle 1996: for every manifold the multipliers ln (one or two), b+ and b- along the tangent and the
slack s of the friction cone, all >= 0 and complementary to

    w_n = gap + n . (U_b - U_a),   w+- = s +- t . (U_b - U_a),   w_s = mu sum ln - b+ - b-.

Lemke's method solves it. With K alone the passes are iteratively reweighted least squares, which get nearer slowly;
with H they are Newton's method. A ray means that no motion satisfies all contacts: nothing can give way, a jam.
"""

from __future__ import annotations

import math

from pushplan.compiled import inner, no_refcount
from pushplan.sim.slip.newton import (
    balance_residual,
    floor_terms,
    link,
    matrices,
    push_bodies,
    relative_motion,
    release,
    times_inverse,
)
from pushplan.sim.slip.state import PackedWorld, Work
from pushplan.util.arrays import FloatArray, IntArray

PASSES, PATIENT_PASSES = 40, 300
"""Most passes while tau is chosen, and with a fixed one."""
SOLVED, RAY, LOST = 0, 1, 2
"""Ends of Lemke's method: a solution, a ray, or too many pivots."""
_TINY = 1e-13


@inner
def reweighted(
    packed: PackedWorld,
    work: Work,
    count: int,
    eps: float,
    force: float,
    step: float,
    wanted: float,
    least: float,
    most: float,
) -> int:
    """Solve a step by passes with exact contacts, from the U in `work`; return how Lemke's method ended last.

    Args:
        packed: The world.
        work: With manifolds; holds the result.
        count: Number of manifolds.
        eps: Displacement that smooths the floor's friction, m.
        force: Unit of force of the LCP, N.
        step: Unit of displacement of the LCP, m.
        wanted: Residual at which to stop, N.
        least: Smallest tau, with which M is nearest to H.
        most: Largest tau; above 1 it shortens steps further than K does, which ends cycles of two.
    """
    tau, before = max(1.0, least), math.inf
    # With nothing linked `matrices` takes K alone in the first pass, which is at least the true curvature everywhere.
    work.linked[:] = 0
    floor_terms(packed, work, eps)
    for _ in range(PASSES if least < most else PATIENT_PASSES):
        matrices(work, tau)
        release(work)
        size = _fill_tableau(work, count, force, step)
        end = _lemke(work.tableau, work.basis, size)
        if end != SOLVED:
            return end
        _take_solution(work, count, size, force)
        floor_terms(packed, work, eps)
        residual = balance_residual(work, count)
        if residual < wanted:
            break
        _mark_pressed(work, count)
        link(work, count)
        # As in Levenberg and Marquardt's method: nearer to Newton while that pays, back quickly where it does not.
        tau = max(least, 0.5 * tau) if residual < before else min(most, 4.0 * tau)
        before = residual
    return SOLVED


@inner
def _mark_pressed(work: Work, count: int) -> None:
    """Set the modes of contacts that press, as `link` asks for them."""
    for c in range(count):
        for k in range(2):
            work.modes[c, k] = 1 if work.forces[c, k] > 0.0 else 0
        work.modes[c, 2] = 1 if work.modes[c, 0] + work.modes[c, 1] > 0 else 0


@inner
def _width(work: Work, c: int) -> int:
    """Return how many unknowns a manifold has: its normals, b+, b-, s."""
    return int(work.who[c, 3]) + 3


@no_refcount
def _unknown(work: Work, c: int, j: int) -> tuple[int, float]:
    """Return the row (0, 1 normals, 2 tangent, -1 slack) and the sign of unknown j of a manifold."""
    points = work.who[c, 3]
    if j < points:
        return j, 1.0
    return (2, 1.0) if j == points else (2, -1.0) if j == points + 1 else (-1, 0.0)


@inner
def _fill_tableau(work: Work, count: int, force: float, step: float) -> int:
    """Fill [I, -A, -1, q] of w = A z + q, displacements over `step`, forces over `force`; return its height."""
    size = 0
    for c in range(count):
        size += _width(work, c)
    tableau = work.tableau
    tableau[:size, : 2 * size + 2] = 0.0
    line = 0
    for c in range(count):
        for j in range(_width(work, c)):
            row, sign = _unknown(work, c, j)
            tableau[line, line] = 1.0
            tableau[line, 2 * size] = -1.0
            offset = 1e-12 * (line + 1.0)  # no two ratios are alike
            if row >= 0:
                offset += (
                    sign * (relative_motion(work, c, row) + (work.gaps[c, row] if row < 2 else 0.0)) / step
                )
            tableau[line, 2 * size + 1] = offset
            work.basis[line] = line
            line += 1
    _fill_responses(work, count, size, force / step)
    return size


@inner
def _fill_responses(work: Work, count: int, size: int, scale: float) -> None:
    """Fill -A: what every unknown displaces at every other one, and the friction cones."""
    column = size
    start = 0
    for c in range(count):
        points = work.who[c, 3]
        for j in range(_width(work, c)):
            row, sign = _unknown(work, c, j)
            if row >= 0:
                _respond(work, count, c, row, sign * scale, column)
                cone = start + points + 2
                work.tableau[cone, column] -= work.frame[c, 4] if row < 2 else -1.0
            else:
                work.tableau[start + points, column] -= 1.0
                work.tableau[start + points + 1, column] -= 1.0
            column += 1
        start += _width(work, c)


@inner
def _respond(work: Work, count: int, c: int, k: int, scale: float, column: int) -> None:
    """Fill what a unit of row k of manifold c, times `scale`, displaces."""
    n = len(work.gradient)
    force = work.rows[c, k]
    a, b = work.who[c, 0], work.who[c, 1]
    ax = ay = aw = bx = by = bw = 0.0
    if a < n:
        ax, ay, aw = times_inverse(work, a, force[0], force[1], force[2])
    if b < n:
        bx, by, bw = times_inverse(work, b, force[0], force[1], force[2])
    line = 0
    for d in range(count):
        sa = (work.who[d, 0] == a) * scale - (work.who[d, 1] == a) * scale
        sb = (work.who[d, 1] == b) * scale - (work.who[d, 0] == b) * scale
        dx, dy, dw = sa * ax + sb * bx, sa * ay + sb * by, sa * aw + sb * bw
        for j in range(_width(work, d)):
            row, sign = _unknown(work, d, j)
            if row >= 0:
                r = work.rows[d, row]
                work.tableau[line, column] -= sign * (r[0] * dx + r[1] * dy + r[2] * dw)
            line += 1


@inner
def _lemke(tableau: FloatArray, basis: IntArray, size: int) -> int:
    """Pivot w = A z + q to a complementary solution; q becomes the basic variables' values."""
    last = 2 * size + 1
    leaving, least = -1, 0.0
    for i in range(size):
        if tableau[i, last] < least:
            least, leaving = tableau[i, last], i
    if leaving < 0:
        return SOLVED
    # The artificial variable enters where q is least: all others are then >= 0.
    entering = 2 * size
    for _ in range(50 * size):
        _pivot(tableau, size, leaving, entering)
        left, basis[leaving] = basis[leaving], entering
        if left == 2 * size:
            return SOLVED
        # The complement of what has left enters: at most one pair is without a basic variable.
        entering = left + size if left < size else left - size
        leaving = _leaving(tableau, basis, size, entering)
        if leaving < 0:
            return RAY
    return LOST


@inner
def _leaving(tableau: FloatArray, basis: IntArray, size: int, entering: int) -> int:
    """Return the line whose variable reaches 0 first, or -1; the artificial variable goes first among equals."""
    last = 2 * size + 1
    best, line = math.inf, -1
    for i in range(size):
        slope = tableau[i, entering]
        # Rounding of 0: a pivot on it would blow up the tableau. Its entries are of order 1, by the choice of units.
        if slope <= 1e-11:
            continue
        ratio = tableau[i, last] / slope
        if ratio < best - _TINY or (ratio < best + _TINY and basis[i] == 2 * size):
            best, line = ratio, i
    return line


@inner
def _pivot(tableau: FloatArray, size: int, line: int, column: int) -> None:
    width = 2 * size + 2
    inverse = 1.0 / tableau[line, column]
    for j in range(width):
        tableau[line, j] *= inverse
    for i in range(size):
        factor = tableau[i, column]
        if i != line and factor != 0.0:
            for j in range(width):
                tableau[i, j] -= factor * tableau[line, j]


@inner
def _take_solution(work: Work, count: int, size: int, force: float) -> None:
    """Read the multipliers out of the tableau, and move the bodies by what they displace."""
    n = len(work.gradient)
    work.forces[:count] = 0.0
    for line in range(size):
        place = work.basis[line] - size
        if place < 0 or place >= size:
            continue
        c = 0
        while place >= _width(work, c):
            place -= _width(work, c)
            c += 1
        row, sign = _unknown(work, c, place)
        if row >= 0:
            work.forces[c, row] += sign * force * work.tableau[line, 2 * size + 1]
    for c in range(count):
        push_bodies(work, c, n)
