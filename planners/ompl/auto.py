"""The project's own anytime planner: pairs of trees for a first path, best-first searches for the right passage.

The first rounds grow two trees towards each other, which joins most poses within a millisecond. Where they find
nothing, flooding the cells of the poses takes most of the time until there is a path. From then on best-first
searches over cells look for cheaper ones, forward and backward: as they take the floor's distances into account and
forget no cheap way into a cell, they come through passages that trees miss. Each path found is polished.
"""

from __future__ import annotations

import math
from itertools import count

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.planners.improve.session import CHUNK, Session
from pushplan.planners.ompl.anytime import AnytimePlanner
from pushplan.planners.ompl.posing import Box, PushInformation
from pushplan.planners.search.bidirectional import grow_both
from pushplan.planners.search.cell_rounds import CellRounds
from pushplan.planners.search.forest import NODE, Forest, plant
from pushplan.planners.search.lattice_rounds import LatticeRounds

FIRST_ROUND = 256
"""Extensions of the first round; later ones have as many, at times twice, four times as many and so on."""

REACH_SHARE = 0.15
"""Longest piece of a word added at a time, as a share of the sampling box's diagonal."""

ROOM = (0.3, 1.0)
"""Shares of the best cost by which a new path may exceed it before polishing, in turn from round to round."""

UNFLOODED = 6
"""Rounds before flooding begins."""

BLIND = (0.0, 0.6, 0.3)
"""Shares of the extensions that take a random arc, in turn from round to round."""

FLOOD_RATIO = 40.0
"""As long as there is no path, so many arcs of flooding for each extension of the trees, which takes longer."""

LATTICE_RATIO = 40.0
"""So many arcs of best-first search for each extension of the trees, which takes eight times as long."""


class Auto(AnytimePlanner):
    """Rounds of trees, of best-first search, and of flooding while there is no path."""

    name = "auto"

    def improve(self, information: PushInformation) -> None:
        """Run rounds until the search is over."""
        session, box, heading_length = information.session, information.box, information.heading_length
        reach = REACH_SHARE * math.hypot(box[2] - box[0], box[3] - box[1])
        forest = _forest(FIRST_ROUND, session, box, heading_length, reach)
        cells, lattice = CellRounds(session, box), LatticeRounds(session, box)
        grown = 0
        for number in count():
            allowance = FIRST_ROUND * _luby(number + 1)
            if len(forest.ahead) < allowance + CHUNK:
                forest = _forest(allowance, session, box, heading_length, reach)
            blind = BLIND[number % len(BLIND)]
            grown += _round(session, forest._replace(blind=blind), allowance, 1.0 + ROOM[number % len(ROOM)])
            session.branches.offer_nodes(forest.ahead[: forest.counts[0]], forest.behind[: forest.counts[1]])
            session.refine()
            if number >= UNFLOODED:
                _flood(session, cells, grown)
            lattice.run(LATTICE_RATIO * grown)
            if session.finished:
                return


def _flood(session: Session, cells: CellRounds, grown: int) -> None:
    """Flood, as long as there is no path, until that has had its part of the extensions."""

    def enough() -> bool:
        return session.finished or session.solved

    while cells.extensions < FLOOD_RATIO * grown and not enough():
        cells.run_next(enough)


def _luby(i: int) -> int:
    """Return the i-th term, from 1, of 1, 1, 2, 1, 1, 2, 4, ... (Luby, Sinclair and Zuckerman 1993)."""
    k = i.bit_length()
    while i != (1 << k) - 1:
        i -= (1 << (k - 1)) - 1
        k = i.bit_length()
    return 1 << (k - 1)


def _forest(size: int, session: Session, box: Box, heading_length: float, reach: float) -> Forest:
    ahead, behind = np.zeros((2, size + CHUNK, NODE))
    return Forest(
        ahead=ahead,
        behind=behind,
        counts=np.ones(2, dtype=np.int64),
        box=np.array(box, dtype=np.float64),
        heading_length=heading_length,
        reach=reach,
        state=session.random,
        blind=0.0,
    )


def _round(session: Session, forest: Forest, allowance: int, excess: float) -> int:
    """Grow fresh trees until they join or have used up their extensions; return how many these were."""
    plant(forest, session.start, session.problem.goal)
    path = np.empty((3 * (len(forest.ahead) + len(forest.behind)) + 3, 4))
    used = 0
    while used < allowance and not session.finished:
        bound = excess * session.best.horizon
        done, arcs = grow_both(session.problem, forest, bound, CHUNK, path)
        used += done
        session.spent(done)
        if arcs:
            session.offer(path[:arcs])
            return used
    ahead = forest.ahead[: forest.counts[0]]
    session.note_nearest(ahead[:, :3], lambda node: _way_to(ahead, node))
    return used


def _way_to(tree: FloatArray, node: int) -> FloatArray:
    """Arcs (k, 4) from the root of the tree from the start to a node."""
    words: list[FloatArray] = []
    while tree[node, 4] >= 0.0:
        words.append(tree[node, 5:].reshape(3, 4))
        node = int(tree[node, 4])
    arcs = np.concatenate(words[::-1]) if words else np.zeros((0, 4))
    return arcs[arcs[:, 3] > 0.0]
