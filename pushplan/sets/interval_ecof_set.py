"""Algorithm 1 for all loads and frictions in given intervals; see `mechanics.uncertain_kernel` for the worst case.

A lower contact friction only takes away from the friction cone, so that the lowest one suffices.
"""

from __future__ import annotations

from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.uncertain import pack_intervals
from pushplan.mechanics.uncertain_kernel import contact_margins_of, margins_of
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


class IntervalEcofSet(StableSet):
    """Twists that are in the set `ecof` for all values in the intervals.

    The margin is the least row divided by an upper bound of |w_k|,

        |sum F_i w_i at the intervals' middles| + sum of half their widths times |w_i|:

    at most the margin for any of the values, and equal to it where all intervals are points. The set is exact but for
    pressures, where it errs on the safe side (see `uncertain_kernel`).

    Raises:
        SupportError: See `EcofSet`.
    """

    name = "ecof"

    def __init__(self, interval: IntervalChain) -> None:
        super().__init__(interval.chain)
        self._packed = pack_intervals(interval)

    @property
    def loads_known(self) -> bool:
        """False: the contact forces depend on the values."""
        return False

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return contact_margins_of(self._packed, twists)

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones."""
        return margins_of(self._packed, twists, float(floor))
