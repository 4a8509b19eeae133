"""Semismooth Newton for one step: force balance on the floor, exact Coulomb contacts at the current normals.

    g_i(U_i) = sum over contacts of +-(ln n + lt t)                                  balance of object i
    gap + n . (U_b - U_a) >= 0  _|_  ln >= 0                                         at every point
    |lt| <= mu sum ln, and lt = -mu sum ln sign(t . (U_b - U_a)) where it slips      for every manifold

Each round guesses from U and the multipliers which points press and which manifolds stick or slip, and solves the
linear system that is left, in the multipliers (Schur complement), with the matrix M_i = (1 - tau) H_i + tau K_i.

Floor friction of every object is the gradient of a dissipation, with its secant and its curvature:

    D(U) = sum_j mu N_j r_j,   r_j = sqrt(|v_j|^2 + eps^2),   v_j = J_j U = (v_x - w y_j, v_y + w x_j)
    g = sum (mu N / r) J^T v = K U,   K = sum (mu N / r) J^T J,   H = K - sum (mu N / r^3) (J^T v) (J^T v)^T

K is at least H everywhere, so a step with K never makes D larger (majorise and minimise).
"""

from __future__ import annotations

import math

from pushplan.compiled import inner, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.sim.slip.state import PackedWorld, Work
from pushplan.util.arrays import FloatArray


@inner
def floor_terms(packed: PackedWorld, work: Work, eps: float) -> None:
    """Fill gradient, secant and curvature at the twists U."""
    for i in range(len(packed.loads)):
        _terms_of(
            work.feet,
            packed.first_foot[i],
            packed.first_foot[i + 1],
            work.twists[i],
            eps,
            work.gradient[i],
            work.secant[i],
            work.curvature[i],
        )


@inner
def _terms_of(
    feet: FloatArray,
    first: int,
    last: int,
    twist: FloatArray,
    eps: float,
    g: FloatArray,
    secant: FloatArray,
    curvature: FloatArray,
) -> None:
    vx, vy, w = twist[0], twist[1], twist[2]
    kxx = kxw = kyw = kww = 0.0
    hxx = hxy = hxw = hyy = hyw = hww = 0.0
    for j in range(first, last):
        x, y = feet[j, 0], feet[j, 1]
        ux, uy = vx - w * y, vy + w * x
        # 1 / r, and c = mu N / r.
        inverse = 1.0 / math.sqrt(ux * ux + uy * uy + eps * eps)
        c = feet[j, 2] * inverse
        kxx += c
        kxw -= c * y
        kyw += c * x
        kww += c * (x * x + y * y)
        ux, uy = ux * inverse, uy * inverse
        # Last component of J^T v / r.
        turning = x * uy - y * ux
        hxx += c * ux * ux
        hxy += c * ux * uy
        hxw += c * ux * turning
        hyy += c * uy * uy
        hyw += c * uy * turning
        hww += c * turning * turning
    g[0], g[1] = kxx * vx + kxw * w, kxx * vy + kyw * w
    g[2] = kxw * vx + kyw * vy + kww * w
    secant[0], secant[1], secant[2], secant[3], secant[4], secant[5] = kxx, 0.0, kxw, kxx, kyw, kww
    curvature[0], curvature[1], curvature[2] = kxx - hxx, -hxy, kxw - hxw
    curvature[3], curvature[4], curvature[5] = kxx - hyy, kyw - hyw, kww - hww


@inner
def invert_symmetric(a: FloatArray, out: FloatArray) -> None:
    """Fill `out` (6,) with the inverse of a positive definite matrix (6,), as xx, xy, xw, yy, yw, ww."""
    xx, xy, xw, yy, yw, ww = a[0], a[1], a[2], a[3], a[4], a[5]
    cxx, cxy, cxw = yy * ww - yw * yw, xw * yw - xy * ww, xy * yw - xw * yy
    scale = 1.0 / (xx * cxx + xy * cxy + xw * cxw)
    out[0], out[1], out[2] = cxx * scale, cxy * scale, cxw * scale
    out[3] = (xx * ww - xw * xw) * scale
    out[4] = (xy * xw - xx * yw) * scale
    out[5] = (xx * yy - xy * xy) * scale


@inner
def relative_motion(work: Work, c: int, k: int) -> float:
    """Return row k of manifold c times U_b - U_a."""
    a, b, row = work.twists[work.who[c, 0]], work.twists[work.who[c, 1]], work.rows[c, k]
    return float(row[0] * (b[0] - a[0]) + row[1] * (b[1] - a[1]) + row[2] * (b[2] - a[2]))


@inner
def acts(work: Work, c: int, k: int) -> bool:
    """Tell whether row k of manifold c is an equation of the guessed modes."""
    if k == 2:
        return bool(work.modes[c, 2] == 1)
    return bool(k < work.who[c, 3] and work.modes[c, k] == 1)


@inner
def contact_wrench(work: Work, c: int) -> tuple[float, float, float]:
    """Return the wrench of manifold c on body b."""
    rows, forces = work.rows[c], work.forces[c]
    x = y = w = 0.0
    for k in range(3):
        x, y, w = x + forces[k] * rows[k, 0], y + forces[k] * rows[k, 1], w + forces[k] * rows[k, 2]
    return x, y, w


@inner
def times_inverse(work: Work, i: int, x: float, y: float, w: float) -> tuple[float, float, float]:
    """Return M_i^-1 (x, y, w)."""
    m = work.inverse[i]
    return (
        m[0] * x + m[1] * y + m[2] * w,
        m[1] * x + m[3] * y + m[4] * w,
        m[2] * x + m[4] * y + m[5] * w,
    )


@no_refcount
def release(work: Work) -> None:
    """Move U to where the balance linearised at it would be without contact forces: U - M^-1 g."""
    for i in range(len(work.gradient)):
        g, u = work.gradient[i], work.twists[i]
        x, y, w = times_inverse(work, i, g[0], g[1], g[2])
        u[0], u[1], u[2] = u[0] - x, u[1] - y, u[2] - w


@inner
def push_bodies(work: Work, c: int, n: int) -> None:
    """Add to U what the force of manifold c displaces."""
    x, y, w = contact_wrench(work, c)
    for side in range(2):
        i = work.who[c, side]
        if i < n:
            dx, dy, dw = times_inverse(work, i, x, y, w)
            sign = 2.0 * side - 1.0
            u = work.twists[i]
            u[0], u[1], u[2] = u[0] + sign * dx, u[1] + sign * dy, u[2] + sign * dw


@inner
def balance_residual(work: Work, count: int) -> float:
    """Return the largest component of what is left of an object's balance, N."""
    n = len(work.gradient)
    left = work.inverse  # free between two solutions
    for i in range(n):
        for j in range(3):
            left[i, j] = work.gradient[i, j]
    for c in range(count):
        x, y, w = contact_wrench(work, c)
        for side in range(2):
            i, sign = work.who[c, side], 1.0 - 2.0 * side
            if i < n:
                left[i, 0], left[i, 1], left[i, 2] = (
                    left[i, 0] + sign * x,
                    left[i, 1] + sign * y,
                    left[i, 2] + sign * w,
                )
    worst = 0.0
    for i in range(n):
        for j in range(3):
            worst = max(worst, abs(left[i, j]))
    return worst


@inner
def solve_linear(work: Work, count: int) -> bool:
    """Solve the balance linearised at U for the multipliers of the guessed modes; update U and multipliers."""
    n = len(work.gradient)
    release(work)
    size = _assemble(work, count)
    if not _eliminate(work.matrix, size):
        return False
    _take_forces(work, count, size)
    for c in range(count):
        push_bodies(work, c, n)
    return True


@inner
def _force_row(work: Work, c: int, k: int) -> tuple[float, float, float]:
    """Return the wrench of a unit of multiplier k on body b: a slipping normal force brings its friction along."""
    row = work.rows[c, k]
    # What sticks has its tangential multiplier as an unknown of its own.
    if k == 2 or work.modes[c, 2] == 1:
        return row[0], row[1], row[2]
    # The mode of a slip is 2 or -2.
    friction = 0.5 * work.modes[c, 2] * work.frame[c, 4]
    along = work.rows[c, 2]
    return row[0] + friction * along[0], row[1] + friction * along[1], row[2] + friction * along[2]


@inner
def _assemble(work: Work, count: int) -> int:
    """Fill the system A lambda = rhs of all equations that act; return their number."""
    size = 0
    for c in range(count):
        for k in range(3):
            size += acts(work, c, k)
    column = 0
    for c in range(count):
        for k in range(3):
            if acts(work, c, k):
                _fill_column(work, count, c, k, column)
                work.matrix[column, size] = -relative_motion(work, c, k) - (work.gaps[c, k] if k < 2 else 0.0)
                column += 1
    return size


@inner
def _fill_column(work: Work, count: int, c: int, k: int, column: int) -> None:
    """Fill in what a unit of multiplier k of manifold c displaces at every equation."""
    n = len(work.gradient)
    x, y, w = _force_row(work, c, k)
    a, b = work.who[c, 0], work.who[c, 1]
    ax = ay = aw = bx = by = bw = 0.0
    if a < n:
        ax, ay, aw = times_inverse(work, a, x, y, w)
    if b < n:
        bx, by, bw = times_inverse(work, b, x, y, w)
    line = 0
    for d in range(count):
        # A row is for U_b - U_a; the force acts on b, its reaction on a: d feels what of these two it shares.
        sa = (work.who[d, 0] == a) * 1.0 - (work.who[d, 1] == a) * 1.0
        sb = (work.who[d, 1] == b) * 1.0 - (work.who[d, 0] == b) * 1.0
        dx, dy, dw = sa * ax + sb * bx, sa * ay + sb * by, sa * aw + sb * bw
        for j in range(3):
            if acts(work, d, j):
                row = work.rows[d, j]
                work.matrix[line, column] = row[0] * dx + row[1] * dy + row[2] * dw
                line += 1


@inner
def _eliminate(matrix: FloatArray, size: int) -> bool:
    """Solve in place by elimination with partial pivoting; the last column becomes the solution."""
    trace = 0.0
    for i in range(size):
        trace += abs(matrix[i, i])
    for i in range(size):
        pivot = i
        for r in range(i + 1, size):
            if abs(matrix[r, i]) > abs(matrix[pivot, i]):
                pivot = r
        # Singular (or not a number): e.g. more contacts stick than a body has motions. The fallback's
        # complementarity needs no independent equations.
        if not abs(matrix[pivot, i]) > 1e-15 * trace:
            return False
        if pivot != i:
            for j in range(i, size + 1):
                matrix[i, j], matrix[pivot, j] = matrix[pivot, j], matrix[i, j]
        inverse = 1.0 / matrix[i, i]
        for r in range(i + 1, size):
            factor = matrix[r, i] * inverse
            if factor != 0.0:
                for j in range(i + 1, size + 1):
                    matrix[r, j] -= factor * matrix[i, j]
    for i in range(size - 1, -1, -1):
        total = matrix[i, size]
        for j in range(i + 1, size):
            total -= matrix[i, j] * matrix[j, size]
        matrix[i, size] = total / matrix[i, i]
    return True


@inner
def _take_forces(work: Work, count: int, size: int) -> None:
    """Read the multipliers out of the solved system."""
    line = 0
    for c in range(count):
        pressed = 0.0
        for k in range(3):
            work.forces[c, k] = 0.0
            if acts(work, c, k):
                work.forces[c, k] = work.matrix[line, size]
                line += 1
            if k < 2:
                pressed += work.forces[c, k]
        if abs(work.modes[c, 2]) == 2:
            work.forces[c, 2] = 0.5 * work.modes[c, 2] * work.frame[c, 4] * pressed


ROUNDS = 25
"""Rounds after which a step is left to the fallback."""
_PATIENCE = 6
"""Rounds after which tau moves from Newton's towards the majorising matrix when the residual does not halve."""
_EXACT = 100.0
"""How far constraints may be missed, in units of the residual that is wanted, times displacement over force."""
_CLOSED = 1e-12
"""Share of L up to which gaps are rounding."""
_SMALL = 1e-9
"""Of the trace of K, added to the diagonal of M."""


@inner
def newton(packed: PackedWorld, work: Work, count: int, eps: float, stiffness: float, wanted: float) -> float:
    """Solve a step from U and the multipliers in `work`; return the residual (N), infinite if it did not converge.

    Args:
        packed: The world.
        work: With manifolds; holds the result.
        count: Number of manifolds.
        eps: Displacement that smooths the floor's friction, m.
        stiffness: r, force over displacement by which both are compared, N/m.
        wanted: Residual to reach, N.
    """
    tau, before = 0.0, math.inf
    floor_terms(packed, work, eps)
    for rounds in range(ROUNDS):
        # In the first round forces are remembered ones, which no U belongs to yet: no residual tells anything then.
        changed = _set_modes(work, count, stiffness)
        residual = balance_residual(work, count) if rounds > 0 else math.inf
        if not changed and residual < wanted and stiffness * _violation(work, count) < _EXACT * wanted:
            _hold_together(work, count, packed.length)
            return residual
        if rounds > _PATIENCE:
            tau = min(1.0, tau + 0.5) if residual > 0.5 * before else max(0.0, tau - 0.25)
        before = residual
        link(work, count)
        matrices(work, tau)
        if not solve_linear(work, count):
            return math.inf
        floor_terms(packed, work, eps)
    return math.inf


@inner
def _set_modes(work: Work, count: int, stiffness: float) -> bool:
    """Guess every mode from forces and displacements; tell whether any changed."""
    changed = False
    for c in range(count):
        pressed = 0.0
        for k in range(work.who[c, 3]):
            ln = work.forces[c, k]
            # min(ln, r w) = 0 says ln >= 0 _|_ w >= 0 (w: the gap after the step); the smaller one is made 0.
            active = 1 if ln - stiffness * (work.gaps[c, k] + relative_motion(work, c, k)) > 0.0 else 0
            changed = changed or active != work.modes[c, k]
            work.modes[c, k] = active
            pressed += active * max(ln, 0.0)
        mode = _tangent_mode(work, c, pressed, stiffness)
        changed = changed or mode != work.modes[c, 2]
        work.modes[c, 2] = mode
    return changed


@inner
def _tangent_mode(work: Work, c: int, pressed: float, stiffness: float) -> int:
    if work.modes[c, 0] == 0 and (work.who[c, 3] == 1 or work.modes[c, 1] == 0):
        return 0
    # lt is the point of the friction interval that is nearest to lt - r ut: inside it sticks, at an end it slips.
    wish = work.forces[c, 2] - stiffness * relative_motion(work, c, 2)
    if abs(wish) <= work.frame[c, 4] * pressed:
        return 1
    return 2 if wish > 0.0 else -2


@inner
def _violation(work: Work, count: int) -> float:
    """Return by how much the motion misses what active normals and sticking tangents demand, m."""
    worst = 0.0
    for c in range(count):
        for k in range(3):
            if acts(work, c, k):
                gap = work.gaps[c, k] if k < 2 else 0.0
                worst = max(worst, abs(gap + relative_motion(work, c, k)))
    return worst


@inner
def _hold_together(work: Work, count: int, length: float) -> None:
    """Give bodies that stick at both ends of a closed contact the same motion to the last bit: no drift adds up.

    Pairs come in the order of the chain's contacts, so that a pushing object has its motion already.
    """
    for c in range(count):
        modes = work.modes[c]
        if work.who[c, 3] != 2 or modes[0] != 1 or modes[1] != 1 or modes[2] != 1:
            continue
        if abs(work.gaps[c, 0]) + abs(work.gaps[c, 1]) < _CLOSED * length and work.who[c, 1] < len(
            work.gradient
        ):
            for j in range(3):
                work.twists[work.who[c, 1], j] = work.twists[work.who[c, 0], j]


@no_refcount
def link(work: Work, count: int) -> None:
    """Mark the bodies that active contacts connect with the pusher: what moves the others is nothing."""
    pusher = len(work.linked) - 2
    work.linked[:] = 0
    work.linked[pusher] = 1
    # Each pass hands on at least one body farther; a chain of n objects needs n.
    for _ in range(pusher):
        for c in range(count):
            a, b = work.who[c, 0], work.who[c, 1]
            if work.modes[c, 2] != 0 and (work.linked[a] == 1 or work.linked[b] == 1):
                work.linked[a] = work.linked[b] = 1
        # What stands still hands no motion on: objects that touch the same wall are not linked by it.
        work.linked[pusher + 1] = 0


@inner
def matrices(work: Work, tau: float) -> None:
    """Fill the inverses of M; of K where nothing links an object with the pusher, which ends its motion at once."""
    m = scratch(1, 6)[0]
    for i in range(len(work.gradient)):
        part = tau if work.linked[i] == 1 else 1.0
        secant, curvature = work.secant[i], work.curvature[i]
        for j in range(6):
            m[j] = part * secant[j] + (1.0 - part) * curvature[j]
        # Friction is homogeneous of degree 1, so H U = 0: without a contact that fixes how far a body moves M has no
        # inverse.
        extra = _SMALL * (secant[0] + secant[3] + secant[5])
        m[0], m[3], m[5] = m[0] + extra, m[3] + extra, m[5] + extra
        invert_symmetric(m, work.inverse[i])
