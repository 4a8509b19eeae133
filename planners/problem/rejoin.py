"""The rest of an earlier path as a path between other poses."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pushplan.core.collision import Scene
from pushplan.core.problem import connect, poses_along, reach
from pushplan.geometry.se2 import compose, relative
from pushplan.planners.problem.problem import scene_between
from pushplan.plans.path import PushPath
from pushplan.util.arrays import BoolArray, FloatArray


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
    s = np.unique(np.append(np.linspace(0.0, path.cost, 24), np.cumsum(path.lengths)))
    onto = compose(goal, relative(path.end, path.poses_at(s)))
    words = reach(scene, families, start[None], onto, clearance)[0]
    between = scene_between(scene, clearance, start, goal)
    for k in np.argsort(words + path.cost - s)[:4]:  # so few are swept, cheapest first
        if words[k] == math.inf:
            break
        rest = _rest(path, float(s[k]))
        if len(rest) and not (
            stable(rest[:, :3]).all() and poses_along(between, onto[k], rest)[1] == len(rest)
        ):
            continue
        _, _, word = connect(between, families, start, onto[k])
        if word is not None:
            return np.concatenate([word, rest])
    return None


def _rest(path: PushPath, s: float) -> FloatArray:
    """Return the arcs (k, 4) that are left from the cost `s` on."""
    ends = np.cumsum(path.lengths)
    left = np.minimum(path.lengths, ends - s)
    ahead = left > 1e-9
    return np.column_stack([path.twists, left])[ahead]
