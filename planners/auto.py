"""The project's own anytime planner: compiled bidirectional searches, restarted, each path polished.

A restart after every path drives the search apart: what one pair of trees misses (the right passage), the
next may find, and the best path's cost prunes them all. Trees are allowed to grow larger each time they
find nothing.
"""

from __future__ import annotations

import numpy as np

from pushplan.planners.bidirectional import NODE, Forest, grow_both, plant
from pushplan.planners.session import Session

FIRST_ROUND = 256
"""Extensions of the first round that may find nothing; half as many more each time."""

CHUNK = 128
"""Extensions between two looks at the clock."""

REACH_SHARE = 0.15
"""Longest piece of a word added at a time, as a share of the sampling box's diagonal."""


def search(session: Session, box: tuple[float, float, float, float], heading_length: float) -> None:
    """Run rounds of bidirectional search until the session is finished."""
    diagonal = float(np.hypot(box[2] - box[0], box[3] - box[1]))
    allowance = FIRST_ROUND
    forest = _forest(allowance, session, box, heading_length, REACH_SHARE * diagonal)
    while not session.finished:
        if len(forest.ahead) < allowance + CHUNK:
            forest = _forest(2 * allowance, session, box, heading_length, REACH_SHARE * diagonal)
        if not _round(session, forest, allowance):
            allowance += allowance // 2


def _forest(
    size: int, session: Session, box: tuple[float, float, float, float], heading_length: float, reach: float
) -> Forest:
    ahead, behind = np.zeros((2, size + CHUNK, NODE))
    return Forest(
        ahead, behind, np.ones(2, dtype=np.int64), np.array(box), heading_length, reach, session.random
    )


def _round(session: Session, forest: Forest, allowance: int) -> bool:
    """Grow fresh trees until they find a better path (True) or have used up their extensions (False)."""
    plant(forest, session.start, session.problem.goal)
    path = np.empty((3 * sum(map(len, (forest.ahead, forest.behind))) + 3, 4))
    used = 0
    while used < allowance and not session.finished:
        done, arcs = grow_both(session.problem, forest, session.bound, CHUNK, path)
        used += done
        session.extensions += done
        if arcs:
            session.offer(path[:arcs][path[:arcs, 3] > 0.0])
            return True
    return False
