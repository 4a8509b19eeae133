"""Algorithm 1 for all loads and frictions in given intervals; see `interval_rows` for the worst case.

A lower contact friction only takes away from the friction cone, so that the lowest one suffices.
"""

from __future__ import annotations

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.mechanics.worst_case.interval_chain import IntervalChain
from pushplan.mechanics.worst_case.interval_rows import IntervalRows
from pushplan.stable_sets.stable_set import StableSet

_MANY = 500
"""Twists from which on it pays to look at them without errors of the pressure first."""


class IntervalEcofSet(StableSet):
    """Twists that are in the set `ecof` for all values in the intervals.

    The margin is the least row divided by an upper bound of |w_k|,

        |sum F_i w_i at the intervals' middles| + sum of half their widths times |w_i|:

    at most the margin for any of the values, and equal to it where all intervals are points. The set is exact but for
    pressures, where it errs on the safe side (see `pressure_error`).

    Raises:
        SupportError: See `EcofSet`.
    """

    name = "ecof"

    def __init__(self, interval: IntervalChain) -> None:
        super().__init__(interval.chain)
        self._rows = IntervalRows(interval)

    @property
    def loads_known(self) -> bool:
        """False: the contact forces depend on the values."""
        return False

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return self._margins(twists, pressures=True)

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones.

        Errors of the pressure only take away, so that they are left out where the margin is too small without.
        """
        if not self._rows.has_pressures or len(twists) < _MANY:
            return np.asarray(self._margins(twists, pressures=True).min(axis=1), dtype=np.float64)
        margins = np.asarray(self._margins(twists, pressures=False).min(axis=1), dtype=np.float64)
        near = np.flatnonzero(margins > floor)
        if len(near):
            margins[near] = self._margins(twists[near], pressures=True).min(axis=1)
        return margins

    def _margins(self, twists: FloatArray, pressures: bool) -> FloatArray:
        least, size = self._rows.least(twists, pressures)
        moving = size > 0.0
        return np.where(moving, least.min(axis=2) / np.where(moving, size, 1.0), 0.0)
