"""The robot's way alone between two poses: a direct word, or trees from both ends (Kuffner and LaValle 2000)."""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import any_integer, inlined, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.planners.collision.separation import separation, step
from pushplan.planners.multi.driving import LETTERS, Surroundings, Wheels, arc_is_free, drive, seen_from
from pushplan.planners.problem.problem import apart, random
from pushplan.planners.problem.rows import put, put_rows
from pushplan.util.arrays import FloatArray, RandomState

NODE = 4 + 1 + 4 * LETTERS
"""Columns of a node: pose, parent, number of arcs between it and its parent, and these arcs."""

NEAREST = 3
"""Nodes that a new pose is joined to, at most."""

FIRST_FREE = any_integer(1)
"""Row of a tree with one node at which the next is written."""

WORD_TRIES = any_integer(3)
"""Words that are swept between two poses."""

SHORTCUT_TRIES = any_integer(2)
"""Words that are swept for a shortcut."""

TURN_LENGTH = 0.3
"""What a turn by 1 rad counts when near nodes are looked for, m."""

MOST_ARCS = 256
"""Arcs of a way, at most."""


@no_refcount
def _is_clear(around: Surroundings, pose: FloatArray) -> bool:
    room, load = around.room, around.load
    if separation(room, pose[0], pose[1], pose[2], room.clearance * 2.0) < room.clearance:
        return False
    a, b, c = seen_from(around.place, pose[0], pose[1], pose[2])
    return bool(separation(load, a, b, c, load.clearance * 2.0) >= load.clearance)


@inlined
def _draw(state: RandomState, box: FloatArray, ends: FloatArray, spread: float, pose: FloatArray) -> None:
    """Draw a pose from the box, or, as often, around one of the ends."""
    # Ways between pushes lead round the load, or are short: most of the room is of no use to them.
    if random(state) < 0.5:
        end = ends[int(random(state) * len(ends))]
        reach, way = spread * random(state), 2.0 * math.pi * random(state)
        pose[0], pose[1] = end[0] + reach * math.cos(way), end[1] + reach * math.sin(way)
    else:
        pose[0] = box[0] + (box[2] - box[0]) * random(state)
        pose[1] = box[1] + (box[3] - box[1]) * random(state)
    pose[2] = 2.0 * math.pi * random(state) - math.pi


@inlined
def _nearest(nodes: FloatArray, count: int, pose: FloatArray, found: FloatArray) -> int:
    """Fill `found` (NEAREST, 2) with rows of the nodes nearest to a pose, and how far they are; return how many."""
    for k in range(NEAREST):
        found[k, 1] = np.inf
    for i in range(count):
        d = apart(nodes[i], pose[0], pose[1], pose[2], TURN_LENGTH)
        k = NEAREST
        while k > 0 and d < found[k - 1, 1]:
            if k < NEAREST:
                found[k, 0], found[k, 1] = found[k - 1, 0], found[k - 1, 1]
            k -= 1
        if k < NEAREST:
            found[k, 0], found[k, 1] = i, d
    return min(count, NEAREST)


@no_refcount
def _join(
    around: Surroundings,
    wheels: Wheels,
    nodes: FloatArray,
    count: int,
    pose: FloatArray,
    from_tree: bool,
) -> int:
    """Join a pose to a tree by a free word, written to row `count`; return the node that it starts or ends at, or -1.

    Args:
        around: What not to touch.
        wheels: How the robot moves.
        nodes: (capacity, NODE) the tree.
        count: Nodes so far.
        pose: (3,) of the robot.
        from_tree: Whether the word leads from the tree to the pose, or back.
    """
    found, arcs = scratch(3, 2), scratch(5, 4)  # NEAREST, LETTERS
    n = _nearest(nodes, count, pose, found)
    for k in range(n):
        i = int(found[k, 0])
        if from_tree:
            cost, letters = drive(around, wheels, nodes[i], pose, np.inf, WORD_TRIES, arcs)
        else:
            cost, letters = drive(around, wheels, pose, nodes[i], np.inf, WORD_TRIES, arcs)
        if cost < np.inf:
            put(nodes[count], pose)
            nodes[count, 3], nodes[count, 4] = i, letters
            for a in range(letters):
                put(nodes[count, 5 + 4 * a :], arcs[a])
            return i
    return -1


@inlined
def _trace(forth: FloatArray, i: int, back: FloatArray, j: int, arcs: FloatArray) -> int:
    """Write the arcs from the root of one tree to its node i, which is node j of the other, to that one's root."""
    n, at = 0, i
    while at >= 0:
        n += int(forth[at, 4])
        at = int(forth[at, 3])
    end = n
    at = i
    while at >= 0:
        end -= int(forth[at, 4])
        for a in range(int(forth[at, 4])):
            if end + a < MOST_ARCS:
                put(arcs[end + a], forth[at, 5 + 4 * a : 9 + 4 * a])
        at = int(forth[at, 3])
    at = j
    while at >= 0:
        for a in range(int(back[at, 4])):
            if n < MOST_ARCS:
                put(arcs[n], back[at, 5 + 4 * a : 9 + 4 * a])
            n += 1
        at = int(back[at, 3])
    return n


@no_refcount
def grow_trees(
    around: Surroundings,
    wheels: Wheels,
    forth: FloatArray,
    back: FloatArray,
    ends: FloatArray,
    box: FloatArray,
    spread: float,
    state: RandomState,
    arcs: FloatArray,
) -> int:
    """Grow trees of words from both ends until a pose is in both.

    Args:
        around: What not to touch.
        wheels: How the robot moves.
        forth: (iterations + 2, NODE) room for the tree from the start, which is its first node.
        back: The same for the tree to the goal.
        ends: (3, 3) start, goal, and the load, around which poses are drawn.
        box: (4,) of poses that are drawn.
        spread: How far from the ends others are drawn, m.
        state: Of the random numbers.
        arcs: (MOST_ARCS, 4) filled with the way.

    Returns:
        The number of arcs, -1 where no way was found.
    """
    pose, n, m = scratch(1, 3)[0], FIRST_FREE, FIRST_FREE
    for _ in range(forth.shape[0] - 2):
        _draw(state, box, ends, spread, pose)
        if not _is_clear(around, pose):
            continue
        reached = _join(around, wheels, forth, n, pose, True) >= 0
        reaches = _join(around, wheels, back, m, pose, False) >= 0
        if reached and reaches:
            count = _trace(forth, n, back, m, arcs)
            return count if count <= MOST_ARCS else -1
        n += int(reached)
        m += int(reaches)
    return -1


def find_transit(
    around: Surroundings,
    wheels: Wheels,
    start: FloatArray,
    goal: FloatArray,
    box: FloatArray,
    spread: float,
    state: RandomState,
    iterations: int,
    arcs: FloatArray,
) -> int:
    """Find a free way between two poses of the robot.

    Args:
        around: What not to touch.
        wheels: How the robot moves.
        start: (3,) pose.
        goal: (3,) pose.
        box: (4,) of poses that are drawn.
        spread: How far from the ends others are drawn, m.
        state: Of the random numbers.
        iterations: Poses that are drawn, at most.
        arcs: (MOST_ARCS, 4) filled with the way.

    Returns:
        The number of arcs, or -1 if no way was found; 0 where both poses are the same.
    """
    cost, letters = drive(around, wheels, start, goal, np.inf, 2 * WORD_TRIES, arcs)
    if cost < np.inf:
        return int(letters)
    if not _is_clear(around, start) or not _is_clear(around, goal):
        return -1
    forth, back = np.zeros((iterations + 2, NODE)), np.zeros((iterations + 2, NODE))
    forth[0, :3], back[0, :3] = start, goal
    forth[0, 3] = back[0, 3] = -1.0
    ends = np.stack([start, goal, around.place])
    n = int(grow_trees(around, wheels, forth, back, ends, box, spread, state, arcs))
    # Words through random poses have detours, which joining places anew takes away.
    return n if n < 0 else int(shortened(around, wheels, start, arcs, n, state, 40))


@no_refcount
def shortened(
    around: Surroundings,
    wheels: Wheels,
    start: FloatArray,
    arcs: FloatArray,
    count: int,
    state: RandomState,
    attempts: int,
) -> int:
    """Join random pairs of places on a way anew where that is cheaper; return the number of arcs that are left."""
    poses, word, kept = scratch(257, 3), scratch(5, 4), scratch(256, 4)  # MOST_ARCS + 1, LETTERS, MOST_ARCS
    first, last = scratch(1, 3)[0], scratch(1, 3)[0]
    for _ in range(attempts):
        put(poses[0], start)
        for k in range(count):
            p = poses[k]
            poses[k + 1, 0], poses[k + 1, 1], poses[k + 1, 2] = step(
                p[0], p[1], p[2], arcs[k, 0], arcs[k, 1], arcs[k, 2], arcs[k, 3]
            )
        # From a place within arc i to one within arc j.
        i, j = int(random(state) * count), int(random(state) * count)
        if i == j:
            continue
        i, j = min(i, j), max(i, j)
        a, b = random(state) * arcs[i, 3], random(state) * arcs[j, 3]
        p, q = poses[i], poses[j]
        first[0], first[1], first[2] = step(p[0], p[1], p[2], arcs[i, 0], arcs[i, 1], arcs[i, 2], a)
        last[0], last[1], last[2] = step(q[0], q[1], q[2], arcs[j, 0], arcs[j, 1], arcs[j, 2], b)
        old = arcs[i, 3] - a + b
        for k in range(i + 1, j):
            old += arcs[k, 3]
        cost, letters = drive(around, wheels, first, last, old - 1e-6, SHORTCUT_TRIES, word)
        if cost == np.inf or count - (j - i) + 1 + letters > MOST_ARCS:
            continue
        # What comes after is kept while the word moves in.
        rest = count - j
        for k in range(rest):
            put(kept[k], arcs[j + k])
        kept[0, 3] -= b
        arcs[i, 3] = a
        put_rows(arcs[i + 1 :], word[:letters])
        put_rows(arcs[i + 1 + letters :], kept[:rest])
        count = i + 1 + letters + rest
    return count


@no_refcount
def transit_is_free(around: Surroundings, start: FloatArray, arcs: FloatArray) -> bool:
    """Return whether a way that was found elsewhere is free here, both ends included."""
    x, y, theta = start[0], start[1], start[2]
    if not _is_clear(around, start):
        return False
    for k in range(arcs.shape[0]):
        if not arc_is_free(around, x, y, theta, arcs[k]):
            return False
        x, y, theta = step(x, y, theta, arcs[k, 0], arcs[k, 1], arcs[k, 2], arcs[k, 3])
    return True
