"""Best-first search over a lattice of poses, in compiled code."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import inlined, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.planners.collision.separation import step, sweep_is_free
from pushplan.planners.problem.problem import TRIES, Problem, choose_twist, enter, random, remaining, trace
from pushplan.planners.problem.rows import put, put_rows
from pushplan.planners.problem.steering import MAX_WORDS, connect, find_words
from pushplan.util.arrays import FloatArray, IntArray, RandomState


@inlined
def cell_key(i: int, j: int, k: int) -> int:
    """Key above 0 of a cell: columns i and rows j from 0 to 2^20, headings k likewise."""
    return (((i << 20) + j) << 20) + k + 1


@inlined
def pose_key(box: FloatArray, side: float, angle: float, x: float, y: float, theta: float) -> int:
    """Key of the cell, `side` (m) wide and `angle` (rad) high, that a pose is in; 0 outside the box (4,)."""
    if x < box[0] or y < box[1] or x > box[2] or y > box[3]:
        return 0
    return cell_key(
        int((x - box[0]) / side), int((y - box[1]) / side), int((theta % (2.0 * math.pi)) / angle)
    )


@inlined
def slot_of(table: IntArray, key: int) -> int:
    """Slot of a table (a power of two up to 2^23,) that holds a key, or is free for it; 0 marks free slots."""
    last = table.shape[0] - 1
    slot = ((key * 0x9E3779B97F4A7C1) >> 40) & last  # columns do not change the bits below
    while table[slot] != 0 and table[slot] != key:
        slot = (slot + 1) & last
    return int(slot)


NODES, OPEN, TRIED, PARTNER = 0, 1, 2, 3
"""What is counted: nodes, entries of the queue, arcs tried; and the node that the best word begins at."""

SIDE, ANGLE, ARC, SENSE = 0, 1, 2, 3
"""Sizes: side (m) and angle (rad) of a cell, typical length of an arc (m of cost); and 1 for a search from the start
to the goal, -1 for one back from the goal."""

CHILDREN = 4
"""Arcs from a node: the left turn, the straight push, the right turn, and one of a random stable twist."""


class Lattice(NamedTuple):
    """A search.

    Attributes:
        nodes: (capacity, NODE) see `problem.NODE`.
        keys: (slots,) cells that hold a node, 0 where a slot is free; slots are a power of two.
        costs: (slots,) g of the cheapest node in each.
        queue: (capacity, 2) a binary heap of f and row.
        counts: (4,) see `NODES`, `OPEN`, `TRIED` and `PARTNER`.
        box: (4,) xmin, ymin, xmax, ymax that the cells cover, m.
        sizes: (4,) see `SIDE`, `ANGLE`, `ARC` and `SENSE`.
        target: (3,) the pose that is looked for.
        away: (nx, ny) distance of a place from there around the obstacles, m.
        grid: (3,) lower left corner of that table and the side of its cells, m.
        middle: (3,) the body's point for which it counts, chain frame, and the direction of its straight push.
        state: (1,) of the random generator.
    """

    nodes: FloatArray
    keys: IntArray
    costs: FloatArray
    queue: FloatArray
    counts: IntArray
    box: FloatArray
    sizes: FloatArray
    target: FloatArray
    away: FloatArray
    grid: FloatArray
    middle: FloatArray
    state: RandomState


@inlined
def _cell(lattice: Lattice, x: float, y: float, theta: float) -> tuple[int, int]:
    """Key of a pose's cell, 0 outside the box, and the slot that holds it or is free for it."""
    key = pose_key(lattice.box, lattice.sizes[SIDE], lattice.sizes[ANGLE], x, y, theta)
    return key, slot_of(lattice.keys, key)


@no_refcount
def _left(problem: Problem, lattice: Lattice, x: float, y: float, theta: float) -> float:
    """What is left to the target at least, m: by the floor's distances, and by the cheapest word."""
    c, s = math.cos(theta), math.sin(theta)
    px = x + c * lattice.middle[0] - s * lattice.middle[1]
    py = y + s * lattice.middle[0] + c * lattice.middle[1]
    nx, ny = lattice.away.shape
    i = min(nx - 1, max(0, int((px - lattice.grid[0]) / lattice.grid[2])))
    j = min(ny - 1, max(0, int((py - lattice.grid[1]) / lattice.grid[2])))
    # The floor's distances know nothing of turns, words nothing of obstacles: the larger one tells more. Neither is a
    # lower bound (words of one family, ways from cell to cell), so what is found is good, not proven to be best.
    words, pose = scratch(MAX_WORDS, 7), scratch(1, 3)[0]
    pose[0], pose[1], pose[2] = x, y, theta
    ahead = lattice.sizes[SENSE] > 0.0
    first, last = (pose, lattice.target) if ahead else (lattice.target, pose)
    n = find_words(problem.families[0], first, last, words)
    word = np.inf
    for k in range(n):
        word = min(word, words[k, 0])
    if n == 0:
        word = remaining(x, y, theta, lattice.target)
    return float(max(word, lattice.away[i, j]))


@no_refcount
def _push(lattice: Lattice, f: float, row: int) -> None:
    queue = lattice.queue
    i = int(lattice.counts[OPEN])
    lattice.counts[OPEN] = i + 1
    while i > 0:
        up = (i - 1) // 2
        if queue[up, 0] <= f:
            break
        queue[i, 0], queue[i, 1] = queue[up, 0], queue[up, 1]
        i = up
    queue[i, 0], queue[i, 1] = f, row


@no_refcount
def _pop(lattice: Lattice) -> tuple[float, int]:
    queue = lattice.queue
    f, row = queue[0, 0], int(queue[0, 1])
    n = int(lattice.counts[OPEN]) - 1
    lattice.counts[OPEN] = n
    last, last_row = queue[n, 0], queue[n, 1]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= n:
            break
        if child + 1 < n and queue[child + 1, 0] < queue[child, 0]:
            child += 1
        if queue[child, 0] >= last:
            break
        queue[i, 0], queue[i, 1] = queue[child, 0], queue[child, 1]
        i = child
    queue[i, 0], queue[i, 1] = last, last_row
    return f, row


@inlined
def _grow(problem: Problem, lattice: Lattice, parent: int, number: int, bound: float) -> None:
    """Try one of a node's arcs."""
    vx = vy = omega = 0.0
    if number < 3:
        turn = problem.families[0, number]
        vx, vy, omega = turn[0], turn[1], turn[2]
    # The fourth arc, and a letter that the family lacks.
    if vx == 0.0 and vy == 0.0 and omega == 0.0:
        vx, vy, omega = choose_twist(problem, random(lattice.state), random(lattice.state))
    length = lattice.sizes[ARC] * (0.6 + 0.8 * random(lattice.state))
    lattice.counts[TRIED] += 1
    node = lattice.nodes[parent]
    x, y, theta, cost = node[0], node[1], node[2], node[3] + length
    sense = lattice.sizes[SENSE]
    nx, ny, nt = step(x, y, theta, sense * vx, sense * vy, sense * omega, length)
    # Cheap tests first; the sweep against the obstacles takes most of the time.
    key, slot = _cell(lattice, nx, ny, nt)
    if key == 0 or (lattice.keys[slot] == key and lattice.costs[slot] <= cost):
        return
    f = cost + _left(problem, lattice, nx, ny, nt)
    if f >= bound or not sweep_is_free(
        problem.scene, x, y, theta, sense * vx, sense * vy, sense * omega, length
    ):
        return
    lattice.keys[slot], lattice.costs[slot] = key, cost
    row = int(lattice.counts[NODES])
    lattice.counts[NODES] = row + 1
    enter(lattice.nodes[row], (nx, ny, nt), cost, parent, (vx, vy, omega, length))
    _push(lattice, f, row)


def plant(lattice: Lattice, start: FloatArray) -> None:
    """Begin with the start (3,) alone; the keys are zero already."""
    lattice.nodes[0, :3], lattice.nodes[0, 3], lattice.nodes[0, 4] = start, 0.0, -1.0
    lattice.queue[0] = 0.0
    lattice.counts[:] = 1, 1, 0, -1


@no_refcount
def expand_best(
    problem: Problem, lattice: Lattice, bound: float, arcs: int, word: FloatArray
) -> tuple[float, bool]:
    """Expand nodes, the most promising first, until arcs are tried or nothing promises less than the bound.

    Args:
        problem: What to plan.
        lattice: The search.
        bound: Cost that a path must stay below, m; falls to that of each path that is found.
        arcs: Arcs to try; may be exceeded by `CHILDREN` less one.
        word: (3, 4) filled with the last arcs of the best path; it leaves the node `PARTNER`.

    Returns:
        The bound then, and whether the search is over.
    """
    arcs_found = scratch(3, 4)
    enough = lattice.counts[TRIED] + arcs
    while lattice.counts[TRIED] < enough:
        # Nothing left to expand, or no room: both end the round, and the next one has other cells.
        if lattice.counts[OPEN] == 0 or lattice.counts[NODES] + CHILDREN > lattice.nodes.shape[0]:
            return bound, True
        f, row = _pop(lattice)
        # f is the least in the queue: what else is there promises no more.
        if f >= bound:
            return bound, True
        node = lattice.nodes[row]
        key, slot = _cell(lattice, node[0], node[1], node[2])
        if (
            lattice.keys[slot] == key and lattice.costs[slot] < node[3]
        ):  # a cheaper one came to its cell since
            continue
        ahead = lattice.sizes[SENSE] > 0.0
        first, last = (node[:3], lattice.target) if ahead else (lattice.target, node[:3])
        found, _ = connect(
            problem.scene, problem.families[:1], first, last, bound - node[3], TRIES, arcs_found
        )
        if node[3] + found < bound:
            bound = node[3] + found
            lattice.counts[PARTNER] = row
            put_rows(word, arcs_found)
        for number in range(CHILDREN):
            _grow(problem, lattice, row, number, bound)
    return bound, False


@no_refcount
def path_of(lattice: Lattice, word: FloatArray, path: FloatArray) -> int:
    """Write the arcs of the best path into `path`; return how many."""
    row = int(lattice.counts[PARTNER])
    if lattice.sizes[SENSE] > 0.0:
        return trace(lattice.nodes, row, word, path)
    put_rows(path, word)
    n = 3
    while lattice.nodes[row, 4] >= 0.0:
        put(path[n], lattice.nodes[row, 5:9])
        n += 1
        row = int(lattice.nodes[row, 4])
    return n
