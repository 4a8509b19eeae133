"""The load under an outline in three numbers: a heavier border, and two tilts.

Even pressure under flat plates is the exception: edges wear and bend, so that part of the load moves to the border,
and the centre of the load is seldom the centroid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.sim.physics.model.feet import feet_of
from pushplan.util.arrays import FloatArray

MOST_BORDER = 0.95
MOST_TILT = 0.45
"""Two tilts together leave a tenth of the pressure at the worst corner."""
_LEAST = 1e-4
"""Part of the mean load that every point keeps, so that the same points carry whatever the numbers are."""


@dataclass(frozen=True, eq=False)
class PressedOutline:
    """Points inside and along an outline, and their loads for a border and tilts.

    Attributes:
        points: (k, 2) in the object's own frame, m.
        inside: (k,) loads without a border, summing to 1.
        edge: (k,) loads of a border that carries everything, summing to 1.
        across: (k, 2) where the points are, from -1 to 1 over the outline's extent along x and y.
    """

    points: FloatArray
    inside: FloatArray
    edge: FloatArray
    across: FloatArray

    @classmethod
    def from_outline(
        cls, outline: FloatArray, support: Support | None = None, degree: int = 5, marks: int = 24
    ) -> PressedOutline:
        """Return the points of an outline.

        Args:
            outline: (v, 2) m.
            support: What is pressed without border and tilts; None for even pressure.
            degree: Up to which the points inside have the moments of that pressure.
            marks: Number of points along the outline.
        """
        within = feet_of(support or UniformSupport(outline), degree)
        ring = shapely.LinearRing(outline)
        places = shapely.line_interpolate_point(ring, (np.arange(marks) + 0.5) / marks, normalized=True)
        points = np.concatenate([within.positions, shapely.get_coordinates(places)])
        middle, half = 0.5 * (outline.max(axis=0) + outline.min(axis=0)), 0.5 * np.ptp(outline, axis=0)
        inside = np.concatenate([within.fractions, np.zeros(marks)])
        edge = np.concatenate([np.zeros(len(within.fractions)), np.full(marks, 1.0 / marks)])
        return cls(points, inside, edge, (points - middle) / half)

    def loads(self, border: float, tilts: FloatArray) -> FloatArray:
        """Return the load on every point (k,), summing to 1.

        Args:
            border: Share of the load along the outline.
            tilts: (2,) by how much the pressure grows over half of the outline's extent, along x and y.
        """
        flat = (1.0 - border) * self.inside + border * self.edge
        loads = np.maximum(flat * (1.0 + self.across @ tilts), _LEAST / len(flat))
        return np.asarray(loads / loads.sum())

    def support(self, border: float, tilts: FloatArray) -> FeetSupport:
        """Return the points with their loads."""
        return FeetSupport(self.points, self.loads(border, tilts))
