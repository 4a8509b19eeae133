"""Root finding and maximisation in many brackets at once, on a function that is only known by its values.

All open brackets are asked for one value each at a time; steps from values to the next places are compiled.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pushplan.compiled import compiled, inlined
from pushplan.util.arrays import FloatArray, IntArray

Family = Callable[[IntArray, FloatArray], FloatArray]
"""f(i, x): value of member i (m,) of a family of functions at x (m,)."""

TOLERANCE = 1e-12
"""Width of the bracket in which a root is enclosed."""
_PUSH = 1e-3
_DOUBT = 4.0
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def inner_ends(f: Family, brackets: FloatArray) -> FloatArray:
    """Return the last points (m,) with f > 0 on the way from the inside (f > 0) to the outside (f <= 0).

    ITP method (Oliveira & Takahashi 2020): superlinear on smooth functions, never worse than bisection by
    more than a few steps, jumps included.

    Args:
        f: Known by its values.
        brackets: (m, 4) places inside and outside, and the values there.
    """
    state = np.zeros((len(brackets), 6))
    state[:, :4] = brackets
    live, x, value = np.arange(len(state)), state[:, 0].copy(), state[:, 2].copy()
    while n := _enclose(state, live, x, value):
        value = f(live[:n], x[:n])
    return state[:, 0]


@compiled
def _enclose(state: FloatArray, live: IntArray, x: FloatArray, value: FloatArray) -> int:
    """Take the values (n,) at the first n of `x`, and put there where to look next; return how many are open.

    Args:
        state: (m, 6) ends inside and outside, values there, steps left and kappa (0: not begun) of every bracket.
        live: The open brackets, at the front.
        x: Where they are looked at.
        value: What was found there.
    """
    n = 0
    for j in range(len(value)):
        i = live[j]
        side = 0 if value[j] > 0.0 else 1
        state[i, side], state[i, 2 + side] = x[j], value[j]
        a, b, fa, fb, steps, kappa = state[i]
        half, gap = 0.5 * (a + b), abs(b - a)
        if kappa == 0.0:
            width = max(gap, TOLERANCE)
            steps, kappa = math.ceil(math.log2(width / TOLERANCE)) + 3.0, _PUSH / width
        steps -= 1.0
        state[i, 4], state[i, 5] = steps, kappa
        if not (gap > TOLERANCE and half != a):
            continue
        falsi = (fb * a - fa * b) / (fb - fa)
        delta = max(kappa * gap * gap, 0.4 * TOLERANCE)
        towards = 1.0 if half > falsi else -1.0
        point = falsi + towards * delta if delta <= abs(half - falsi) else half
        reach = max(0.5 * TOLERANCE * 2.0 ** max(steps, 0.0) - 0.5 * gap, 0.0)
        if abs(point - half) > reach:
            point = half - towards * reach
        live[n], x[n], n = i, point, n + 1
    return n


def maximise(
    f: Family,
    low: FloatArray,
    high: FloatArray,
    goal: float,
    iterations: int,
    ends: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the best points and values (m,) of golden-section searches; each stops once above `goal`.

    Args:
        f: Known by its values.
        low: (m,) where to begin.
        high: (m,) where to end.
        goal: Value that is enough.
        iterations: Most values asked for after the first two.
        ends: (m,) values at `low` and `high`. With them, a search is given up where a rise by `_DOUBT` times what a
            concave function could still have would not reach the goal.
    """
    first, x, live = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low), np.arange(len(low))
    state = np.empty((len(low), 9))
    state[:, 0], state[:, 1], state[:, 2], state[:, 3] = low, first, x, high
    if ends is not None:
        state[:, 4], state[:, 7] = ends
    state[:, 5], value = f(np.concatenate([live, live]), np.concatenate([first, x])).reshape(2, -1)
    state[:, 8] = iterations
    while n := _narrow(state, live, x, value, goal, ends is not None):
        value = f(live[:n], x[:n])
    better = state[:, 5] >= state[:, 6]
    return np.where(better, state[:, 1], state[:, 2]), np.where(better, state[:, 5], state[:, 6])


@compiled
def _narrow(
    state: FloatArray, live: IntArray, x: FloatArray, value: FloatArray, goal: float, concave: bool
) -> int:
    """Do for `maximise` what `_enclose` does; a row of `state` is four places, the values there, and steps left."""
    n = 0
    for j in range(len(value)):
        i = live[j]
        row = state[i]
        row[6 if x[j] == row[2] else 5] = value[j]
        row[8] -= 1.0
        best = max(row[5], row[6])
        if best > goal or row[8] < -0.5 or (concave and best + _DOUBT * (_highest(row) - best) <= goal):
            continue
        if row[5] < row[6]:
            row[0], row[1], row[4], row[5] = row[1], row[2], row[5], row[6]
            row[2] = row[0] + _GOLDEN * (row[3] - row[0])
            x[n] = row[2]
        else:
            row[3], row[2], row[7], row[6] = row[2], row[1], row[6], row[5]
            row[1] = row[3] - _GOLDEN * (row[3] - row[0])
            x[n] = row[1]
        live[n], n = i, n + 1
    return n


@inlined
def _highest(row: FloatArray) -> float:
    """Return the largest value that a concave function with four known ones may have."""
    a, b, c, d, fa, fb, fc, fd, _ = row
    rise, slope, fall = (fb - fa) / (b - a), (fc - fb) / (c - b), (fd - fc) / (d - c)
    crossing = min(max((fc - fb - fall * (c - b)) / (rise - fall), 0.0), c - b)
    return float(max(fb + rise * crossing, fb - slope * (b - a), fc + slope * (d - c)))
