"""Compiled flooding of the cells of the poses, from the start and to the goal (Barraquand and Latombe 1993).

Each tree keeps one node in a cell of positions and headings, so it spreads over all that its arcs reach, detours and
loops included, where trees drawn to random poses stay among poses that they cannot join. Unlike theirs, lengths and a
part of the twists are drawn at random, and nodes are joined across the two trees by exact words. A tree that finds no
more cells, as it is shut in but for narrow ways out, goes on with smaller ones.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.arrays import FloatArray, IntArray, RandomState
from pushplan.compiled import inlined, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.planners.collision.separation import step, sweep_is_free
from pushplan.planners.problem.problem import TRIES, Problem, choose_twist, enter, random, trace
from pushplan.planners.problem.rows import put
from pushplan.planners.problem.steering import connect
from pushplan.planners.search.cell_table import pose_key, slot_of

NODES, NEXT, PASSES, FINER, TRIED = 0, 1, 2, 3, 4
"""What is counted of a tree: nodes, the next one to expand, passes over all nodes with cells of the present size, how
often these were made smaller, arcs tried."""

SIDE, ANGLE, ARC = 0, 1, 2
"""Sizes of a tree: side (m) and angle (rad) of a cell, typical length of an arc (m of cost)."""

MOST_PASSES = 4
"""Each node is expanded so many times before the cells of its tree are made smaller."""

SHRINK = 0.7
"""Factor of the cells' sides and of the typical arc then; the angles shrink by its root."""

MOST_FINER = 20
"""They are made smaller so many times at most, to a thousandth."""

CHILDREN = 4
"""Arcs from a node at a time: the left turn, the straight push, the right turn, and one of a random stable twist."""

ROOT_SHARE = 0.2
"""Share of the nodes that are tried to be joined with the other tree's root."""

MATES = 4
"""Random nodes of the other tree, of which the nearest one is tried to be joined with any other node."""

FAR_SHARE = 0.5
"""Share of the arcs with any length up to the longest; the others have about the tree's own."""


class CellTrees(NamedTuple):
    """Both trees: the first from the start, the second to the goal.

    Attributes:
        nodes: (2, capacity, NODE) see `search.NODE`; arcs of the second lead from the node to its parent.
        keys: (2, slots) table of the cells that hold a node, 0 where a slot is free; slots are a power of two.
        counts: (2, 5) see `NODES`, `NEXT`, `PASSES`, `FINER` and `TRIED`.
        box: (4,) xmin, ymin, xmax, ymax that the cells cover, m.
        sizes: (2, 3) see `SIDE`, `ANGLE` and `ARC`.
        state: (1,) of the random generator.
    """

    nodes: FloatArray
    keys: IntArray
    counts: IntArray
    box: FloatArray
    sizes: FloatArray
    state: RandomState


@inlined
def _free_slot(trees: CellTrees, which: int, x: float, y: float, theta: float) -> tuple[int, int]:
    """Slot of the table for the cell around a pose, -1 if it is taken or outside the box; and the cell's key."""
    size, keys = trees.sizes[which], trees.keys[which]
    key = pose_key(trees.box, size[SIDE], size[ANGLE], x, y, theta)
    slot = slot_of(keys, key)
    return (-1 if keys[slot] == key else slot), key


@inlined
def _grown(
    problem: Problem,
    trees: CellTrees,
    which: int,
    parent: int,
    vx: float,
    vy: float,
    omega: float,
    length: float,
) -> int:
    """Add the node at the other end of an arc if its cell and the arc are free; return its row, or -1."""
    x, y, theta, cost = (
        trees.nodes[which, parent, 0],
        trees.nodes[which, parent, 1],
        trees.nodes[which, parent, 2],
        trees.nodes[which, parent, 3],
    )
    sign = 1.0 - 2.0 * which
    nx, ny, nt = step(x, y, theta, sign * vx, sign * vy, sign * omega, length)
    slot, key = _free_slot(trees, which, nx, ny, nt)
    if slot < 0 or not sweep_is_free(problem.scene, x, y, theta, sign * vx, sign * vy, sign * omega, length):
        return -1
    row = int(trees.counts[which, NODES])
    trees.counts[which, NODES] = row + 1
    trees.keys[which, slot] = key
    enter(trees.nodes[which, row], (nx, ny, nt), cost + length, parent, (vx, vy, omega, length))
    return row


@inlined
def _child(problem: Problem, trees: CellTrees, which: int, parent: int, number: int) -> int:
    """Try one of a node's arcs; return the row of its end, or -1."""
    vx = vy = omega = 0.0
    if number < 3:
        turn = problem.families[0, number]
        vx, vy, omega = turn[0], turn[1], turn[2]
    if vx == 0.0 and vy == 0.0 and omega == 0.0:
        vx, vy, omega = choose_twist(problem, random(trees.state), random(trees.state))
    if random(trees.state) < FAR_SHARE:
        length = problem.longest * random(trees.state)
    else:
        length = trees.sizes[which, ARC] * (0.6 + 0.8 * random(trees.state))
    trees.counts[which, TRIED] += 1
    return _grown(problem, trees, which, parent, vx, vy, omega, length)


@inlined
def _mate(trees: CellTrees, which: int, row: int) -> int:
    """Row of the node of the other tree to be joined with a node: the root, or the nearest of a few random ones."""
    other = 1 - which
    mate, least = 0, np.inf
    if random(trees.state) < ROOT_SHARE:
        return mate
    for _ in range(MATES):
        drawn = int(random(trees.state) * trees.counts[other, NODES])
        dx = trees.nodes[other, drawn, 0] - trees.nodes[which, row, 0]
        dy = trees.nodes[other, drawn, 1] - trees.nodes[which, row, 1]
        if dx**2 + dy**2 < least:
            mate, least = drawn, dx**2 + dy**2
    return mate


@inlined
def _join(problem: Problem, trees: CellTrees, which: int, row: int, word: FloatArray) -> int:
    """Connect a node exactly to one of the other tree; return that one's row, or -1."""
    partner = _mate(trees, which, row)
    first, last = (row, partner) if which == 0 else (partner, row)
    ahead, behind = trees.nodes[0, first, :3], trees.nodes[1, last, :3]
    cost, _ = connect(problem.scene, problem.families[:1], ahead, behind, np.inf, TRIES, word)
    return partner if cost < np.inf else -1


@inlined
def _whole(trees: CellTrees, ahead: int, behind: int, word: FloatArray, path: FloatArray) -> int:
    """Write the arcs first tree, connection, second tree into `path`; return how many."""
    n = trace(trees.nodes[0], ahead, word, path)
    while trees.nodes[1, behind, 4] >= 0.0:
        put(path[n], trees.nodes[1, behind, 5:])
        n += 1
        behind = int(trees.nodes[1, behind, 4])
    return n


@inlined
def _is_over(trees: CellTrees, which: int) -> bool:
    """Whether a tree has no room left, or has expanded every node as often as is allowed with the smallest cells."""
    count = trees.counts[which]
    return bool(
        count[NODES] + CHILDREN > trees.nodes.shape[1]
        or (count[NEXT] == count[NODES] and count[PASSES] == MOST_PASSES and count[FINER] == MOST_FINER)
    )


@inlined
def _make_finer(trees: CellTrees, which: int) -> None:
    """Give a tree smaller cells and shorter arcs."""
    size = trees.sizes[which]
    size[SIDE], size[ARC], size[ANGLE] = (
        SHRINK * size[SIDE],
        SHRINK * size[ARC],
        math.sqrt(SHRINK) * size[ANGLE],
    )
    trees.counts[which, FINER] += 1
    trees.counts[which, PASSES] = 0
    for slot in range(trees.keys.shape[1]):
        trees.keys[which, slot] = 0
    for row in range(1, trees.counts[which, NODES]):
        node = trees.nodes[which, row]
        slot, key = _free_slot(trees, which, node[0], node[1], node[2])
        if slot >= 0:
            trees.keys[which, slot] = key


@inlined
def _next_parent(trees: CellTrees, which: int) -> int:
    """Row of the node to expand next: each in the order they were found, then all again, in smaller cells at last."""
    count = trees.counts[which]
    if count[NEXT] == count[NODES]:
        if count[PASSES] == MOST_PASSES:
            _make_finer(trees, which)
        count[NEXT] = 0
        count[PASSES] += 1
    parent = int(count[NEXT])
    count[NEXT] += 1
    return parent


@no_refcount
def flood(problem: Problem, trees: CellTrees, arcs: int, path: FloatArray) -> int:
    """Expand nodes of both trees in turn, each tree's in the order they were found, until these join.

    Args:
        problem: What to plan.
        trees: The trees.
        arcs: Arcs to try; may be exceeded by `CHILDREN` less one.
        path: (as many as there is room for nodes, + 3, 4) filled with the path's twists and lengths.

    Returns:
        Arcs of the path found, 0 if none; -1 when there is nothing left to expand.
    """
    word = scratch(3, 4)
    count = trees.counts
    enough = count[0, TRIED] + count[1, TRIED] + arcs
    while count[0, TRIED] + count[1, TRIED] < enough:
        which = (count[1, TRIED] < count[0, TRIED]) * 1
        if _is_over(trees, which):
            which = 1 - which
            if _is_over(trees, which):
                return -1
        parent = _next_parent(trees, which)
        for number in range(CHILDREN):
            row = _child(problem, trees, which, parent, number)
            partner = _join(problem, trees, which, row, word) if row >= 0 else -1
            if partner >= 0:
                ahead, behind = (row, partner) if which == 0 else (partner, row)
                return _whole(trees, ahead, behind, word, path)
    return 0
