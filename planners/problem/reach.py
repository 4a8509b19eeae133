"""Costs of steering paths between many poses, and the rest of an earlier path as a path between other poses."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pushplan.compiled import any_integer, compiled
from pushplan.geometry.se2 import compose, relative
from pushplan.planners.collision.separation import Scene, separation, sweep_is_free
from pushplan.planners.problem.problem import ROUNDING, SLACK, scene_between, scene_with_gap
from pushplan.planners.problem.steering import MAX_WORDS, connect
from pushplan.plans.path import PushPath
from pushplan.util.arrays import BoolArray, FloatArray

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


def rejoin(
    scene: Scene,
    families: FloatArray,
    clearance: float,
    stable: Callable[[FloatArray], BoolArray],
    path: PushPath,
    start: FloatArray,
    goal: FloatArray,
) -> FloatArray | None:
    """Return the arcs (k, 4) of the cheapest way onto an earlier path and along its rest; None where none is free.

    The rest is moved rigidly so that it ends at the goal, which need not be where the path ended.

    Args:
        scene: An `open_scene`.
        families: (f, 3, 3) left, straight and right twists.
        clearance: Distance that is kept, m.
        stable: Tells which of twists (k, 3) have the margin that is asked for.
        path: The earlier one.
        start: (3,) pose of the chain frame in the world.
        goal: Likewise.
    """
    start = np.array(start, dtype=np.float64)  # a copy: for one that is read-only all would be compiled anew
    s = np.unique(np.append(np.linspace(0.0, path.cost, 24), np.cumsum(path.lengths)))
    onto = compose(goal, relative(path.end, path.poses_at(s)))
    words = reach(scene, families, start[None], onto, clearance)[0]
    between = scene_between(scene, clearance, start, goal)
    for k in np.argsort(words + path.cost - s)[:4]:  # so few are swept, cheapest first
        if words[k] == math.inf:
            break
        rest = _rest(path, float(s[k]))
        if len(rest) and not (stable(rest[:, :3]).all() and _is_free_rejoin(between, onto[k], rest)):
            continue
        word = np.zeros((3, 4))
        if connect(between, families, start, onto[k], math.inf, MAX_WORDS, word)[0] < math.inf:
            return np.concatenate([word, rest])
    return None


def _rest(path: PushPath, s: float) -> FloatArray:
    """Return the arcs (k, 4) that are left from the cost `s` on."""
    ends = np.cumsum(path.lengths)
    left = np.minimum(path.lengths, ends - s)
    ahead = left > 1e-9
    return np.column_stack([path.twists, left])[ahead]


def _is_free_rejoin(scene: Scene, pose: FloatArray, arcs: FloatArray) -> bool:
    """Tell whether arcs (k, 4) from a pose (3,) are free."""
    here = PushPath(pose, arcs[:, :3], arcs[:, 3])
    return all(
        sweep_is_free(scene, knot[0], knot[1], knot[2], twist[0], twist[1], twist[2], length)
        for knot, twist, length in zip(here.knots, here.twists, here.lengths, strict=False)
    )
