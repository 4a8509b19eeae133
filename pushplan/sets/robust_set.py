"""The exact worst case over all pressures with the given centre under every object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.sphere import checked_twists
from pushplan.mechanics.worst_case.envelope_kernel import start_twist, worst_loads
from pushplan.mechanics.worst_case.packed_areas import pack_areas
from pushplan.mechanics.worst_case.robust_kernel import (
    PackedAreas,
    robust_contact_margins_of,
    robust_margins_of,
)
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
    that is known counts by its centre alone. Margins err on the safe side, by rounding.

    Args:
        chain: Objects and contacts.
        loads: (n, 2) least and largest friction load mu m g of every object, N; without it, what they say.

    Raises:
        SupportError: When a push at the contact height could tip an object.
    """

    name = "robust"

    def __init__(self, chain: Chain, loads: FloatArray | None = None) -> None:
        super().__init__(chain)
        self._as_numbers = loads is None
        self._areas = pack_areas(chain, loads)

    @property
    def loads_known(self) -> bool:
        """Whether the load under every object is known, in its distribution and as a number."""
        return self._as_numbers and super().loads_known

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return robust_contact_margins_of(self._scratch(), twists)

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones."""
        return robust_margins_of(self._scratch(), twists, float(floor))

    def worst_case(self, twist: ArrayLike) -> WorstCase:
        """Return the pressure that determines the margin at a body twist (3,) in the chain frame.

        Raises:
            PushplanError: On a twist that is zero, not finite or not (3,).
        """
        v = checked_twists(np.asarray(twist, dtype=np.float64)[None])
        margins = self.contact_margin_values(v)[0]
        k = int(margins.argmin())
        scaled = v[0] / np.abs(v[0] * [1.0, 1.0, self._areas.length]).max()
        loads = [self._loads_of(k, j, scaled) for j in range(len(CONDITIONS))]
        j = int(np.argmin([total for total, _ in loads]))
        kept = {i: part[part[:, 4] > 1e-9] for i, part in loads[j][1].items()}
        return WorstCase(
            contact=k,
            condition=CONDITIONS[j],
            margin=float(margins[k]),
            points={i: frozen(part[:, :2], (None, 2), "points") for i, part in kept.items()},
            fractions={
                i: frozen(part[:, 4] / part[:, 4].sum(), (None,), "shares") for i, part in kept.items()
            },
        )

    def _loads_of(self, k: int, j: int, twist: FloatArray) -> tuple[float, dict[int, FloatArray]]:
        """Return row j of contact k in its worst case, N, and the worst loads (3, 5) of the objects behind it."""
        total, worst = 0.0, {}
        for i in np.flatnonzero(self._areas.carried[k]):
            table, out = self._areas.tables[i].copy(), np.empty((3, 5))
            vx, vy, omega = twist
            start_twist(table, vx, vy, omega)
            gamma_x, gamma_y, kappa = self._areas.facets[k, j]
            least = worst_loads(table, gamma_x, gamma_y, kappa, out)
            total += float((self._areas.loads[i] * least).min())
            worst[int(i)] = out
        return total, worst

    def _scratch(self) -> PackedAreas:
        return self._areas._replace(tables=self._areas.tables.copy())
