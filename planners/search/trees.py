"""Trees grown from start and goal until they join, fresh ones beside one another."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import inlined, no_refcount
from pushplan.compiled.scratch import scratch, scratch_integers
from pushplan.planners.collision.separation import Scene, separation, step, sweep_is_free
from pushplan.planners.problem.problem import TRIES, Problem, apart, random, remaining
from pushplan.planners.problem.rows import put, put_rows
from pushplan.planners.problem.steering import MAX_WORDS, connect, find_words
from pushplan.util.arrays import FloatArray, IntArray, RandomState

NODE = 17
"""Columns of a node: x, y, theta, cost to the tree's root, parent, and up to three arcs (vx, vy, omega, length)
between the node and its parent, in the order of travel."""


class Forest(NamedTuple):
    """Both trees and what grows them.

    Attributes:
        start_tree: (capacity, NODE) tree from the start.
        goal_tree: (capacity, NODE) tree to the goal.
        counts: (2,) nodes in each.
        box: (4,) xmin, ymin, xmax, ymax that positions are drawn from.
        heading_length: Metres that a radian counts as in the choice of the nearest nodes.
        reach: Longest piece of a word that is added at a time, m of cost.
        state: (1,) of the random generator.
    """

    start_tree: FloatArray
    goal_tree: FloatArray
    counts: IntArray
    box: FloatArray
    heading_length: float
    reach: float
    state: RandomState


def plant(forest: Forest, start: FloatArray, goal: FloatArray) -> None:
    """Reduce both trees to their roots."""
    forest.start_tree[0, :] = 0.0
    forest.goal_tree[0, :] = 0.0
    forest.start_tree[0, :3] = start
    forest.goal_tree[0, :3] = goal
    forest.start_tree[0, 4] = -1.0
    forest.goal_tree[0, 4] = -1.0
    forest.counts[:] = 1


@inlined
def _draw(forest: Forest, start: FloatArray, goal: FloatArray, bound: float, pose: FloatArray) -> None:
    """Draw a pose: its position from the box, or from the ellipse that paths below the bound stay in, if smaller."""
    box, state = forest.box, forest.state
    pose[2] = 2.0 * math.pi * random(state)
    dx, dy = goal[0] - start[0], goal[1] - start[1]
    minor_squared = bound * bound - dx * dx - dy * dy
    if math.pi * bound * math.sqrt(max(minor_squared, 0.0)) < 4.0 * (box[2] - box[0]) * (box[3] - box[1]):
        r, angle = math.sqrt(random(state)), 2.0 * math.pi * random(state)
        along = 0.5 * bound * r * math.cos(angle)
        across = 0.5 * math.sqrt(max(minor_squared, 0.0)) * r * math.sin(angle)
        distance = max(math.hypot(dx, dy), 1e-12)
        ux, uy = dx / distance, dy / distance
        pose[0] = 0.5 * (start[0] + goal[0]) + ux * along - uy * across
        pose[1] = 0.5 * (start[1] + goal[1]) + uy * along + ux * across
    else:
        pose[0] = box[0] + (box[2] - box[0]) * random(state)
        pose[1] = box[1] + (box[3] - box[1]) * random(state)


@inlined
def draw_pose(problem: Problem, forest: Forest, start: FloatArray, bound: float, pose: FloatArray) -> bool:
    """Draw a free pose that a path cheaper than the bound could pass; give up after some tries."""
    goal = problem.goal
    for _ in range(20):
        _draw(forest, start, goal, bound, pose)
        x, y, theta = pose[0], pose[1], pose[2]
        through = remaining(x, y, theta, goal) + remaining(start[0], start[1], start[2], pose)
        clearance = problem.scene.clearance
        if through < bound and separation(problem.scene, x, y, theta, 2.0 * clearance) >= clearance:
            return True
    return False


NEAREST = 2
"""Nodes of a tree, nearest to a sample, from which words are tried."""


@no_refcount
def _nearest(tree: FloatArray, count: int, pose: FloatArray, heading_length: float, found: IntArray) -> int:
    """Fill `found` with the rows of the nodes nearest to a pose, nearest first; return how many."""
    distances = scratch(1, NEAREST)[0]
    distances[:] = np.inf
    n = 0
    for i in range(count):
        d = apart(tree[i], pose[0], pose[1], pose[2], heading_length)
        # Insertion into the few that are kept: most nodes fail this one test.
        if d < distances[-1]:
            k = min(n, NEAREST - 1)
            while k > 0 and distances[k - 1] > d:
                distances[k], found[k] = distances[k - 1], found[k - 1]
                k -= 1
            distances[k], found[k] = d, i
            n = min(n + 1, NEAREST)
    return n


@inlined
def _best_word(
    families: FloatArray, start: FloatArray, goal: FloatArray, words: FloatArray, word: FloatArray
) -> float:
    """Copy the cheapest word over all families, as (3, 4) arcs, into `word`; return its cost."""
    best = np.inf
    for f in range(families.shape[0]):
        n = find_words(families[f], start, goal, words)
        for i in range(n):
            if words[i, 0] < best:
                best = words[i, 0]
                for k in range(3):
                    put(word[k], families[f, int(words[i, 1 + k])])
                    word[k, 3] = words[i, 4 + k]
    return best


@inlined
def _clip(word: FloatArray, reach: float, from_end: bool) -> None:
    """Shorten a word to `reach`, keeping its beginning, or its end."""
    total = word[0, 3] + word[1, 3] + word[2, 3]
    excess = total - reach
    for i in range(3):
        # The goal tree grows backwards: the end of its words lies at the node, and has to stay.
        k = i if from_end else 2 - i
        cut = min(max(excess, 0.0), word[k, 3])
        word[k, 3] -= cut
        excess -= cut


@inlined
def _walk(scene: Scene, pose: FloatArray, word: FloatArray, sign: float) -> tuple[bool, float, float, float]:
    """Whether a word is free, and the pose after it (sign +1), or before it (-1)."""
    x, y, theta = pose[0], pose[1], pose[2]
    for i in range(3):
        k = i if sign > 0.0 else 2 - i
        length = word[k, 3]
        if length > 0.0:
            vx, vy, omega = sign * word[k, 0], sign * word[k, 1], sign * word[k, 2]
            if not sweep_is_free(scene, x, y, theta, vx, vy, omega, length):
                return False, x, y, theta
            x, y, theta = step(x, y, theta, vx, vy, omega, length)
    return True, x, y, theta


@inlined
def _add(
    tree: FloatArray,
    counts: IntArray,
    which: int,
    parent: int,
    x: float,
    y: float,
    theta: float,
    word: FloatArray,
) -> int:
    """Append a node; return its row."""
    row = int(counts[which])
    tree[row, 0], tree[row, 1], tree[row, 2] = x, y, theta
    tree[row, 3] = tree[parent, 3] + word[0, 3] + word[1, 3] + word[2, 3]
    tree[row, 4] = parent
    for i in range(3):
        put(tree[row, 5 + 4 * i :], word[i])
    counts[which] = row + 1
    return row


@inlined
def _extend(
    problem: Problem,
    forest: Forest,
    which: int,
    sample: FloatArray,
    bound: float,
    words: FloatArray,
    word: FloatArray,
) -> int:
    """Grow one tree towards a sample; return the new node's row, or -1."""
    tree = forest.start_tree if which == 0 else forest.goal_tree
    near = scratch_integers(NEAREST)
    n = _nearest(tree, forest.counts[which], sample, forest.heading_length, near)
    for i in range(n):
        parent = near[i]
        node = tree[parent, :3]
        first, last = (node, sample) if which == 0 else (sample, node)
        if _best_word(problem.families[:1], first, last, words, word) == np.inf:
            continue
        _clip(word, forest.reach, which == 1)
        free, x, y, theta = _walk(problem.scene, node, word, 1.0 if which == 0 else -1.0)
        if not free:
            continue
        # Cost so far plus a lower bound of what is left: no path through the node is cheaper than that.
        so_far = tree[parent, 3] + word[0, 3] + word[1, 3] + word[2, 3]
        root = forest.goal_tree[0] if which == 0 else forest.start_tree[0]
        if so_far + remaining(x, y, theta, root) < bound:
            return _add(tree, forest.counts, which, parent, x, y, theta, word)
    return -1


@inlined
def _join(
    problem: Problem, forest: Forest, which: int, row: int, bound: float, arcs: FloatArray
) -> tuple[float, int]:
    """Connect a node exactly to the root and the nearest nodes of the other tree.

    Returns:
        (cost of the whole path, row in the other tree), infinite when nothing below the bound is free.
    """
    tree, other = (
        (forest.start_tree, forest.goal_tree) if which == 0 else (forest.goal_tree, forest.start_tree)
    )
    near = scratch_integers(NEAREST)
    n = _nearest(other, forest.counts[1 - which], tree[row, :3], forest.heading_length, near)
    best, partner = np.inf, -1
    word = scratch(3, 4)
    # -1 stands for the other tree's root: of the nodes near by, none may lead there directly.
    for i in range(-1, n):
        j = 0 if i < 0 else near[i]
        so_far = tree[row, 3] + other[j, 3]
        first, last = (tree[row], other[j]) if which == 0 else (other[j], tree[row])
        limit = min(bound, best) - so_far
        if limit > 0.0:
            cost, _ = connect(problem.scene, problem.families[:1], first[:3], last[:3], limit, TRIES, word)
            if so_far + cost < best:
                best, partner = so_far + cost, j
                put_rows(arcs, word)
    return best, partner


@inlined
def _whole(forest: Forest, start_node: int, goal_node: int, word: FloatArray, path: FloatArray) -> int:
    """Write the arcs start tree, connection, goal tree into `path`; return how many."""
    depth = 0
    i = start_node
    while forest.start_tree[i, 4] >= 0.0:
        depth += 1
        i = int(forest.start_tree[i, 4])
    n = 3 * depth
    i = start_node
    for k in range(depth - 1, -1, -1):
        for a in range(3):
            put(path[3 * k + a], forest.start_tree[i, 5 + 4 * a : 9 + 4 * a])
        i = int(forest.start_tree[i, 4])
    for a in range(3):
        put(path[n], word[a])
        n += 1
    i = goal_node
    while forest.goal_tree[i, 4] >= 0.0:
        for a in range(3):
            put(path[n], forest.goal_tree[i, 5 + 4 * a : 9 + 4 * a])
            n += 1
        i = int(forest.goal_tree[i, 4])
    return n


@no_refcount
def grow_both(
    problem: Problem, forest: Forest, bound: float, iterations: int, path: FloatArray
) -> tuple[int, int]:
    """Grow the trees in turn until a path below the bound is found.

    Args:
        problem: What to plan.
        forest: The trees; both have room for `iterations` more nodes.
        bound: Cost that a path must stay below.
        iterations: Extensions to try, at most.
        path: (capacity, 4) filled with the path's twists and lengths.

    Returns:
        (done, arcs): extensions tried; arcs of the path found, 0 if none.
    """
    sample, words = scratch(1, 3)[0], scratch(MAX_WORDS, 7)
    word, arcs = scratch(3, 4), scratch(3, 4)
    for done in range(1, iterations + 1):
        # The smaller tree grows; times 1 makes an index of a bool.
        which = (forest.counts[0] > forest.counts[1]) * 1
        if random(forest.state) < 0.05:
            put(sample, forest.goal_tree[0, :3] if which == 0 else forest.start_tree[0, :3])
        elif not draw_pose(problem, forest, forest.start_tree[0], bound, sample):
            continue
        row = _extend(problem, forest, which, sample, bound, words, word)
        if row < 0:
            continue
        cost, partner = _join(problem, forest, which, row, bound, arcs)
        if cost < bound:
            start_node, goal_node = (row, partner) if which == 0 else (partner, row)
            return done, _whole(forest, start_node, goal_node, arcs, path)
    return iterations, 0
