"""Pressures with given centres, and twists where they matter."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.optimize import linprog

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.support import FeetSupport, Support
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True)
class Pressures:
    """Puts random pressures with the centres they have under the objects of a chain."""

    rng: np.random.Generator

    def on_points(self, chain: Chain) -> Chain:
        """Return the chain on a few points of the hulls of its supports."""
        objects = (replace(obj, support=self._few_points(obj.support)) for obj in chain.objects)
        return replace(chain, objects=tuple(objects))

    def _few_points(self, support: Support) -> Support:
        """Mix of extreme pressures: basic solutions of `fractions @ points = center`, at most three points each."""
        points = self._points_in(support.hull, 12)
        fractions = np.zeros(len(points))
        equations = np.vstack([points.T, np.ones(len(points))])
        for share in self.rng.dirichlet(np.full(int(self.rng.integers(1, 4)), 1.0)):
            cost = self.rng.normal(size=len(points))
            solution = linprog(cost, A_eq=equations, b_eq=[*support.center, 1.0], method="highs")
            assert solution.x is not None, solution.message
            fractions += share * np.maximum(solution.x, 0.0)
        kept = fractions > 1e-9
        return FeetSupport(points[kept], fractions[kept] / fractions[kept].sum())

    def _points_in(self, hull: FloatArray, count: int) -> FloatArray:
        """Corners of the hull, points on its edges and points inside."""
        along = self.rng.uniform(size=(count, 1))
        edge = self.rng.integers(len(hull), size=count)
        on_edges = along * hull[edge] + (1.0 - along) * hull[edge - 1]
        inside = self.rng.dirichlet(np.full(len(hull), 0.7), size=count) @ hull
        return np.concatenate([hull, on_edges, inside])


@pytest.fixture
def pressures() -> Pressures:
    """Return a maker of random pressures."""
    return Pressures(np.random.default_rng(7))
