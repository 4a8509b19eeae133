"""The project's own anytime planner: compiled bidirectional searches, restarted, each path polished.

A restart after every path drives the search apart: what one pair of trees misses (the right passage), the next
may find. After the first rounds most searches are guided by a way for the chain's middle, another one each time,
so that every passage has its turn. The trees are pruned by the best path's cost, with room for what polishing will
save. Between them, pieces of the best path are led through poses nearby. Where the first rounds find nothing,
flooding the cells of the poses takes most of the time until there is a path.
"""

from __future__ import annotations

import math
from itertools import count

import numpy as np

from pushplan.arrays import FloatArray, RandomState
from pushplan.planners.improve.detours import try_detour
from pushplan.planners.improve.session import CHUNK, Session
from pushplan.planners.ompl.anytime import AnytimePlanner
from pushplan.planners.ompl.posing import Box, PushInformation
from pushplan.planners.problem.prices import TRAVEL
from pushplan.planners.problem.problem import random
from pushplan.planners.search.bidirectional import grow_both
from pushplan.planners.search.cell_rounds import CellRounds
from pushplan.planners.search.forest import NODE, Forest, plant
from pushplan.planners.search.guide import Guide, find_way, make_guide, middle_of

FIRST_ROUND = 256
"""Extensions of the first round; later ones have as many, at times twice, four times as many and so on."""

REACH_SHARE = 0.15
"""Longest piece of a word added at a time, as a share of the sampling box's diagonal."""

ROOM = (0.3, 1.0)
"""Shares of the best cost by which a new path may exceed it before polishing, in turn from round to round."""

UNGUIDED = 2
"""Rounds before the first that is guided by a way: most problems need none."""

UNFLOODED = 6
"""Rounds before flooding begins."""

UNDIVERTED = 24
"""Rounds before detours of the best path begin."""

DETOURS = 8
"""So many are tried between two rounds then."""

FREELY = 4
"""One of so many later rounds goes without a way too."""

ROUGHNESS = 1.5
"""Largest logarithm of the ratio between prices of the floor under which ways are sought."""

BLIND = (0.0, 0.6, 0.3)
"""Shares of the extensions that take a random arc, in turn from round to round."""

FLOOD_RATIO = 40.0
"""As long as there is no path, so many arcs of flooding for each extension of the other trees, which takes longer."""

NO_WAY = np.zeros((0, 2))


class Auto(AnytimePlanner):
    """Rounds of bidirectional search, and of flooding while there is no path."""

    name = "auto"

    def improve(self, information: PushInformation) -> None:
        """Run rounds until the search is over."""
        session, box, heading_length = information.session, information.box, information.heading_length
        reach = REACH_SHARE * math.hypot(box[2] - box[0], box[3] - box[1])
        forest = _forest(FIRST_ROUND, session, box, heading_length, reach)
        cells = CellRounds(session, box)
        guide: Guide | None = None
        for number in count():
            if session.finished:
                return
            session.refine()
            if number >= UNDIVERTED:
                _divert(session)
            if number >= UNFLOODED:
                _flood(session, cells)
            if number >= UNGUIDED and guide is None:
                guide = make_guide(session.problem, session.start, box)
            allowance = FIRST_ROUND * _luby(number + 1)
            if len(forest.ahead) < allowance + CHUNK:
                forest = _forest(allowance, session, box, heading_length, reach)
            way = NO_WAY if guide is None else _draw_way(guide, session.random, number)
            blind = BLIND[number % len(BLIND)]
            _round(session, forest._replace(way=way, blind=blind), allowance, 1.0 + ROOM[number % len(ROOM)])
            session.branches.offer_nodes(forest.ahead[: forest.counts[0]], forest.behind[: forest.counts[1]])


def _divert(session: Session) -> None:
    """Try detours of the best path, if paths are ranked by travel; by other costs, restarts gain more.

    They come on top of the restarts, so they do not let a search end sooner.
    """
    if session.best_arcs is None or session.problem.prices.kind != TRAVEL:
        return
    before = session.iterations
    for _ in range(DETOURS):
        if session.finished:
            return
        try_detour(session)
    session.excuse(session.iterations - before)


def _flood(session: Session, cells: CellRounds) -> None:
    """Flood, as long as there is no path, until that has had its part of the extensions."""

    def enough() -> bool:
        return session.finished or session.best_arcs is not None

    share = FLOOD_RATIO * (session.extensions - cells.extensions)
    while cells.extensions < share and not enough():
        cells.run_next(enough)


def _luby(i: int) -> int:
    """Return the i-th term, from 1, of 1, 1, 2, 1, 1, 2, 4, ... (Luby, Sinclair and Zuckerman 1993)."""
    k = i.bit_length()
    while i != (1 << k) - 1:
        i -= (1 << (k - 1)) - 1
        k = i.bit_length()
    return 1 << (k - 1)


def _draw_way(guide: Guide, state: RandomState, number: int) -> FloatArray:
    """Return a way (k, 2) to try, empty when there is none, and in one round of `FREELY`."""
    if number % FREELY == 0:
        return NO_WAY
    way = np.empty((guide.space.size, 2))
    rough, tight = ROUGHNESS * random(state), 2.0 * guide.half_width * random(state)
    return way[: find_way(guide, rough, tight, state, way)]


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
        way=NO_WAY,
        middle=middle_of(session.problem),
        blind=0.0,
    )


def _round(session: Session, forest: Forest, allowance: int, excess: float) -> None:
    """Grow fresh trees until they join or have used up their extensions."""
    plant(forest, session.start, session.problem.goal)
    path = np.empty((3 * (len(forest.ahead) + len(forest.behind)) + 3, 4))
    used = 0
    while used < allowance and not session.finished:
        bound = excess * session.horizon
        done, arcs = grow_both(session.problem, forest, bound, CHUNK, path)
        used += done
        session.spent(done)
        if arcs:
            session.offer(path[:arcs])
            return
    node = session.nearer(forest.ahead[: forest.counts[0], :3])
    if node >= 0:
        session.approach(_way_to(forest.ahead, node))


def _way_to(tree: FloatArray, node: int) -> FloatArray:
    """Arcs (k, 4) from the root of the tree from the start to a node."""
    words: list[FloatArray] = []
    while tree[node, 4] >= 0.0:
        words.append(tree[node, 5:].reshape(3, 4))
        node = int(tree[node, 4])
    arcs = np.concatenate(words[::-1]) if words else np.zeros((0, 4))
    return arcs[arcs[:, 3] > 0.0]
