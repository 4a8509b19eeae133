"""The exact worst case over all pressures with the given centre under every object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import pushplan.core.uncertain as uncertain
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.sphere import checked_twists
from pushplan.mechanics.uncertain import pack_centred
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray, frozen

CONDITIONS = ("sliding left", "sliding right", "tipping about the right end", "tipping about the left end")
"""What the facets of a contact's wrench cone prevent the pushed body from, in the order of `contact_rows`."""


@dataclass(frozen=True, eq=False)
class WorstCase:
    """The pressure that comes closest to breaking a contact, or breaks it most.

    Attributes:
        contact: Index of the contact.
        condition: What the pushed body would do there: one of `CONDITIONS`.
        margin: The contact's margin.
        points: For every object that the contact carries, by its index, its (k, 2) loaded points, k <= 3,
            chain frame, m.
        fractions: The (k,) parts of the object's load on them.
    """

    contact: int
    condition: str
    margin: float
    points: dict[int, FloatArray]
    fractions: dict[int, FloatArray]


class RobustSet(StableSet):
    """Twists that every pressure with the given centres lets all contacts transmit.

    Feet carry any loads that balance; any other support counts as its convex hull, with any pressure. A load
    that is known counts by its centre alone, load fractions in intervals as what they are. Margins err on the safe
    side, by at most `MISS` (`core/centred.hpp`).

    Args:
        chain: Objects and contacts.
        interval: The chain with intervals of masses, floor frictions and load fractions; None where they are numbers.

    Raises:
        SupportError: When a push at the contact height could tip an object.
    """

    name = "robust"

    def __init__(self, chain: Chain, interval: IntervalChain | None = None) -> None:
        super().__init__(chain)
        self._as_numbers = interval is None
        self._packed = pack_centred(chain, interval)

    @property
    def loads_known(self) -> bool:
        """Whether the load under every object is known, in its distribution and as a number."""
        return self._as_numbers and super().loads_known

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return uncertain.contact_margins_of(self._packed, twists)

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones."""
        return uncertain.margins_of(self._packed, twists, float(floor))

    def worst_case(self, twist: ArrayLike) -> WorstCase:
        """Return the pressure that determines the margin at a body twist (3,) in the chain frame.

        Raises:
            PushplanError: On a twist that is zero, not finite or not (3,).
        """
        v = checked_twists(np.asarray(twist, dtype=np.float64)[None])
        margins = self.contact_margin_values(v)[0]
        k = int(margins.argmin())
        found = [uncertain.worst_spreads(self._packed, v[0], k, j) for j in range(len(CONDITIONS))]
        j = int(np.argmin([values.sum() for values, _ in found]))
        carried = np.flatnonzero(self._packed.carried[k] & (self._packed.free > 0))
        spreads = {int(i): found[j][1][i] for i in carried}
        kept = {i: spread[spread[:, 2] > 1e-9] for i, spread in spreads.items()}
        return WorstCase(
            contact=k,
            condition=CONDITIONS[j],
            margin=float(margins[k]),
            points={i: frozen(part[:, :2], (None, 2), "points") for i, part in kept.items()},
            fractions={i: frozen(part[:, 2] / part[:, 2].sum(), (None,), "shares") for i, part in kept.items()},
        )
