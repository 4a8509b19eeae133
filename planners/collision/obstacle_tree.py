"""A tree of boxes around the obstacles: which of a thousand can be near is found by looking at a few boxes."""

from __future__ import annotations

import numpy as np

from pushplan.compiled import compiled
from pushplan.util.arrays import FloatArray, IntArray

LEAF = 4
"""Obstacles in a leaf, at most."""


def obstacle_tree(boxes: FloatArray, polygons: int) -> tuple[FloatArray, IntArray]:
    """Return the tree over obstacles, halved at the median along the longer side of their centres' extent.

    Args:
        boxes: (n, 4) xmin, ymin, xmax, ymax of each obstacle.
        polygons: So many of them, the first ones, are polygons; the others are circles.

    Returns:
        (t, 9) nodes in preorder: box, row of the next node that is not below it, and for leaves first and
        last + 1 of its polygons and of its circles, empty ranges for other nodes; and (n,) the order that polygons
        and circles have to be brought into for these ranges.
    """
    tree, order, counts = np.zeros((2 * len(boxes), 9)), np.arange(len(boxes)), np.zeros(2, dtype=np.int64)
    rows = _add(boxes, polygons, LEAF, order, tree, 0, counts) if len(boxes) else 0
    return tree[:rows].copy(), order


@compiled
def _add(
    boxes: FloatArray,
    polygons: int,
    leaf: int,
    members: IntArray,
    tree: FloatArray,
    row: int,
    counts: IntArray,
) -> int:
    """Write the nodes above some obstacles from `row` on, bring them into order, and return the next free row."""
    node, last = tree[row], row + 1
    node[:2], node[2:4] = np.inf, -np.inf
    for i in members:
        for axis in range(2):
            node[axis] = min(node[axis], boxes[i, axis])
            node[2 + axis] = max(node[2 + axis], boxes[i, 2 + axis])
    if len(members) <= leaf:
        # Leaves are met in the order of rows, so that polygons and circles get consecutive numbers in it.
        for i in members:
            counts[0 if i < polygons else 1] += 1
        node[6], node[8] = counts
        node[5], node[7] = counts[0] - (members < polygons).sum(), counts[1] - (members >= polygons).sum()
    else:
        _sort(boxes, members)
        half = len(members) // 2
        last = _add(boxes, polygons, leaf, members[:half], tree, last, counts)
        last = _add(boxes, polygons, leaf, members[half:], tree, last, counts)
    node[4] = last
    return last


@compiled
def _sort(boxes: FloatArray, members: IntArray) -> None:
    """Sort obstacles by their centres along the longer side of these centres' extent."""
    centers = np.empty((2, len(members)))
    for k in range(len(members)):
        for axis in range(2):
            # Twice the centre: only the order counts.
            centers[axis, k] = boxes[members[k], axis] + boxes[members[k], 2 + axis]
    axis = 0 if np.ptp(centers[0]) >= np.ptp(centers[1]) else 1
    members[:] = members[np.argsort(centers[axis], kind="mergesort")]
