"""The linear system of a guess of modes: the balance linearised at U, solved for the multipliers."""

from __future__ import annotations

from pushplan.compiled import inner
from pushplan.sim.slip.kernels.multipliers import acts, push_bodies, relative_motion, release, times_inverse
from pushplan.sim.slip.kernels.packed import Work
from pushplan.util.arrays import FloatArray


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
