"""A support model: a load on a ring, such as the rim of a bucket."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.mechanics.support import PointLoads, Support
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class RingSupport(Support):
    """An even load on a circle about the origin of the object's frame.

    Attributes:
        radius: m.
        count: Points that stand for the circle.
    """

    radius: float
    count: int = 24

    @property
    def center(self) -> FloatArray:
        """(2,) the circle's centre, m."""
        return np.zeros(2)

    @property
    def hull(self) -> FloatArray:
        """(count, 2) points of the circle, counter-clockwise, m."""
        angle = 2.0 * np.pi * np.arange(self.count) / self.count
        return self.radius * np.column_stack([np.cos(angle), np.sin(angle)])

    @property
    def point_loads(self) -> PointLoads:
        """The same load on every point."""
        even = np.full(self.count, 1.0 / self.count)
        return PointLoads(self.hull, even, even)
