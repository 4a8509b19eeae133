"""A tree of boxes around the obstacles: which of a thousand can be near is found by looking at a few boxes."""

from __future__ import annotations

import numpy as np

from pushplan.arrays import FloatArray, IntArray

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
    rows: list[list[float]] = []
    order: list[IntArray] = []
    counts = [0, 0]

    def add(members: IntArray) -> None:
        row = len(rows)
        rows.append([*boxes[members, :2].min(axis=0), *boxes[members, 2:].max(axis=0), 0.0, *[0.0] * 4])
        if len(members) <= LEAF:
            order.append(members)
            for kind, count in enumerate([(members < polygons).sum(), (members >= polygons).sum()]):
                rows[row][5 + 2 * kind : 7 + 2 * kind] = [counts[kind], counts[kind] + count]
                counts[kind] += int(count)
        else:
            for half in _halves(boxes, members):
                add(half)
        rows[row][4] = len(rows)

    if len(boxes):
        add(np.arange(len(boxes)))
    tree = np.array(rows, dtype=np.float64).reshape(-1, 9)
    return tree, np.concatenate([np.zeros(0, dtype=np.int64), *order])


def _halves(boxes: FloatArray, members: IntArray) -> tuple[IntArray, IntArray]:
    """Members to either side of the median."""
    centers = boxes[members, :2] + boxes[members, 2:]
    axis = int(np.argmax(np.ptp(centers, axis=0)))
    sorted_members = members[np.argsort(centers[:, axis], kind="stable")]
    middle = len(members) // 2
    return sorted_members[:middle], sorted_members[middle:]
