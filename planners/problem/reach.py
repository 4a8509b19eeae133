"""What exact free words cost between many poses: a table of starts and goals."""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import any_integer, compiled
from pushplan.planners.collision.separation import Scene, separation
from pushplan.planners.problem.posing import ROUNDING, SLACK, scene_with_gap
from pushplan.planners.problem.steering import MAX_WORDS, connect
from pushplan.util.arrays import FloatArray

TRIES = any_integer(MAX_WORDS)
"""Words between two poses that are swept: all of them."""


@compiled
def reach(
    scene: Scene, families: FloatArray, starts: FloatArray, goals: FloatArray, clearance: float
) -> FloatArray:
    """Return the costs (n, m) of the cheapest free words from starts (n, 3) to goals (m, 3), inf where none is.

    Args:
        scene: An `open_scene`; between two poses it keeps what `scene_between` says.
        families: (f, 3, 3) left, straight and right twists.
        starts: Poses of the chain frame.
        goals: Likewise.
        clearance: What start and goal must have at least, m.
    """
    out, arcs, gaps = np.full((len(starts), len(goals)), np.inf), np.empty((3, 4)), np.empty(len(goals))
    for j in range(len(goals)):
        gaps[j] = separation(scene, goals[j, 0], goals[j, 1], goals[j, 2], clearance + SLACK)
    for i in range(len(starts)):
        gap = separation(scene, starts[i, 0], starts[i, 1], starts[i, 2], clearance + SLACK)
        for j in range(len(goals)):
            # Searched with what the nearer of the two ends keeps, as `scene_between` does.
            least = min(gap, gaps[j])
            if least < clearance - ROUNDING:
                continue
            between = scene_with_gap(scene, least, clearance)
            out[i, j] = connect(between, families, starts[i], goals[j], math.inf, TRIES, arcs)[0]
    return out
