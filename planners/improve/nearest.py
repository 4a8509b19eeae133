"""How near to the goal a search has come that has found no path there."""

from __future__ import annotations

import numpy as np

from pushplan.geometry import se2
from pushplan.planners.improve.polish import merged
from pushplan.planners.problem.objective import GAIN
from pushplan.planners.problem.problem import remaining
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray


class NearestApproach:
    """The free path that ends nearest to the goal.

    Args:
        start: (3,) pose where paths begin.
        goal: (3,) pose.

    Attributes:
        arcs: (k, 4) its twists and lengths; none at first, so that it ends at the start.
        left: Lower bound on the cost from its end to the goal, m.
    """

    def __init__(self, start: FloatArray, goal: FloatArray) -> None:
        self._goal = goal
        self.arcs, self.left = np.zeros((0, 4)), float(remaining(start[0], start[1], start[2], goal))

    def nearer(self, poses: FloatArray) -> int:
        """Return which of the poses (n, 3) is nearest to the goal, -1 where none is nearer than the path's end."""
        if len(poses) == 0:
            return -1
        left = self._left(poses)
        node = int(np.argmin(left))
        return node if left[node] < self.left - GAIN else -1

    def take(self, arcs: FloatArray, end: FloatArray) -> None:
        """Take over a free path (k, 4) that ends at a nearer pose (3,)."""
        self.arcs, self.left = merged(arcs), float(self._left(end[None])[0])

    def _left(self, poses: FloatArray) -> FloatArray:
        """Straight travel and the smallest turn from poses (n, 3) to the goal, (n,) m."""
        turn = np.abs(se2.wrap_angle(self._goal[2] - poses[:, 2]))
        away = np.hypot(self._goal[0] - poses[:, 0], self._goal[1] - poses[:, 1])
        return np.asarray(away + TURN_WEIGHT * turn)
