"""The best path of a search so far, by its objective, and what it says of paths that could be better."""

from __future__ import annotations

import math

import numpy as np

from pushplan.planners.improve.polish import objective_value
from pushplan.planners.problem.objective import GAIN, Objective
from pushplan.plans.path import PushPath
from pushplan.util.arrays import FloatArray

SHORTEST_ARC = 1e-10
"""Arcs below this (m of cost) are rounding and are left out of paths."""


def path_from(start: FloatArray, arcs: FloatArray) -> PushPath:
    """Return the path of arcs (k, 4) from a pose (3,)."""
    arcs = arcs[arcs[:, 3] > SHORTEST_ARC]
    return PushPath(start, arcs[:, :3], arcs[:, 3])


class Incumbent:
    """The best path so far.

    Args:
        objective: What makes one path better than another.

    Attributes:
        arcs: (k, 4) its twists and lengths, None while there is none.
        value: What the objective says of it; infinite while there is none.
        cost: Its travel, m; infinite while there is none.
    """

    def __init__(self, objective: Objective) -> None:
        self._objective = objective
        self.arcs: FloatArray | None = None
        self.value = self.cost = math.inf

    @property
    def horizon(self) -> float:
        """Cost (m) from which on no path can be better; infinite while there is none.

        That is what its value would buy at the lowest rate, on a single arc.
        """
        return (self.value - self._objective.per_arc) / self._objective.lowest

    @property
    def bound(self) -> float:
        """Cost that a path has to stay below to be better, m."""
        return self.horizon - GAIN

    def value_of(self, arcs: FloatArray) -> float:
        """Return the value of a path (k, 4)."""
        return float(objective_value(self._objective, arcs))

    def take(self, arcs: FloatArray) -> bool:
        """Keep a path (k, 4) if it is better; return whether it is."""
        offered = self.value_of(arcs)
        if offered >= self.value - GAIN:
            return False
        self.arcs, self.value, self.cost = arcs.copy(), offered, float(np.sum(arcs[:, 3]))
        return True
