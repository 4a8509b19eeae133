"""Contact forces and motions that belong together: rows, wrenches, and what forces displace."""

from __future__ import annotations

from pushplan.compiled import inner, no_refcount
from pushplan.sim.slip.kernels.packed import Work


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
