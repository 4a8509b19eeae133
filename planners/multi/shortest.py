"""The cheapest sequence of pushes and changes of the contact, by what each of them is known or assumed to cost."""

from __future__ import annotations

import numpy as np

from pushplan.compiled import compiled
from pushplan.util.arrays import FloatArray, IntArray


@compiled
def cheapest_sequence(
    pushes: FloatArray, changes: FloatArray, first: FloatArray, goals: int, most: int
) -> tuple[float, IntArray]:
    """Find the cheapest sequence of pushes from node 0 to one of nodes 1 to `goals`.

    By the number of pushes, cheapest first, as in the recursion of Bellman and Ford.

    Args:
        pushes: (m, v, v) cost of a push by mode from node to node.
        changes: (v, m, m) cost of a change at a node from mode to mode.
        first: (m,) cost of what comes before a first push.
        goals: How many nodes are goals.
        most: Pushes, at most.

    Returns:
        The cost, infinite where there is none, and (k, 3) mode, first and last node of each push.
    """
    modes, nodes = pushes.shape[0], pushes.shape[1]
    ready = np.full((nodes, modes), np.inf)
    ready[0] = first
    came = np.zeros((most, nodes, modes), dtype=np.int64)
    before = np.zeros((most, nodes, modes), dtype=np.int64)
    best, last, at, by = np.inf, -1, -1, -1
    for k in range(most):
        done = np.full((nodes, modes), np.inf)
        for m in range(modes):
            for u in range(nodes):
                # What costs as much as a whole plan already leads to none that is cheaper: no cost is negative.
                if ready[u, m] < best:
                    for v in range(nodes):
                        cost = ready[u, m] + pushes[m, u, v]
                        if cost < done[v, m]:
                            done[v, m] = cost
                            came[k, v, m] = u
        for v in range(1, goals + 1):
            for m in range(modes):
                if done[v, m] < best:
                    best, last, at, by = done[v, m], k, v, m
        if k + 1 == most:
            break
        ready[:] = np.inf
        # At a goal the sequence ends; at the start (node 0) no contact has been made that could be changed.
        for v in range(goals + 1, nodes):
            for m in range(modes):
                if done[v, m] < best:
                    for q in range(modes):
                        cost = done[v, m] + changes[v, m, q]
                        if cost < ready[v, q]:
                            ready[v, q] = cost
                            before[k + 1, v, q] = m
    steps = np.zeros((last + 1, 3), dtype=np.int64)
    for k in range(last, -1, -1):
        u = came[k, at, by]
        steps[k, 0], steps[k, 1], steps[k, 2] = by, u, at
        at, by = u, before[k, u, by]
    return best, steps
