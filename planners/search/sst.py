"""Stable sparse RRT (SST): OMPL's has no constructor in Python."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pushplan.core.search import SparseTree, branch
from pushplan.planners.improve.session import CHUNK, Session
from pushplan.planners.ompl.auto import AnytimePlanner
from pushplan.planners.ompl.form import PushInformation
from pushplan.planners.problem.problem import Box


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
        radii = [self._shrunk * self._diagonal * share for share in shares]
        tree = SparseTree(session.start, session.problem.goal, self._box, self._heading_length, *radii)
        left = int(self._extensions)
        while left > 0 and not stop():
            done, path = tree.grow(session.problem, session.random, session.best.bound, CHUNK)
            session.spent(done)
            left -= done
            self.extensions += done
            if path is not None:
                session.offer(path)
        _note(session, tree)
        self._shrunk, self._extensions = 0.85 * self._shrunk, 1.4 * self._extensions


def _note(session: Session, tree: SparseTree) -> None:
    """Hand the tree's branches to the session, and the way to its node nearest to the goal."""
    nodes = tree.nodes
    parents = nodes[:, 4].astype(np.int64)
    parents[tree.unused] = -1
    session.branches.offer((nodes[:, :3], parents))
    rows = np.append(0, np.flatnonzero(parents >= 0))
    session.note_nearest(nodes[rows, :3], lambda node: branch(nodes, int(rows[node])))


class StableSparseRRT(AnytimePlanner):
    """Rounds of sparse trees."""

    name = "SST"

    def improve(self, information: PushInformation) -> None:
        """Run rounds until the search is over."""
        session = information.session
        rounds = SparseRounds(session, information.box, information.heading_length)
        while not session.finished:
            rounds.run_next(session.stop)
            session.refine()
