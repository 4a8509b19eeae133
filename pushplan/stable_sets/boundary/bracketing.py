"""Root finding and maximisation in many brackets at once, on a function that is only known by its values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.basics.arrays import FloatArray, IntArray

Family = Callable[[IntArray, FloatArray], FloatArray]
"""f(i, x): value of member i (m,) of a family of functions at x (m,)."""

TOLERANCE = 1e-12
"""Width of the bracket in which a root is enclosed."""
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def inner_ends(
    f: Family, inside: FloatArray, outside: FloatArray, f_inside: FloatArray, f_outside: FloatArray
) -> FloatArray:
    """Return the last points (m,) with f > 0 on the way from `inside` (f > 0) to `outside` (f <= 0).

    ITP method (Oliveira & Takahashi 2020): superlinear on smooth functions, never worse than bisection by
    more than a few steps, jumps included.
    """
    a, b, fa, fb = inside.copy(), outside.copy(), f_inside.copy(), f_outside.copy()
    width = np.abs(b - a)
    steps = np.ceil(np.log2(np.maximum(width / TOLERANCE, 1.0))) + 2.0
    kappa = 0.2 / np.maximum(width, TOLERANCE)
    live = np.flatnonzero(width > TOLERANCE)
    j = 0
    while len(live):
        x = _itp_point(a[live], b[live], fa[live], fb[live], kappa[live], steps[live] - j)
        value = f(live, x)
        positive = value > 0.0
        hit, miss = live[positive], live[~positive]
        a[hit], fa[hit] = x[positive], value[positive]
        b[miss], fb[miss] = x[~positive], value[~positive]
        live = live[(np.abs(b[live] - a[live]) > TOLERANCE) & (0.5 * (a[live] + b[live]) != a[live])]
        j += 1
    return a


def _itp_point(
    a: FloatArray, b: FloatArray, fa: FloatArray, fb: FloatArray, kappa: FloatArray, steps_left: FloatArray
) -> FloatArray:
    """Return the next points: regula falsi, moved towards the middle, projected onto the minmax interval."""
    half = 0.5 * (a + b)
    width = np.abs(b - a)
    falsi = (fb * a - fa * b) / (fb - fa)
    towards = np.sign(half - falsi)
    delta = np.maximum(kappa * width**2, 0.4 * TOLERANCE)
    perturbed = np.where(delta <= np.abs(half - falsi), falsi + towards * delta, half)
    reach = np.maximum(0.5 * TOLERANCE * 2.0 ** np.maximum(steps_left, 0.0) - 0.5 * width, 0.0)
    return np.where(np.abs(perturbed - half) <= reach, perturbed, half - towards * reach)


def maximise(
    f: Family, low: FloatArray, high: FloatArray, goal: float, iterations: int
) -> tuple[FloatArray, FloatArray]:
    """Return the best points and values (m,) of golden-section searches; each stops once above `goal`."""
    low, high = low.copy(), high.copy()
    everyone = np.arange(len(low))
    x1, x2 = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    f1, f2 = f(everyone, x1), f(everyone, x2)
    live = np.flatnonzero(np.maximum(f1, f2) <= goal)
    for _ in range(iterations):
        if len(live) == 0:
            break
        right = f1[live] < f2[live]
        up, down = live[right], live[~right]
        low[up], x1[up], f1[up] = x1[up], x2[up], f2[up]
        high[down], x2[down], f2[down] = x2[down], x1[down], f1[down]
        x2[up] = low[up] + _GOLDEN * (high[up] - low[up])
        x1[down] = high[down] - _GOLDEN * (high[down] - low[down])
        values = f(live, np.where(right, x2[live], x1[live]))
        f2[up], f1[down] = values[right], values[~right]
        live = live[values <= goal]
    first = f1 >= f2
    return np.where(first, x1, x2), np.where(first, f1, f2)
