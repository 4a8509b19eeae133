"""The words of a car that drives forwards and backwards (Reeds and Shepp 1990), in closed form.

Lengths are in units of the turning radius. The formulas are those of the paper's sections 8.1 to 8.11, in the letters
that they have in OMPL; each stands for four words: driven the other way, mirrored, and both.
"""

from __future__ import annotations

import math

from pushplan.compiled import inlined, no_refcount
from pushplan.util.arrays import FloatArray

LEFT, STRAIGHT, RIGHT = 1, 0, -1
"""Letters: the sign of the curvature."""

LETTERS = 5
"""Of a word, at most."""

FORMULAS = 11
MOST_WORDS = 4 * FORMULAS

ROUNDING = 1e-10
"""By so much, in radii of turning, lengths of the wrong sign are zeros; not tuned."""


@inlined
def wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@no_refcount
def _tau_omega(u: float, v: float, xi: float, eta: float, phi: float) -> tuple[float, float]:
    delta = wrapped(u - v)
    a, b = math.sin(u) - math.sin(delta), math.cos(u) - math.cos(delta) - 1.0
    first = math.atan2(eta * a - xi * b, xi * a + eta * b)
    second = 2.0 * (math.cos(delta) - math.cos(v) - math.cos(u)) + 3.0
    tau = wrapped(first + math.pi) if second < 0.0 else wrapped(first)
    return tau, wrapped(tau - u + v - phi)


@inlined
def _solve(formula: int, x: float, y: float, phi: float, letters: FloatArray, lengths: FloatArray) -> int:
    """Fill in a word that leads from the origin to (x, y, phi); return its number of letters, 0 if there is none."""
    plus = formula in (0, 2, 5)  # the last turn is to the same side as the first
    sign = 1.0 if plus else -1.0
    xi, eta = x - sign * math.sin(phi), y - 1.0 + sign * math.cos(phi)
    rho, theta = math.hypot(xi, eta), math.atan2(eta, xi)
    count = 3
    letters[0] = LEFT
    t = u = v = 0.0
    if formula == 0:  # L S L
        letters[1], letters[2] = STRAIGHT, LEFT
        t, u = theta, rho
        v = wrapped(phi - t)
        if t < -ROUNDING or v < -ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2] = t, u, v
    elif formula == 1:  # L S R
        letters[1], letters[2] = STRAIGHT, RIGHT
        if rho < 2.0:
            return 0
        u = math.sqrt(rho * rho - 4.0)
        t = wrapped(theta + math.atan2(2.0, u))
        v = wrapped(t - phi)
        if t < -ROUNDING or v < -ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2] = t, u, v
    elif formula == 2:  # L R- L
        letters[1], letters[2] = RIGHT, LEFT
        if rho > 4.0:
            return 0
        u = -2.0 * math.asin(0.25 * rho)
        t = wrapped(theta + 0.5 * u + math.pi)
        v = wrapped(phi - t + u)
        if t < -ROUNDING or u > ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2] = t, u, v
    elif formula == 3:  # L R L- R-
        count, letters[1], letters[2], letters[3] = 4, RIGHT, LEFT, RIGHT
        share = 0.25 * (2.0 + rho)
        if share > 1.0:
            return 0
        u = math.acos(share)
        t, v = _tau_omega(u, -u, xi, eta, phi)
        if t < -ROUNDING or v > ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2], lengths[3] = t, u, -u, v
    elif formula == 4:  # L R- L- R
        count, letters[1], letters[2], letters[3] = 4, RIGHT, LEFT, RIGHT
        share = (20.0 - rho * rho) / 16.0
        if share < 0.0 or share > 1.0:
            return 0
        u = -math.acos(share)
        t, v = _tau_omega(u, u, xi, eta, phi)
        if t < -ROUNDING or v < -ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2], lengths[3] = t, u, u, v
    elif formula == 5:  # L R- S- L-
        count, letters[1], letters[2], letters[3] = 4, RIGHT, STRAIGHT, LEFT
        if rho < 2.0:
            return 0
        r = math.sqrt(rho * rho - 4.0)
        u = 2.0 - r
        t = wrapped(theta + math.atan2(r, -2.0))
        v = wrapped(phi - 0.5 * math.pi - t)
        if t < -ROUNDING or u > ROUNDING or v > ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2], lengths[3] = t, -0.5 * math.pi, u, v
    elif formula == 6:  # L R- S- R-
        count, letters[1], letters[2], letters[3] = 4, RIGHT, STRAIGHT, RIGHT
        if rho < 2.0:
            return 0
        t = math.atan2(xi, -eta)
        u = 2.0 - rho
        v = wrapped(t + 0.5 * math.pi - phi)
        if t < -ROUNDING or u > ROUNDING or v > ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2], lengths[3] = t, -0.5 * math.pi, u, v
    else:  # L R- S- L- R
        count, letters[1], letters[2], letters[3], letters[4] = 5, RIGHT, STRAIGHT, LEFT, RIGHT
        if rho < 2.0:
            return 0
        u = 4.0 - math.sqrt(rho * rho - 4.0)
        if u > ROUNDING:
            return 0
        t = wrapped(math.atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta))
        v = wrapped(t - phi)
        if t < -ROUNDING or v < -ROUNDING:
            return 0
        lengths[0], lengths[1], lengths[2] = t, -0.5 * math.pi, u
        lengths[3], lengths[4] = -0.5 * math.pi, v
    return count


@no_refcount
def find_reeds_shepp(
    x: float, y: float, phi: float, counts: FloatArray, letters: FloatArray, lengths: FloatArray
) -> int:
    """Fill in the words that lead from the origin to a pose, in turning radii and rad.

    Args:
        x: Of the pose.
        y: Likewise.
        phi: Likewise.
        counts: (MOST_WORDS,) filled with the number of letters of each word.
        letters: (MOST_WORDS, LETTERS) filled with `LEFT`, `STRAIGHT` and `RIGHT`.
        lengths: (MOST_WORDS, LETTERS) filled with their lengths, < 0 backwards.

    Returns:
        How many there are.
    """
    n = 0
    for formula in range(FORMULAS):
        # The last three are the ones of formulas 2, 5 and 6 with their letters in the opposite order.
        turned = formula >= 8
        base = (2, 5, 6)[formula - 8] if turned else formula
        px, py = x, y
        if turned:
            px, py = x * math.cos(phi) + y * math.sin(phi), x * math.sin(phi) - y * math.cos(phi)
        for flip in (1.0, -1.0):
            for mirror in (1.0, -1.0):
                count = _solve(base, flip * px, mirror * py, flip * mirror * phi, letters[n], lengths[n])
                if count == 0:
                    continue
                for i in range(count):
                    lengths[n, i] *= flip
                    letters[n, i] *= mirror
                if turned:
                    for i in range(count // 2):
                        j = count - 1 - i
                        letters[n, i], letters[n, j] = letters[n, j], letters[n, i]
                        lengths[n, i], lengths[n, j] = lengths[n, j], lengths[n, i]
                counts[n] = count
                n += 1
    return n
