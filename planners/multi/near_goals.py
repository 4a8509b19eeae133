"""Where a push may end: at a goal of the load, and beside it, within what may be used of its tolerance."""

from __future__ import annotations

import numpy as np

from pushplan.core.pushes import PackedMode, approaches_are_free, word_costs
from pushplan.geometry import se2
from pushplan.planners.multi.room import DETOUR, PushRoom, Question
from pushplan.util.arrays import FloatArray, IntArray

BESIDE = np.array(
    [(x, y, turn) for x, y in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)) for turn in (0, 1, -1)], dtype=float
)
"""Where an object may end: at the goal, and beside it, as shares of what may be used of its tolerance."""

ALONG = 400
"""Poses along a turn or a straight push, of which the nearest to a goal is looked for."""

NEAR_TRIES = 4
"""Poses within the tolerance that are tried for each push but the last, those first that cost least."""

ROUNDING = 1e-9
"""Up to so far beyond the tolerance a turn is looked at pose by pose, m."""


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

    def to(self, mode: PackedMode, load: FloatArray) -> list[tuple[FloatArray, float, int]]:
        """Return poses (3,) to which pushes by a contact lead, what that costs beyond the push, and nodes of goals.

        They are on a grid, and where turns and straight pushes come nearest; those that cost least come first.

        Args:
            mode: The contact.
            load: (3,) pose that the pushes begin at.
        """
        poses, goals = self._passed(mode, load)
        ends, prices, nodes = self._grid, self._prices, self._nodes
        if len(poses):
            ends = np.concatenate([ends, se2.compose(poses, se2.inverse(self._inner))])
            prices = np.concatenate([prices, np.full(len(poses), DETOUR)])
            nodes = np.concatenate([nodes, 1 + goals])
        free = approaches_are_free(self._room.robot, mode, ends, True)
        ends, prices, nodes = ends[free], prices[free], nodes[free]
        costs = word_costs(mode, load[None], ends, np.zeros(1), prices, np.inf)[0] + prices
        best = np.argsort(costs, kind="stable")[:NEAR_TRIES]
        return [(ends[k], float(prices[k]), int(nodes[k])) for k in best]

    def _passed(self, mode: PackedMode, load: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return where turns and straight pushes pass within the tolerance, poses (k, 3) and goals (k,)."""
        begin = se2.compose(load, mode.contact)
        begin = se2.compose(begin, se2.exp(mode.settling * mode.settle))
        back, twists = se2.inverse(mode.contact), mode.families.reshape(-1, 3)
        own = se2.compose(back, self._inner)
        away = passing_distances(se2.compose(begin, own), se2.twist_of(own, twists), self._goals[:, :2])
        # Some two in a thousand pass by so near: without poses along the others first plans for eight blocks take
        # 0.94 of the CPU time.
        twists = twists[away.min(axis=1) <= self._within[0] + ROUNDING]
        far = 1.5 * float(np.hypot(*(self._goals - load)[:, :2].T).max())
        found: list[tuple[FloatArray, int]] = []
        for twist in twists:
            arc = se2.compose(begin, se2.exp(np.linspace(0.0, far, ALONG)[:, None] * twist))
            poses = se2.compose(se2.compose(arc, back), self._inner)
            distance = np.hypot(*np.moveaxis(poses[:, None, :2] - self._goals[:, :2], -1, 0)) / self._within[0]
            k, goal = np.nonzero(distance <= 1.0)
            angle = np.abs(se2.wrap_angle(poses[k, 2] - self._goals[goal, 2])) / self._within[1]
            share = np.maximum(distance[k, goal], angle)
            if share.min(initial=np.inf) <= 1.0:
                found.append((poses[k[share.argmin()]], int(goal[share.argmin()])))
        return np.array([pose for pose, _ in found]).reshape(-1, 3), np.array([goal for _, goal in found], dtype=int)


def passing_distances(start: FloatArray, twists: FloatArray, points: FloatArray) -> FloatArray:
    """Return how near (t, g) a frame's origin passes by points (g, 2) that keeps a body twist (t, 3), m.

    On the whole circle, or the whole line, that it moves along: (3,) `start` is somewhere on it.
    """
    v, off = se2.rotate(start[2], twists[:, :2])[:, None], points - start[:2]
    speed, turn = np.hypot(v[..., 0], v[..., 1]), twists[:, 2, None]
    aside = np.abs(v[..., 0] * off[:, 1] - v[..., 1] * off[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        center = np.stack([-v[..., 1], v[..., 0]], axis=-1) / turn[..., None]
        away = np.hypot(*np.moveaxis(off - center, -1, 0))
        found = np.where(turn == 0.0, aside / speed, np.abs(away - speed / np.abs(turn)))
    return np.asarray(np.nan_to_num(found, nan=0.0))
