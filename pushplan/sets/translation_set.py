"""Algorithm 3 of Harada et al. 2006: translations only.

A translation slides every object in one direction, so that the friction of the objects that a contact
carries acts at their centre of friction exactly: each contact allows a cone of directions.
"""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.sphere import Meridians, twists_at
from pushplan.sets.boundary.meridians import SMALLEST_GAP, RefinedMeridians
from pushplan.sets.cof_set import CofSet
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


class TranslationSet(StableSet):
    """Stable translations; no twist that turns is in the set.

    The margin of a translation is that of `ecof`. A twist that turns has at most minus the sine of its
    latitude on the twist sphere, so that the margin jumps at omega = 0. All CORs are at infinity.

    Args:
        chain: Objects and contacts.
        straight: Whose margins translations have; None stands for Algorithm 2, which is exact for them.

    Raises:
        SupportError: See `CofSet`.
    """

    name = "translation"

    def __init__(self, chain: Chain, straight: StableSet | None = None) -> None:
        super().__init__(chain)
        self._straight = CofSet(chain) if straight is None else straight

    @property
    def loads_known(self) -> bool:
        """Whether the load under every object is known, in its distribution and as a number."""
        return self._straight.loads_known

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        straight = twists * [1.0, 1.0, 0.0]
        moving = straight.any(axis=1)
        margins = np.full((len(twists), len(self.chain.contacts)), -1.0)
        margins[moving] = self._straight.contact_margin_values(straight[moving])
        turn = twists[:, 2] * self.chain.characteristic_length
        sine = np.abs(turn) / np.hypot(np.hypot(twists[:, 0], twists[:, 1]), turn)
        return np.where(turn[:, None] != 0.0, np.minimum(margins, -sine[:, None]), margins)

    def _find_meridians(self, longitude: FloatArray, minimum: float) -> Meridians:
        """Return latitude 0 as the whole interval wherever it is stable; there is nothing to search."""
        level = np.zeros_like(longitude)
        inside = self.margin_values(twists_at(longitude, level, self.chain.characteristic_length)) > minimum
        return Meridians(longitude[inside], level[inside], level[inside])

    def _refine_meridians(self, minimum: float) -> RefinedMeridians:
        longitude, cone = np.linspace(-np.pi, np.pi, 5), self.translation_cone(minimum)
        if cone is not None:
            right, left = np.arctan2(cone[:, 1], cone[:, 0])
            longitude = np.append(longitude, [right - SMALLEST_GAP, right, left, left + SMALLEST_GAP])
        longitude = np.unique(np.clip(longitude, -np.pi, np.pi))
        return RefinedMeridians(longitude, self._find_meridians(longitude, minimum))
