"""What a log keeps of a search besides its paths: the branches of its largest trees, thinned."""

from __future__ import annotations

import numpy as np

from pushplan.util.arrays import FloatArray, IntArray

MOST_BRANCHES = 500
"""Branches that are kept, at most."""


class Branches:
    """Keeps the branches of the largest trees of a search.

    Attributes:
        ends: (q, 2, 3) poses at both ends of each branch.
        size: Number of branches of these trees.
    """

    def __init__(self) -> None:
        self.ends = np.zeros((0, 2, 3))
        self.size = 0

    def offer(self, *trees: tuple[FloatArray, IntArray]) -> None:
        """Keep the branches of trees that were grown together, if they are more than those before.

        Args:
            trees: Poses (k, 3) of the nodes of each, and the parents (k,), negative where there is none.
        """
        size = sum(int((parents >= 0).sum()) for _, parents in trees)
        if size > self.size:
            ends = np.concatenate([_ends(poses, parents) for poses, parents in trees])
            kept = np.linspace(0, size - 1, min(size, MOST_BRANCHES)).astype(int)
            self.ends, self.size = ends[kept], size

    def offer_nodes(self, *trees: FloatArray) -> None:
        """As `offer`, of trees (k, >= 5) whose rows begin with x, y, theta, cost and parent."""
        self.offer(*((nodes[:, :3], nodes[:, 4].astype(np.int64)) for nodes in trees))


def _ends(poses: FloatArray, parents: IntArray) -> FloatArray:
    rows = np.flatnonzero(parents >= 0)
    return np.stack([poses[parents[rows]], poses[rows]], axis=1)
