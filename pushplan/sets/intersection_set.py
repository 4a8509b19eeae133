"""The twists that two stable sets have in common."""

from __future__ import annotations

import numpy as np

from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


class IntersectionSet(StableSet):
    """Twists that are in both sets; it goes by the name of the first, and a margin is the smaller one of both.

    Args:
        first: The set that was asked for.
        second: A set of the same chain that limits it.
    """

    def __init__(self, first: StableSet, second: StableSet) -> None:
        super().__init__(first.chain)
        self.name = first.name
        self._sets = (first, second)

    @property
    def loads_known(self) -> bool:
        """Whether both sets know the loads."""
        return all(part.loads_known for part in self._sets)

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        first, second = (part.contact_margin_values(twists) for part in self._sets)
        return np.minimum(first, second)

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones."""
        first, second = (part.margin_values(twists, floor) for part in self._sets)
        return np.minimum(first, second)
