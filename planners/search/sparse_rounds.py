"""Rounds of Stable Sparse RRT (Li, Littlefield and Bekris 2016), as in their SST*.

Each round begins anew with witnesses closer together and more extensions, so that costs fall towards the optimum of
the sampled arcs; every path found after the first has to be cheaper.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pushplan.planners.improve.session import CHUNK, Session
from pushplan.planners.problem.posing import Box
from pushplan.planners.problem.problem import NODE, branch, remaining
from pushplan.planners.search.sst_kernel import ACTIVE, NODES, TO_GO, UNUSED, SparseTree, grow_sparse
from pushplan.util.arrays import FloatArray


class SparseRounds:
    """The rounds of one search: each is a tree of its own.

    Args:
        session: The search that they serve.
        box: (xmin, ymin, xmax, ymax) to sample from, m.
        heading_length: Metres that a radian counts as.

    Attributes:
        extensions: Arcs tried so far.
    """

    def __init__(self, session: Session, box: Box, heading_length: float) -> None:
        self._session, self._box, self._heading_length = session, np.array(box), heading_length
        self._diagonal = math.hypot(box[2] - box[0], box[3] - box[1])
        self._shrunk, self._extensions, self.extensions = 1.0, 4_000.0, 0

    def run_next(self, stop: Callable[[], bool]) -> None:
        """Grow one tree, offering every path found to the session."""
        session = self._session
        shares = (0.08, 0.04)  # of the diagonal: around a random pose, and between witnesses
        radii = np.array([self._heading_length, *(self._shrunk * self._diagonal * share for share in shares)])
        tree, left = planted(session, self._box, radii), int(self._extensions)
        path = np.empty((len(tree.nodes) + 3, 4))
        while left > 0 and not stop():
            if tree.counts[0] + CHUNK > len(tree.nodes):
                tree = doubled(tree)
                path = np.empty((len(tree.nodes) + 3, 4))
            done, arcs = grow_sparse(session.problem, tree, session.best.bound, CHUNK, path)
            session.spent(done)
            left -= done
            self.extensions += done
            if arcs:
                session.offer(path[:arcs])
        _note(session, tree)
        self._shrunk, self._extensions = 0.85 * self._shrunk, 1.4 * self._extensions


def planted(session: Session, box: FloatArray, radii: FloatArray) -> SparseTree:
    """Return a tree of the start alone, which is the first witness too."""
    nodes, roles = np.zeros((4 * CHUNK, NODE + 1)), np.zeros((4 * CHUNK, 2), dtype=np.int64)
    witnesses, unused = np.zeros((4 * CHUNK, 4)), np.zeros(4 * CHUNK, dtype=np.int64)
    nodes[0, :3] = witnesses[0, :3] = session.start
    nodes[0, 4] = -1.0
    x, y, theta = session.start
    nodes[0, TO_GO] = remaining(x, y, theta, session.problem.goal)
    roles[0, ACTIVE] = 1
    counts = np.array([1, 1, 0])
    return SparseTree(nodes, roles, witnesses, unused, counts, box, radii, session.random)


def _note(session: Session, tree: SparseTree) -> None:
    """Hand the tree's branches to the session, and the way to its node nearest to the goal."""
    nodes = tree.nodes[: tree.counts[NODES]]
    parents = nodes[:, 4].astype(np.int64)
    parents[tree.unused[: tree.counts[UNUSED]]] = -1
    session.branches.offer((nodes[:, :3], parents))
    rows = np.append(0, np.flatnonzero(parents >= 0))
    session.note_nearest(nodes[rows, :3], lambda node: branch(tree.nodes, int(rows[node])))


def doubled(tree: SparseTree) -> SparseTree:
    """Return the tree with twice the room."""
    nodes, witnesses = (np.concatenate([a, np.zeros_like(a)]) for a in (tree.nodes, tree.witnesses))
    roles, unused = (np.concatenate([a, np.zeros_like(a)]) for a in (tree.roles, tree.unused))
    return tree._replace(nodes=nodes, roles=roles, witnesses=witnesses, unused=unused)
