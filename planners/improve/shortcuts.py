"""A path without detours that exact words avoid: from each corner straight to the farthest that can be."""

from __future__ import annotations

import numpy as np

from pushplan.compiled import any_integer, compiled
from pushplan.planners.collision.separation import step
from pushplan.planners.improve.polish import merged
from pushplan.planners.problem.problem import Problem
from pushplan.planners.problem.rows import put
from pushplan.planners.problem.steering import connect
from pushplan.util.arrays import FloatArray

TRIES = any_integer(3)
"""Words between two corners that are swept, at most."""


@compiled
def cut_short(problem: Problem, start: FloatArray, arcs: FloatArray, per_arc: float) -> FloatArray:
    """Return the path (k, 4) with pieces exchanged for free words that are shorter, or of fewer arcs.

    Args:
        problem: What to plan.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) twists and lengths.
        per_arc: What an arc counts beside its length, m.
    """
    count = len(arcs)
    corners, word, out = np.empty((count + 1, 3)), np.empty((3, 4)), np.empty((3 * count, 4))
    corners[0] = start
    for i in range(count):
        pose, arc = corners[i], arcs[i]
        corners[i + 1] = step(pose[0], pose[1], pose[2], arc[0], arc[1], arc[2], arc[3])
    i, n = 0, 0
    while i < count:
        j = count
        while j > i + 1:
            # A word has three arcs: it may be longer by what the arcs count that it saves.
            bound = arcs[i:j, 3].sum() + per_arc * (j - i - 3)
            if (
                connect(problem.scene, problem.families, corners[i], corners[j], bound, TRIES, word)[0]
                < bound
            ):
                break
            j -= 1
        for k in range(3 if j > i + 1 else 1):
            put(out[n], word[k] if j > i + 1 else arcs[i])
            n += 1
        i = j
    return merged(out[:n])
