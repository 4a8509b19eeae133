"""Rounds of flooding the cells of the poses, on levels of ever finer cells and more room.

A level has half as many rounds as the one below it (Luby, Sinclair and Zuckerman 1993): coarse rounds are over soon
and, with their cells placed anew, each is another chance.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.planners.improve.session import CHUNK, Session
from pushplan.planners.problem.problem import NODE, branch, random
from pushplan.planners.search.cell_kernel import NODES, TRIED, CellTrees, flood

FIRST_SHARE = 0.04
"""Side of the lowest level's cells, as a share of the sampling box's diagonal."""

FIRST_HEADINGS = 24
"""Headings that the lowest level tells apart; on higher ones they grow as the root of one by the side."""

ARC_SIDES = 1.5
"""Typical length of an arc, in sides of a cell: just enough to leave it."""

SHRINK = 0.8
"""Factor of the cells' sides from level to level."""

FIRST_ROOM = 1_500
"""Nodes that a tree has room for on the lowest level."""

GROWTH = 4.0
"""Factor of the room from level to level."""

HIGHEST = 4
"""Highest level: its trees take 100 MB, which most searches never need."""

Box = tuple[float, float, float, float]


class CellRounds:
    """The rounds of one search: each begins with fresh trees and cells placed anew.

    Args:
        session: The search that they serve.
        box: (xmin, ymin, xmax, ymax) that the trees stay in, m.

    Attributes:
        extensions: Arcs tried so far.
    """

    def __init__(self, session: Session, box: Box) -> None:
        self._session, self._box = session, np.array(box)
        self._diagonal = math.hypot(box[2] - box[0], box[3] - box[1])
        self._rounds, self.extensions = 0, 0

    def run_next(self, stop: Callable[[], bool]) -> None:
        """Flood until both trees are over or they join; offer the path to the session."""
        session = self._session
        self._rounds += 1
        trees = self._planted(min((self._rounds & -self._rounds).bit_length() - 1, HIGHEST))
        path = np.empty((2 * trees.nodes.shape[1] + 3, 4))
        arcs = 0
        while arcs == 0 and not stop():
            before = int(trees.counts[:, TRIED].sum())
            arcs = flood(session.problem, trees, CHUNK, path)
            done = int(trees.counts[:, TRIED].sum()) - before
            session.spent(done)
            self.extensions += done
        if arcs > 0:
            session.offer(path[:arcs])
        self._note(trees)

    def _planted(self, level: int) -> CellTrees:
        side = self._diagonal * FIRST_SHARE * SHRINK**level
        headings = round(FIRST_HEADINGS * SHRINK ** (-0.5 * level))
        sizes = (side, 2.0 * math.pi / headings, ARC_SIDES * side)
        return planted(self._session, self._shifted(side), int(FIRST_ROOM * GROWTH**level), sizes)

    def _shifted(self, side: float) -> FloatArray:
        """Return the box, its lower corner moved at random by less than a side of a cell."""
        state = self._session.random
        return np.asarray(self._box - np.array([side * random(state), side * random(state), 0.0, 0.0]))

    def _note(self, trees: CellTrees) -> None:
        """Hand the branches to the session, and the way to the node nearest to the goal."""
        session = self._session
        ahead, behind = (trees.nodes[k, : trees.counts[k, NODES]] for k in (0, 1))
        session.branches.offer_nodes(ahead, behind)
        session.note_nearest(ahead[:, :3], lambda node: branch(ahead, node))


def planted(session: Session, box: FloatArray, room: int, sizes: tuple[float, float, float]) -> CellTrees:
    """Return trees of start and goal alone, with room for so many nodes each; see `CellTrees`."""
    nodes = np.zeros((2, room, NODE))
    nodes[0, 0, :3], nodes[1, 0, :3], nodes[:, 0, 4] = session.start, session.problem.goal, -1.0
    keys = np.zeros((2, 1 << math.ceil(math.log2(2 * room))), dtype=np.int64)
    counts = np.zeros((2, 5), dtype=np.int64)
    counts[:, NODES] = 1
    return CellTrees(nodes, keys, counts, box, np.array([sizes, sizes]), session.random)
