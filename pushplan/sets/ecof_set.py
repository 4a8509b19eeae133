"""Algorithm 1 of Harada et al. 2006: conditions on the exact friction wrench at each centre of rotation."""

from __future__ import annotations

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contacts.contact_kernel import contact_margins_of, margins_of, wrenches_of
from pushplan.mechanics.friction.packed import pack_chain
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


class EcofSet(StableSet):
    """Twists whose exact friction wrenches every contact can transmit.

    Attributes:
        packed: The chain as arrays, for `contact_kernel.margin` in compiled code.

    Raises:
        SupportError: When a load is not known, or a push at the contact height could lift a part of an
            object.
    """

    name = "ecof"

    def __init__(self, chain: Chain) -> None:
        super().__init__(chain)
        self.packed = pack_chain(chain)

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return contact_margins_of(self.packed, wrenches_of(self.packed, twists))

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones."""
        return margins_of(self.packed, twists, floor)
