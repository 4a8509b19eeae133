"""Where a push may end: at a goal of the load, and beside it, within what may be used of its tolerance."""

from __future__ import annotations

import numpy as np

from pushplan.core.pushes import PackedMode, approaches_are_free, find_passings, word_costs
from pushplan.geometry import se2
from pushplan.planners.multi.room import DETOUR, PushRoom, Question
from pushplan.util.arrays import FloatArray

BESIDE = np.array(
    [(x, y, turn) for x, y in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)) for turn in (0, 1, -1)], dtype=float
)
"""Where an object may end: at the goal, and beside it, as shares of what may be used of its tolerance."""

NEAR_TRIES = 4
"""Poses within the tolerance that are tried for each push but the last, those first that cost least."""


class NearGoals:
    """Poses of a load at its goals and beside them.

    Args:
        room: Robot, load and contacts.
        question: With goals, and how far from them a plan may end.
    """

    def __init__(self, room: PushRoom, question: Question) -> None:
        self._room, self._within = room, question.within
        self._inner = room.scenario.chain.objects[0].pose_chain
        self._goals = se2.compose(question.goals, self._inner)
        grid = se2.compose(self._goals[:, None], self._within[[0, 0, 1]] * BESIDE).reshape(-1, 3)
        self._grid = se2.compose(grid, se2.inverse(self._inner))
        self._prices = np.full(len(grid), DETOUR)
        self._prices[:: len(BESIDE)] = 0.0
        self._nodes = 1 + np.repeat(np.arange(len(self._goals)), len(BESIDE))

    def to(self, mode: PackedMode, load: FloatArray, below: float) -> list[tuple[FloatArray, float, int, float]]:
        """Return poses (3,) to which pushes by a contact lead, what that costs beyond the push, and nodes of goals.

        They are on a grid, and where turns and straight pushes come nearest; those that cost least come first. What
        push and end cost at least, m, stands last.

        Args:
            mode: The contact.
            load: (3,) pose that the pushes begin at.
            below: They cost less than this, with what they cost beyond the push, m.
        """
        far = 1.5 * float(np.hypot(*(self._goals - load)[:, :2].T).max())
        passed, goals = find_passings(mode, load, self._inner, self._goals, self._within, far)
        ends = np.concatenate([self._grid, passed])
        prices = np.concatenate([self._prices, np.full(len(passed), DETOUR)])
        nodes = np.concatenate([self._nodes, 1 + goals])
        costs = word_costs(mode, load[None], ends, np.zeros(1), prices, below)[0] + prices
        cheap = np.flatnonzero(costs < below)
        free = cheap[approaches_are_free(self._room.robot, mode, ends[cheap], True)]
        best = free[np.argsort(costs[free], kind="stable")[:NEAR_TRIES]]
        return [(ends[k], float(prices[k]), int(nodes[k]), float(costs[k])) for k in best]
