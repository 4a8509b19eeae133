"""The best path of a search so far, by price, and what it says of paths that could be better."""

from __future__ import annotations

import math

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.path import PushPath
from pushplan.planners.improve.polish import price
from pushplan.planners.problem.prices import Prices

GAIN = 1e-9
"""A path counts as better when its price is lower by this much."""

SHORTEST_ARC = 1e-10
"""Arcs below this (m of cost) are rounding and are left out of paths."""


def path_from(start: FloatArray, arcs: FloatArray) -> PushPath:
    """Return the path of arcs (k, 4) from a pose (3,)."""
    arcs = arcs[arcs[:, 3] > SHORTEST_ARC]
    return PushPath(start, arcs[:, :3], arcs[:, 3])


class Incumbent:
    """The best path so far.

    Args:
        prices: What makes one path better than another.

    Attributes:
        arcs: (k, 4) its twists and lengths, None while there is none.
        price: What it costs under the prices; infinite while there is none.
        cost: Its travel, m; infinite while there is none.
    """

    def __init__(self, prices: Prices) -> None:
        self._prices = prices
        self.arcs: FloatArray | None = None
        self.price = self.cost = math.inf

    @property
    def horizon(self) -> float:
        """Cost (m) from which on no path can be better; infinite while there is none.

        That is what its price would buy at the lowest rate, on a single arc.
        """
        return (self.price - self._prices.per_arc) / self._prices.lowest

    @property
    def bound(self) -> float:
        """Cost that a path has to stay below to be better, m."""
        return self.horizon - GAIN

    def price_of(self, arcs: FloatArray) -> float:
        """Return the price of a path (k, 4)."""
        return float(price(self._prices, arcs))

    def take(self, arcs: FloatArray) -> bool:
        """Keep a path (k, 4) if it is better; return whether it is."""
        offered = self.price_of(arcs)
        if offered >= self.price - GAIN:
            return False
        self.arcs, self.price, self.cost = arcs.copy(), offered, float(np.sum(arcs[:, 3]))
        return True
