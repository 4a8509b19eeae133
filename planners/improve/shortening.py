"""Shorten paths: random pairs of points are joined by steering paths, and corners are cut."""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import any_integer, compiled, inlined, no_refcount
from pushplan.planners.collision.separation import step
from pushplan.planners.improve.local_changes import normals_of, vary
from pushplan.planners.problem.objective import GAIN, TRAVEL, Objective, arc_value
from pushplan.planners.problem.problem import TRIES, Problem, between, random
from pushplan.planners.problem.rows import put, put_rows
from pushplan.planners.problem.steering import LEFT, RIGHT, STRAIGHT, connect
from pushplan.util.arrays import FloatArray, RandomState


@no_refcount
def objective_value(objective: Objective, path: FloatArray) -> float:
    """Return the value of a path (k, 4)."""
    if objective.kind == TRAVEL:
        return float(path[:, 3].sum() + objective.per_arc * path.shape[0])
    total = 0.0
    for k in range(path.shape[0]):
        total += arc_value(objective, path[k, 0], path[k, 1], path[k, 2], path[k, 3])
    return total


@no_refcount
def _worth(
    objective: Objective, path: FloatArray, i: int, into_i: float, j: int, into_j: float, travel: float
) -> float:
    """Travel (m) that a word must stay below to be cheaper than the piece of path between two places."""
    if objective.kind == TRAVEL:
        return travel + objective.per_arc * (j - i + 1)
    total = 0.0
    for k in range(i, j + 1):
        length = (into_j if k == j else path[k, 3]) - (into_i if k == i else 0.0)
        total += arc_value(objective, path[k, 0], path[k, 1], path[k, 2], max(length, 0.0))
    return total / objective.lowest


@no_refcount
def locate(start: FloatArray, arcs: FloatArray, s: float, pose: FloatArray) -> tuple[int, float]:
    """Return arc and cost into the arc at cost `s` along the path; fill in the `pose` (3,) there."""
    x, y, theta = start[0], start[1], start[2]
    last = arcs.shape[0] - 1
    for i in range(last):
        if s <= arcs[i, 3]:
            break
        x, y, theta = step(x, y, theta, arcs[i, 0], arcs[i, 1], arcs[i, 2], arcs[i, 3])
        s -= arcs[i, 3]
    else:
        i = last
    s = min(s, arcs[i, 3])
    pose[0], pose[1], pose[2] = step(x, y, theta, arcs[i, 0], arcs[i, 1], arcs[i, 2], s)
    return i, s


@inlined
def _differ(one: FloatArray, other: FloatArray) -> float:
    """Largest difference of two twists, the first three numbers."""
    return float(max(abs(one[0] - other[0]), abs(one[1] - other[1]), abs(one[2] - other[2])))


@inlined
def _append(arcs: FloatArray, n: int, twist: FloatArray, length: float) -> int:
    """Append an arc, or lengthen the last one if it is the same motion; return how many there are."""
    if length <= 0.0:
        return n
    # Rounding apart, the same motion: one arc of both, for which no stop and no price of an arc is due.
    if n > 0 and _differ(arcs[n - 1], twist) < 1e-12:
        arcs[n - 1, 3] += length
        return n
    put(arcs[n], twist)
    arcs[n, 3] = length
    return n + 1


@compiled
def merged(arcs: FloatArray) -> FloatArray:
    """Return a path (k, 4) without empty arcs and with neighbours of the same motion made one."""
    path = np.empty(arcs.shape)
    n = 0
    for i in range(arcs.shape[0]):
        n = _append(path, n, arcs[i, :3], arcs[i, 3])
    return path[:n].copy()


@inlined
def _spliced(path: FloatArray, i: int, into_i: float, word: FloatArray, j: int, into_j: float) -> FloatArray:
    """Return the path with everything between two places exchanged for a word."""
    joined = np.empty((path.shape[0] + 5, 4))
    put_rows(joined, path[: i + 1])
    joined[i, 3] = into_i
    put_rows(joined[i + 1 :], word)
    put_rows(joined[i + 4 :], path[j:])
    joined[i + 4, 3] = path[j, 3] - into_j
    return merged(joined[: i + 4 + path.shape[0] - j])


@no_refcount
def random_family(segments: FloatArray, state: RandomState, family: FloatArray) -> None:
    """Fill `family` (3, 3) with a left turn, a straight push and a right turn drawn from the stable set.

    Turns are drawn from the ends of the segments, where they are tightest, as often as from within. A motion of
    which the drawn segment has none is left at zero.
    """
    family[:] = 0.0
    for letter in range(3):
        segment = segments[int(random(state) * segments.shape[0])]
        # Along a segment, omega goes from low to high: right turns, translations (at `level`), left turns.
        low, high = segment[2], segment[5]
        level = low / (low - high) if low * high < 0.0 else -1.0  # where the segment crosses the translations
        b = 0.0 if letter == RIGHT else 1.0
        if random(state) < 0.5:
            b = random(state) * (level if letter == RIGHT else 1.0 - level) if level > 0.0 else random(state)
            b = b if letter == RIGHT else 1.0 - b
        if letter == STRAIGHT:
            if level > 0.0:
                family[letter, 0], family[letter, 1], _ = between(segment, level)
        elif (low < 0.0) if letter == RIGHT else (high > 0.0):
            family[letter, 0], family[letter, 1], family[letter, 2] = between(segment, b)
            if family[letter, 2] * (1.0 if letter == LEFT else -1.0) < 1e-6:
                family[letter] = 0.0


@inlined
def _some_family(problem: Problem, state: RandomState, family: FloatArray) -> None:
    """Fill `family` (1, 3, 3) with a steering family, or with one drawn from the whole stable set."""
    if random(state) < 0.8:
        random_family(problem.segments, state, family[0])
    else:
        put_rows(family[0], problem.families[int(random(state) * problem.families.shape[0])])


@inlined
def _window(state: RandomState, total: float) -> tuple[float, float]:
    """Draw a piece of a path: its length log-uniform, its place uniform, ends clipped to the path's."""
    # Log-uniform, from 7 % of the path on: short pieces need many tries, each with little to gain, long ones few with
    # much.
    length = total * math.exp(math.log(0.07) * random(state))
    low = -0.5 * length + random(state) * total
    return max(0.0, low), min(total, low + length)


@no_refcount
def rejoin(
    problem: Problem,
    state: RandomState,
    begin: FloatArray,
    end: FloatArray,
    bound: float,
    family: FloatArray,
    word: FloatArray,
) -> float:
    """Join two poses by the cheapest free word of some family; return its cost, infinite if above the bound.

    Both `family` (1, 3, 3) and `word` (3, 4) are filled in.
    """
    _some_family(problem, state, family)
    return connect(problem.scene, family, begin, end, bound, TRIES, word)[0]


@compiled
def shorten(
    problem: Problem, start: FloatArray, arcs: FloatArray, state: RandomState, attempts: int
) -> FloatArray:
    """Return the shortened path (k, 4) of twists and lengths.

    Args:
        problem: What to plan.
        start: (3,) pose at the path's beginning.
        arcs: (m, 4) the path.
        state: (1,) state of the random generator.
        attempts: Pairs of poses to try.
    """
    path = merged(arcs)
    normals = normals_of(problem.segments)
    family, word = np.empty((1, 3, 3)), np.empty((3, 4))
    begin, end = np.empty(3), np.empty(3)
    for _ in range(attempts):
        # Words find a path's form, small changes of its twists and lengths the best of that form: half of each.
        if random(state) < 0.5 and path.shape[0] > 0:
            path = vary(problem, normals, start, path, state)
            continue
        low, high = _window(state, path[:, 3].sum())
        i, into_i = locate(start, path, low, begin)
        j, into_j = locate(start, path, high, end)
        # A word that costs less than the piece; what its arcs are worth in the objective is known only then.
        bound = _worth(problem.objective, path, i, into_i, j, into_j, high - low)
        if rejoin(problem, state, begin, end, bound, family, word) < bound:
            exchanged = _spliced(path, i, into_i, word, j, into_j)
            if (
                objective_value(problem.objective, exchanged)
                < objective_value(problem.objective, path) - GAIN
            ):
                path = exchanged
    return path


CORNER_TRIES = any_integer(3)
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
                connect(problem.scene, problem.families, corners[i], corners[j], bound, CORNER_TRIES, word)[0]
                < bound
            ):
                break
            j -= 1
        for k in range(3 if j > i + 1 else 1):
            put(out[n], word[k] if j > i + 1 else arcs[i])
            n += 1
        i = j
    return merged(out[:n])
