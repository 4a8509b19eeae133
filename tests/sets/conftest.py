"""Pressures with given centres, and twists where they matter."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import shapely
from scipy.optimize import linprog

from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, Support
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True)
class Pressures:
    """Puts random pressures with the centres they have under the objects of a chain."""

    rng: np.random.Generator

    def on_points(self, chain: Chain) -> Chain:
        """Return the chain on a few points of the hulls of its supports."""
        return self._with(chain, lambda obj: self._few_points(obj.support))

    def spread(self, chain: Chain) -> Chain:
        """Return the chain on smooth pressure maps over the hulls of its supports."""
        return self._with(chain, lambda obj: self._map(obj.support))

    def _with(self, chain: Chain, support: Callable[[PushedObject], Support]) -> Chain:
        return replace(chain, objects=tuple(replace(obj, support=support(obj)) for obj in chain.objects))

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

    def _map(self, support: Support) -> Support:
        """Positive random pressure, tilted exponentially until it has the centre."""
        low, high = support.hull.min(axis=0), support.hull.max(axis=0)
        grid = np.stack(np.meshgrid(*(np.linspace(low[d], high[d], 25) for d in (0, 1))), axis=-1).reshape(
            -1, 2
        )
        area = shapely.Polygon(support.hull).buffer(1e-12)
        points = np.concatenate([grid[shapely.contains_xy(area, grid[:, 0], grid[:, 1])], support.hull])
        offsets = (points - support.center) / np.abs(high - low).max()
        log_pressure, tilt = self.rng.normal(size=len(points)) * 2.0, np.zeros(2)
        for _ in range(60):
            weights = np.exp(log_pressure + offsets @ tilt)
            weights /= weights.sum()
            mean = weights @ offsets
            tilt -= np.linalg.solve((offsets - mean).T @ ((offsets - mean) * weights[:, None]), mean) * 0.7
        return PressureMapSupport(points, weights)


@pytest.fixture
def pressures() -> Pressures:
    """Return a maker of random pressures."""
    return Pressures(np.random.default_rng(7))
