"""A stable set of the friction cones without tight turns."""

from __future__ import annotations

import numpy as np

from pushplan import Chain, StableSet, stable_set
from pushplan.util.arrays import FloatArray


class WideTurnsSet(StableSet):
    """Stable set without turns about centres nearer than `RADIUS`, m."""

    name = "wide-turns"
    RADIUS = 0.5

    def __init__(self, chain: Chain) -> None:
        super().__init__(chain)
        self.exact = stable_set(chain, "ecof")

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margins (k, n), at most the angle by which a turn is wider than necessary."""
        v, turn = np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])
        wide = np.arctan2(v, turn) - np.arctan(self.RADIUS)
        return np.asarray(np.minimum(self.exact.contact_margin_values(twists), wide[:, None]))
