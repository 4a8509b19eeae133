"""A chain as stated, in the form from which its variants are made."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pushplan.mechanics.chain import PLATE, Chain
from pushplan.mechanics.friction.packed import PackedChain, pack_chain
from pushplan.mechanics.inertia import InertiaTable, inertia_table
from pushplan.sim.robustness.change_kernel import Variants, facet_values, floor_wrenches_of
from pushplan.sim.robustness.footing import Footing
from pushplan.sim.robustness.instants import Instants
from pushplan.util.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Model:
    """A chain on its way.

    Attributes:
        chain: All loads known.
        instants: Where its contacts are looked at.

    Raises:
        SupportError: When a load is not known.
    """

    chain: Chain
    instants: Instants

    @cached_property
    def packed(self) -> PackedChain:
        """The chain as arrays."""
        return pack_chain(self.chain)

    @cached_property
    def inertia(self) -> InertiaTable:
        """Mass properties."""
        return inertia_table(self.chain)

    @cached_property
    def ends(self) -> FloatArray:
        """(2, n, 2) right and left ends of the contacts, m."""
        return np.array([[c.right for c in self.chain.contacts], [c.left for c in self.chain.contacts]])

    @cached_property
    def carried(self) -> BoolArray:
        """(n, n) whether contact k carries object i."""
        found: BoolArray = np.eye(len(self.chain.contacts), dtype=np.bool_)
        for k in reversed(range(len(found))):
            pusher = self.chain.contacts[k].pusher
            if pusher != PLATE:
                found[pusher] |= found[k]
        return found

    def footing(self, i: int) -> Footing:
        """Return how the load of object i rests on the floor."""
        return self._footings[i]

    @cached_property
    def _footings(self) -> list[Footing]:
        return [Footing.of(obj, self.packed, i) for i, obj in enumerate(self.chain.objects)]

    @cached_property
    def stated(self) -> Variants:
        """The chain itself; every object counts as moved."""
        packed, n = self.packed, len(self.chain.objects)
        return Variants(
            packed.objects[None],
            packed.parts[None],
            packed.links,
            np.ones(n, dtype=np.bool_),
            np.tile([1.0, 0.0, 0.0, 0.0], (1, n, 1)),
            np.ascontiguousarray(self.inertia.center[None]),
            self.facets(self.ends[:, None]),
            np.ones(1),
        )

    @cached_property
    def floor_wrenches(self) -> FloatArray:
        """(m, n, 3) what moves each object against the floor."""
        return floor_wrenches_of(self.stated, self.packed.series, self.instants.directions)

    @cached_property
    def values(self) -> FloatArray:
        """(m, n, 4) the facets' values of the chain as stated."""
        return np.asarray(self._values(self.stated, self.instants, self.floor_wrenches)[0])

    @cached_property
    def slack(self) -> FloatArray:
        """(m,) least of `values` at each moment, per friction load that the contact carries: for ranking only."""
        loads = self.carried @ self.packed.objects[:, 0] + 1e-300
        return np.asarray((self.values / loads[:, None]).min(axis=(1, 2)))

    def facets(self, ends: FloatArray) -> FloatArray:
        """Return facets (q, n, 4, 3), see `mechanics.packed.contact_rows`, of contacts with ends (2, q, n, 2)."""
        right, left = ends
        tangent = (left - right) / np.linalg.norm(left - right, axis=-1, keepdims=True)
        normal = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)
        friction = np.array([contact.friction for contact in self.chain.contacts])[:, None]
        rows = np.zeros((*right.shape[:-1], 4, 3))
        rows[..., 0, :2], rows[..., 1, :2] = friction * normal - tangent, friction * normal + tangent
        rows[..., 2, 0], rows[..., 2, 1], rows[..., 2, 2] = -right[..., 1], right[..., 0], -1.0
        rows[..., 3, 0], rows[..., 3, 1], rows[..., 3, 2] = left[..., 1], -left[..., 0], 1.0
        return np.asarray(rows)

    def values_of(self, variants: Variants, which: IntArray) -> FloatArray:
        """Return the facets' values (q, k, n, 4) of variants at moments `which` (k,); all of them in order."""
        if len(which) == len(self.instants.group):
            return self._values(variants, self.instants, self.floor_wrenches)
        return self._values(variants, self.instants.chosen(which), self.floor_wrenches[which])

    def _values(self, variants: Variants, instants: Instants, wrenches: FloatArray) -> FloatArray:
        mass, _, moment = self.inertia
        return facet_values(variants, self.packed.series, mass, moment, instants, wrenches)
