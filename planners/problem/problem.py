"""The compiled search: a tree of stable arcs with an exact connection to the goal from every node."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import any_integer, inlined, no_refcount
from pushplan.planners.collision.separation import Scene, step, sweep_is_free
from pushplan.planners.problem.objective import Objective
from pushplan.planners.problem.rows import put
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray, RandomState

NODE = 9
"""Columns of a node: x, y, theta, cost from the start, parent, arc that led here (vx, vy, omega, length)."""

LETTER_SHARE = 0.3
"""Share of the sampled controls that are the twists of a steering family : turns and straight pushes."""

END_SHARE = 0.25
"""Share of the other controls that lie on either end of their segment, the boundary of the stable set."""


TRIES = any_integer(2)
"""Words that are swept, at most, in the attempt to connect a new node."""


class Problem(NamedTuple):
    """What the compiled search needs to know.

    Attributes:
        scene: The body and what it must not touch.
        segments: (k, 6) stable twists between two end twists: every positive combination of them is stable.
        families: (f, 3, 3) left, straight and right twists for exact connections.
        goal: (3,) pose of the chain frame in the world.
        longest: Longest arc sampled, m of cost.
        objective: What makes one path better than another.
    """

    scene: Scene
    segments: FloatArray
    families: FloatArray
    goal: FloatArray
    longest: float
    objective: Objective


@inlined
def between(segment: FloatArray, b: float) -> tuple[float, float, float]:
    """Combine a segment's ends (6,) as (1 - b, b): a twist scaled to a cost rate of 1."""
    vx = (1.0 - b) * segment[0] + b * segment[3]
    vy = (1.0 - b) * segment[1] + b * segment[4]
    omega = (1.0 - b) * segment[2] + b * segment[5]
    rate = math.hypot(vx, vy) + TURN_WEIGHT * abs(omega)
    return vx / rate, vy / rate, omega / rate


@inlined
def choose_twist(problem: Problem, u0: float, u1: float) -> tuple[float, float, float]:
    """Map two numbers in [0, 1] onto the stable set: a twist scaled to a cost rate of 1."""
    families, segments = problem.families, problem.segments
    if u0 < LETTER_SHARE:
        i = min(int(u0 / LETTER_SHARE * 3 * families.shape[0]), 3 * families.shape[0] - 1)
        twist = families[i // 3, i % 3]
        # Zeros stand for a twist that the family does not have.
        if twist[0] != 0.0 or twist[1] != 0.0 or twist[2] != 0.0:
            return twist[0], twist[1], twist[2]
        u0 = LETTER_SHARE + (1.0 - LETTER_SHARE) * u1
    u0 = (u0 - LETTER_SHARE) / (1.0 - LETTER_SHARE)
    i = min(int(u0 * segments.shape[0]), segments.shape[0] - 1)
    # Clipped: the numbers beyond lie on the ends, so that the boundary of the stable set is drawn at all.
    b = min(1.0, max(0.0, (u1 - END_SHARE) / (1.0 - 2.0 * END_SHARE)))
    return between(segments[i], b)


@inlined
def apart(row: FloatArray, x: float, y: float, theta: float, heading_length: float) -> float:
    """Distance of a row's pose from a pose, m: straight travel and the smallest turn at so many metres a radian."""
    turn = abs((row[2] - theta + math.pi) % (2.0 * math.pi) - math.pi)
    return float(math.hypot(row[0] - x, row[1] - y) + heading_length * turn)


@no_refcount
def remaining(x: float, y: float, theta: float, goal: FloatArray) -> float:
    """Lower bound on the cost from a pose to the goal: straight travel plus the smallest turn."""
    return apart(goal, x, y, theta, TURN_WEIGHT)


@inlined
def enter(
    node: FloatArray,
    pose: tuple[float, float, float],
    cost: float,
    parent: int,
    arc: tuple[float, float, float, float],
) -> None:
    """Fill the row of a node: its pose, cost from the start, parent, and the arc that led there; see `NODE`."""
    node[0], node[1], node[2] = pose
    node[3], node[4] = cost, parent
    node[5], node[6], node[7], node[8] = arc


@inlined
def extend(
    problem: Problem,
    nodes: FloatArray,
    count: int,
    parent: int,
    controls: tuple[float, float, float],
    bound: float,
) -> bool:
    """Grow the tree by one arc.

    Args:
        problem: What to plan.
        nodes: (capacity, NODE) the tree; row `count` is filled on success.
        count: Nodes so far, below the capacity.
        parent: Row to grow from.
        controls: Three numbers in [0, 1]: which segment of the stable set, where on it, length of the arc.
        bound: Cost that a path through the new node must stay below.

    Returns:
        Whether the arc is free and worth keeping.
    """
    x, y, theta, cost = nodes[parent, 0], nodes[parent, 1], nodes[parent, 2], nodes[parent, 3]
    vx, vy, omega = choose_twist(problem, controls[0], controls[1])
    length = controls[2] * problem.longest
    nx, ny, nt = step(x, y, theta, vx, vy, omega, length)
    if length <= 0.0 or cost + length + remaining(nx, ny, nt, problem.goal) >= bound:
        return False
    if not sweep_is_free(problem.scene, x, y, theta, vx, vy, omega, length):
        return False
    enter(nodes[count], (nx, ny, nt), cost + length, parent, (vx, vy, omega, length))
    return True


@no_refcount
def trace(nodes: FloatArray, node: int, last: FloatArray, path: FloatArray) -> int:
    """Write the arcs from the root to a node and then `last` (3, 4) into `path`; return how many."""
    depth = 0
    i = node
    while nodes[i, 4] >= 0.0:
        depth += 1
        i = int(nodes[i, 4])
    i = node
    for k in range(depth - 1, -1, -1):
        put(path[k], nodes[i, 5:9])
        i = int(nodes[i, 4])
    for k in range(3):
        if last[k, 3] > 0.0:
            put(path[depth], last[k])
            depth += 1
    return depth


def branch(nodes: FloatArray, node: int) -> FloatArray:
    """Return the arcs (k, 4) from the root of a tree to a node."""
    path = np.empty((len(nodes) + 3, 4))
    return path[: trace(nodes, node, np.zeros((3, 4)), path)]


@no_refcount
def random(state: RandomState) -> float:
    """Draw a number in [0, 1) from the generator's state (1,) uint64 (splitmix64, Steele et al. 2014)."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) * (1.0 / 9007199254740992.0)
