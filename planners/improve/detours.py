"""Detours of the best path: a piece of it is led through a pose nearby, polished, and kept if it became cheaper.

Polishing goes downhill only: with another heading between two obstacles, say, the path may be cheaper, but all paths
on the way there may be dearer or blocked. A detour starts beyond them.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.arrays import FloatArray, RandomState
from pushplan.compiled import compiled, inlined
from pushplan.planners.collision import separation
from pushplan.planners.improve.polish import locate, merged, price, rejoin
from pushplan.planners.improve.session import Session
from pushplan.planners.problem.problem import Problem, random
from pushplan.planners.problem.rows import put_rows

SHORTEST, LONGEST = 0.15, 0.6
"""Length of the pieces, as a share of the path; log-uniform."""

ASIDE = 0.06
"""Largest distance of the new pose from the piece, along either axis, as a share of the path's length."""

TURNED = 1.0
"""Largest angle between the new pose and the piece's, rad."""

SMALLEST = 0.1
"""Smallest of both, as a share of the largest; log-uniform."""

MIDDLE = 0.6
"""Share of the piece, in its middle, beside which new poses are drawn."""

EXCESS = 0.3
"""Share by which a detour may be dearer than the piece before it is polished."""

POSES = 20
"""Poses tried, at most, until there is a detour."""

FAMILIES = 4
"""Families tried, at most, for the word to the new pose, and for that from there."""


@inlined
def _beside(begin: FloatArray, piece: FloatArray, aside: float, state: RandomState, pose: FloatArray) -> None:
    """Draw a pose (3,) beside a piece of path."""
    s = 0.5 * (1.0 - MIDDLE) + MIDDLE * random(state)
    locate(begin, piece, s * piece[:, 3].sum(), pose)
    size = math.exp(math.log(SMALLEST) * random(state))
    pose[0] += aside * size * (2.0 * random(state) - 1.0)
    pose[1] += aside * size * (2.0 * random(state) - 1.0)
    pose[2] += TURNED * size * (2.0 * random(state) - 1.0)


@inlined
def _word(
    problem: Problem,
    state: RandomState,
    begin: FloatArray,
    end: FloatArray,
    bound: float,
    family: FloatArray,
    word: FloatArray,
) -> float:
    """Join two poses by a free word of one of a few families; return its cost, infinite if above the bound."""
    for _ in range(FAMILIES):
        cost = rejoin(problem, state, begin, end, bound, family, word)
        if cost < bound:
            return cost
    return np.inf


@compiled
def detour(
    problem: Problem, begin: FloatArray, piece: FloatArray, aside: float, bound: float, state: RandomState
) -> FloatArray:
    """Return a free way (k, 4) to the goal through a pose beside a piece of path, no arcs if none was found.

    Args:
        problem: What to plan; its goal is where the piece ends.
        begin: (3,) pose where it begins.
        piece: (m, 4) its twists and lengths.
        aside: Largest distance of the pose from the piece, along either axis, m.
        bound: Travel (m) that the way must stay below.
        state: (1,) of the random generator.
    """
    family, word, pose, way = np.empty((1, 3, 3)), np.empty((3, 4)), np.empty(3), np.empty((6, 4))
    for _ in range(POSES):
        _beside(begin, piece, aside, state, pose)
        clearance = problem.scene.clearance
        if separation(problem.scene, pose[0], pose[1], pose[2], 2.0 * clearance) < clearance:
            continue
        there = _word(problem, state, begin, pose, bound, family, word)
        if there < bound:
            put_rows(way, word)
            if _word(problem, state, pose, problem.goal, bound - there, family, word) < np.inf:
                put_rows(way[3:], word)
                return merged(way)
    return np.empty((0, 4))


def try_detour(session: Session) -> None:
    """Try one detour of the best path, if there is one."""
    path = session.best_arcs
    if path is None:
        return
    total = path[:, 3].sum()
    length = total * LONGEST * math.exp(math.log(SHORTEST / LONGEST) * random(session.random))
    low = random(session.random) * total - 0.5 * length
    begin, end = np.empty(3), np.empty(3)
    i, into_i = locate(session.start, path, max(0.0, low), begin)
    j, into_j = locate(session.start, path, min(total, low + length), end)
    if i == j:
        return
    piece = path[i : j + 1].copy()
    piece[-1, 3] = into_j
    piece[0, 3] -= into_i
    problem = session.problem._replace(goal=end)
    to_beat = price(problem.prices, piece)
    session.tried(POSES)
    bound = (1.0 + EXCESS) * to_beat / problem.prices.lowest
    way = detour(problem, begin, piece, ASIDE * total, bound, session.random)
    if len(way) == 0:
        return
    for polished in session.polishing(problem, begin, way, to_beat):
        way = polished
    if price(problem.prices, way) < to_beat:
        before, after = path[: i + 1].copy(), path[j:].copy()
        before[-1, 3] = into_i
        after[0, 3] -= into_j
        session.take(merged(np.concatenate([before, way, after])))
