"""Compiled shortening of a path: random pairs of its poses are joined anew by exact words."""

from __future__ import annotations

import numpy as np
from numba import njit

from pushplan.arrays import FloatArray, RandomState
from pushplan.planners.collision import step
from pushplan.planners.search import Problem, random
from pushplan.planners.steering import connect

GAIN = 1e-9
"""Smallest saving (m) for which a piece of path is exchanged."""

END_SHARE = 0.2
"""Share of the attempts that begin at the start, and of those that end at the goal."""


@njit(cache=True)
def _locate(start: FloatArray, arcs: FloatArray, n: int, s: float) -> tuple[int, float, float, float, float]:
    """Return arc, cost into the arc and pose at cost `s` along the path."""
    x, y, theta = start[0], start[1], start[2]
    for i in range(n):
        if s <= arcs[i, 3] or i == n - 1:
            into = min(s, arcs[i, 3])
            x, y, theta = step(x, y, theta, arcs[i, 0], arcs[i, 1], arcs[i, 2], into)
            return i, into, x, y, theta
        x, y, theta = step(x, y, theta, arcs[i, 0], arcs[i, 1], arcs[i, 2], arcs[i, 3])
        s -= arcs[i, 3]
    return 0, 0.0, x, y, theta


@njit(cache=True)
def _append(arcs: FloatArray, n: int, twist: FloatArray, length: float) -> int:
    """Append an arc, or lengthen the last one if it is the same motion; return how many there are."""
    if length <= 0.0:
        return n
    if n > 0 and np.abs(arcs[n - 1, :3] - twist).max() < 1e-12:
        arcs[n - 1, 3] += length
        return n
    arcs[n, :3] = twist
    arcs[n, 3] = length
    return n + 1


@njit(cache=True)
def shorten(
    problem: Problem, start: FloatArray, arcs: FloatArray, n: int, state: RandomState, attempts: int
) -> FloatArray:
    """Return the shortened path (k, 4) of twists and lengths.

    Args:
        problem: See `search.Problem`.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) the path; the first `n` rows count.
        n: Arcs of the path.
        state: (1,) state of the random generator.
        attempts: Pairs of poses to try.
    """
    path = np.empty((n, 4))
    k = 0
    for i in range(n):
        k = _append(path, k, arcs[i, :3], arcs[i, 3])
    path = path[:k]
    word = np.empty((3, 4))
    for _ in range(attempts):
        total = path[:, 3].sum()
        a, b = random(state), random(state)
        ends = random(state)
        lo = 0.0 if ends < END_SHARE else min(a, b) * total
        hi = total if ends > 1.0 - END_SHARE else max(a, b) * total
        i, into_i, xi, yi, ti = _locate(start, path, path.shape[0], lo)
        j, into_j, xj, yj, tj = _locate(start, path, path.shape[0], hi)
        begin, end = np.array([xi, yi, ti]), np.array([xj, yj, tj])
        cost, _ = connect(problem.scene, problem.families, begin, end, hi - lo - GAIN, word)
        if cost == np.inf:
            continue
        joined = np.empty((path.shape[0] + 5, 4))
        k = 0
        for q in range(i):
            k = _append(joined, k, path[q, :3], path[q, 3])
        k = _append(joined, k, path[i, :3], into_i)
        for q in range(3):
            k = _append(joined, k, word[q, :3], word[q, 3])
        k = _append(joined, k, path[j, :3], path[j, 3] - into_j)
        for q in range(j + 1, path.shape[0]):
            k = _append(joined, k, path[q, :3], path[q, 3])
        path = joined[:k].copy()
    return path
