"""Compiled local changes of a path: one arc's twist or length, or an arc left out, and three lengths that close it.

Joining poses by words (`polish`) finds a path's form; this finds the best twists and lengths of that form.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import compiled, inlined, no_refcount
from pushplan.compiled.scratch import scratch, scratch_integers
from pushplan.planners.collision.separation import step, sweep_is_free
from pushplan.planners.problem.objective import Objective, arc_value
from pushplan.planners.problem.problem import Problem, between, random
from pushplan.planners.problem.rows import put, put_rows
from pushplan.util.arrays import FloatArray, IntArray, RandomState

KEEP_SHARE = 0.75
"""Share of the new twists that stay what they were: on the boundary of the stable set, or without rotation."""

AT_END = 1e-9
"""Share of a segment within which a twist is at its end."""


@compiled
def normals_of(segments: FloatArray) -> FloatArray:
    """Return the unit normals (k, 3) of the planes through the segments (k, 6), zero for single twists."""
    normals = np.zeros((segments.shape[0], 3))
    for i in range(segments.shape[0]):
        a, b = segments[i, :3], segments[i, 3:]
        x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        size = math.sqrt(x * x + y * y + z * z)
        if size > 1e-12:
            normals[i, 0], normals[i, 1], normals[i, 2] = x / size, y / size, z / size
    return normals


@inlined
def _parts(segment: FloatArray, normal: FloatArray, t: FloatArray) -> tuple[float, float]:
    """Return alpha and beta of the combination alpha a + beta b of a segment's ends nearest to a twist."""
    a, b = segment[:3], segment[3:]
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    # t = alpha a + beta b in the plane of a and b: alpha = (t x b).n / (a x b).n, beta = (a x t).n / (a x b).n.
    size = x * normal[0] + y * normal[1] + z * normal[2]
    alpha = (
        (t[1] * b[2] - t[2] * b[1]) * normal[0]
        + (t[2] * b[0] - t[0] * b[2]) * normal[1]
        + (t[0] * b[1] - t[1] * b[0]) * normal[2]
    )
    beta = (
        (a[1] * t[2] - a[2] * t[1]) * normal[0]
        + (a[2] * t[0] - a[0] * t[2]) * normal[1]
        + (a[0] * t[1] - a[1] * t[0]) * normal[2]
    )
    return alpha / size, beta / size


@no_refcount
def _whereabouts(segments: FloatArray, normals: FloatArray, t: FloatArray) -> tuple[int, float]:
    """Return the segment that a twist lies on, or nearly, and the share of its second end; -1 for none."""
    best, found, share = np.inf, -1, 0.0
    for i in range(segments.shape[0]):
        normal = normals[i]
        # Twists on a segment lie in its plane; of several planes, the nearest one between whose ends the twist is.
        away = abs(t[0] * normal[0] + t[1] * normal[1] + t[2] * normal[2])
        if away < best and (normal[0] != 0.0 or normal[1] != 0.0 or normal[2] != 0.0):
            alpha, beta = _parts(segments[i], normal, t)
            if alpha > -AT_END and beta > -AT_END:
                best, found, share = away, i, beta / (alpha + beta)
    return found, min(1.0, max(0.0, share))


@inlined
def _size(state: RandomState) -> float:
    """Draw a log-uniform size from 1e-4 to 1, with a random sign."""
    size = math.exp(math.log(1e-4) * random(state))
    return size if random(state) < 0.5 else -size


@inlined
def _change_twist(segments: FloatArray, normals: FloatArray, state: RandomState, twist: FloatArray) -> bool:
    """Exchange a twist for a stable one near it; False when there is none."""
    i, b = _whereabouts(segments, normals, twist)
    if i < 0:
        return False
    k = segments.shape[0]
    # Segments are neighbours along the longitude: a small step stays near the twist.
    i = min(k - 1, max(0, i + round(_size(state) * 0.25 * k)))
    segment = segments[i]
    # Translations and twists at the end of a segment (the tightest turns) are good, but have measure zero: chance
    # alone would never find back to them.
    if twist[2] == 0.0 and segment[2] * segment[5] < 0.0 and random(state) < KEEP_SHARE:
        b = segment[2] / (segment[2] - segment[5])
    elif min(b, 1.0 - b) > AT_END or random(state) > KEEP_SHARE:
        b = min(1.0, max(0.0, b + _size(state)))
    twist[0], twist[1], twist[2] = between(segment, b)
    return True


@inlined
def _value(objective: Objective, path: FloatArray, first: int, last: int) -> float:
    """Return the value of the arcs from the first to the last one."""
    total = 0.0
    for k in range(first, last + 1):
        total += arc_value(objective, path[k, 0], path[k, 1], path[k, 2], path[k, 3])
    return total


@no_refcount
def _poses_along(path: FloatArray, first: int, last: int, poses: FloatArray) -> None:
    """Fill `poses` with the pose after each arc from the first to the last one, from that before it."""
    for k in range(first, last + 1):
        x, y, theta = poses[k, 0], poses[k, 1], poses[k, 2]
        arc = path[k]
        poses[k + 1, 0], poses[k + 1, 1], poses[k + 1, 2] = step(x, y, theta, arc[0], arc[1], arc[2], arc[3])


@no_refcount
def _column(path: FloatArray, poses: FloatArray, k: int, last: int, column: FloatArray) -> None:
    """Fill `column` with how the last pose moves when arc k gets longer, per metre."""
    c, s = math.cos(poses[k + 1, 2]), math.sin(poses[k + 1, 2])
    vx, vy, omega = path[k, 0], path[k, 1], path[k, 2]
    # d(last pose)/d(length k): what follows moves as a rigid body with twist k, seen from the world.
    column[0] = c * vx - s * vy - omega * (poses[last + 1, 1] - poses[k + 1, 1])
    column[1] = s * vx + c * vy + omega * (poses[last + 1, 0] - poses[k + 1, 0])
    column[2] = omega


@inlined
def _close(
    path: FloatArray, poses: FloatArray, first: int, last: int, chosen: IntArray, target: FloatArray
) -> bool:
    """Change the lengths of three arcs so that the last one ends at the target; whether that succeeds.

    Newton's method; the three equations are solved by Cramer's rule.
    """
    columns = scratch(3, 3)
    a, b, c = columns[0], columns[1], columns[2]
    for _ in range(6):
        _poses_along(path, first, last, poses)
        x, y = target[0] - poses[last + 1, 0], target[1] - poses[last + 1, 1]
        t = (target[2] - poses[last + 1, 2] + math.pi) % (2.0 * math.pi) - math.pi
        # To rounding (m, rad): what is left here adds up from change to change.
        if abs(x) + abs(y) + abs(t) < 1e-13:
            return True
        _column(path, poses, chosen[0], last, a)
        _column(path, poses, chosen[1], last, b)
        _column(path, poses, chosen[2], last, c)
        bc0, bc1, bc2 = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
        whole = a[0] * bc0 + a[1] * bc1 + a[2] * bc2
        # The three motions are nearly dependent: lengths would change without bound.
        if abs(whole) < 1e-9:
            return False
        da = (x * bc0 + y * bc1 + t * bc2) / whole
        db = (
            a[0] * (y * c[2] - t * c[1]) + a[1] * (t * c[0] - x * c[2]) + a[2] * (x * c[1] - y * c[0])
        ) / whole
        dc = (
            a[0] * (b[1] * t - b[2] * y) + a[1] * (b[2] * x - b[0] * t) + a[2] * (b[0] * y - b[1] * x)
        ) / whole
        path[chosen[0], 3] += da
        path[chosen[1], 3] += db
        path[chosen[2], 3] += dc
        if path[chosen[0], 3] < 0.0 or path[chosen[1], 3] < 0.0 or path[chosen[2], 3] < 0.0:
            return False
    return False


@inlined
def _choose(state: RandomState, first: int, last: int, chosen: IntArray) -> None:
    """Draw three different arcs from the first to the last one."""
    count = last - first + 1
    a = int(random(state) * count)
    b = int(random(state) * (count - 1))
    c = int(random(state) * (count - 2))
    b += (b >= a) * 1
    low, high = min(a, b), max(a, b)
    c += (c >= low) * 1
    c += (c >= high) * 1
    chosen[0], chosen[1], chosen[2] = first + a, first + b, first + c


@inlined
def _free(problem: Problem, path: FloatArray, poses: FloatArray, first: int, last: int) -> bool:
    """Whether the arcs from the first to the last one touch nothing."""
    for k in range(first, last + 1):
        if path[k, 3] > 0.0:
            x, y, theta = poses[k, 0], poses[k, 1], poses[k, 2]
            if not sweep_is_free(problem.scene, x, y, theta, path[k, 0], path[k, 1], path[k, 2], path[k, 3]):
                return False
    return True


@compiled
def vary(
    problem: Problem, normals: FloatArray, start: FloatArray, path: FloatArray, state: RandomState
) -> FloatArray:
    """Return the path (k, 4) with one arc changed and three closing it, or as it is when that gains nothing.

    Args:
        problem: What to plan.
        normals: See `normals_of`.
        start: (3,) pose at the path's beginning.
        path: (m, 4) twists and lengths of a path to the goal.
        state: (1,) state of the random generator.
    """
    trial, poses = np.empty((path.shape[0] + 1, 4)), np.empty((path.shape[0] + 2, 3))
    m = _varied(problem, normals, start, path, state, trial, poses)
    return path if m == 0 else trial[:m].copy()


@no_refcount
def _varied(
    problem: Problem,
    normals: FloatArray,
    start: FloatArray,
    path: FloatArray,
    state: RandomState,
    trial: FloatArray,
    poses: FloatArray,
) -> int:
    """Fill `trial` (m + 1, 4) with a cheaper path than `path` (m, 4), and `poses` (m + 2, 3) with some of its poses.

    Returns:
        How many arcs it has; 0 when the change tried gains nothing.
    """
    m = path.shape[0]
    k = int(random(state) * m)
    # Splitting an arc first lets a path take a new form; leaving one out makes it what people want to drive.
    split = m < 3 or random(state) < 0.2
    if not split and m > 3 and random(state) < 0.15:
        return _without(problem, start, path, k, state, trial, poses)
    put_rows(trial, path[: k + 1])
    if split:
        put_rows(trial[k + 1 :], path[k:])
        share = random(state)
        trial[k, 3] *= share
        trial[k + 1, 3] *= 1.0 - share
        k += (random(state) < 0.5) * 1
        m += 1
    else:
        put_rows(trial[k + 1 :], path[k + 1 :])
    first = max(0, k - 1 - int(random(state) * 4.0))
    last = min(m - 1, k + 1 + int(random(state) * 4.0))
    if last - first < 2:
        return 0
    put(poses[0], start)
    _poses_along(trial, 0, last, poses)
    target = scratch(1, 3)[0]
    put(target, poses[last + 1] if last < m - 1 else problem.goal)
    before = _value(problem.objective, trial, first, last) - (problem.objective.per_arc if split else 0.0)
    if random(state) < 0.15:
        trial[k, 3] *= 1.0 + 0.5 * _size(state)
    elif not _change_twist(problem.segments, normals, state, trial[k]):
        return 0
    return int(m) if _closes(problem, trial, poses, first, last, target, before, state) else 0


@no_refcount
def _without(
    problem: Problem,
    start: FloatArray,
    path: FloatArray,
    k: int,
    state: RandomState,
    trial: FloatArray,
    poses: FloatArray,
) -> int:
    """Fill `trial` with a cheaper path without arc k; return how many arcs it has, 0 when that gains nothing."""
    m = path.shape[0] - 1
    first = max(0, k - 1 - int(random(state) * 4.0))
    last = min(m - 1, k + int(random(state) * 4.0))
    if last - first < 2:
        return 0
    put(poses[0], start)
    _poses_along(path, 0, last + 1, poses)
    target = scratch(1, 3)[0]
    put(target, poses[last + 2] if last < m - 1 else problem.goal)
    before = _value(problem.objective, path, first, last + 1)
    put_rows(trial, path[:k])
    put_rows(trial[k:], path[k + 1 :])
    _poses_along(trial, first, last, poses)
    return int(m) if _closes(problem, trial, poses, first, last, target, before, state) else 0


@no_refcount
def _closes(
    problem: Problem,
    trial: FloatArray,
    poses: FloatArray,
    first: int,
    last: int,
    target: FloatArray,
    before: float,
    state: RandomState,
) -> bool:
    """Change three lengths so that the arcs end at the target; whether they are cheaper than before, and free."""
    chosen = scratch_integers(3)
    _choose(state, first, last, chosen)
    if not _close(trial, poses, first, last, chosen, target):
        return False
    # A tenth of `GAIN`, not tuned: with `GAIN` itself one of three plans of five-objects came out 0.04 % longer.
    if _value(problem.objective, trial, first, last) > before - 1e-10:
        return False
    return _free(problem, trial, poses, first, last)
