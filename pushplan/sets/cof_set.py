"""Algorithm 2 of Harada et al. 2006: friction acts at the centre of friction (COF), whatever the rotation.

The friction of the objects that contact k carries is taken as one force at their common COF G_k, against that
point's velocity v(G_k) = v + omega J G_k. The contact then has to transmit F_k (u, G_k x u), u = v / |v|: its
conditions are linear in the twist, and the allowed CORs of either sense are a wedge with its apex at G_k.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contacts.carried import carried_objects, common_centers
from pushplan.mechanics.contacts.contact_kernel import contact_margins_of
from pushplan.mechanics.contacts.friction import cof
from pushplan.mechanics.friction.packed import pack_chain
from pushplan.sets.cor.cor_region import Window
from pushplan.sets.cor.half_spaces import cor_polygon, unit_rows, velocity_rows
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


class CofSet(StableSet):
    """Twists that Algorithm 2 calls stable: the exact set for far CORs, an approximation for near ones.

    The margin is that of the approximated wrench. A twist about a COF, where the force has no direction, has
    margin 0 at that contact.

    Attributes:
        centers: (n, 2) centre of friction of the objects that each contact carries, chain frame, m.

    Raises:
        SupportError: When a load is not known, or a push at the contact height could lift a part of an
            object. That height changes nothing else: it moves the load along the line of action.
    """

    name = "cof"

    def __init__(self, chain: Chain) -> None:
        super().__init__(chain)
        self._packed = pack_chain(chain)
        self._loads = carried_objects(chain) @ np.array([obj.friction_load for obj in chain.objects])
        loads = np.array([obj.friction_load for obj in chain.objects])
        self.centers = common_centers(
            carried_objects(chain), loads, np.array([cof(o) for o in chain.objects])
        )

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return contact_margins_of(self._packed, self._wrenches(twists))

    def cor_region(self, sense: int = +1, window: Window | None = None) -> BaseGeometry:
        """Return the stable centres of rotation of one sense, an exact convex polygon; see `StableSet`."""
        length = self.chain.characteristic_length
        facets = self._packed.rows
        lever = facets[..., 2:] / length
        arms = self.centers[:, None, :]
        forces = facets[..., :2] + lever * np.stack([-arms[..., 1], arms[..., 0]], axis=-1)
        rows = velocity_rows(forces, arms, length).reshape(-1, 3)
        moving = np.repeat(self._loads > 0.0, 4)
        return cor_polygon(unit_rows(np.where(moving[:, None], rows, 0.0), 1.0), length, sense, window)

    def _wrenches(self, twists: FloatArray) -> FloatArray:
        """Return the wrenches (k, n, 3) that the contacts transmit: F_k u and its moment about the origin."""
        scale = np.abs(twists * [1.0, 1.0, self.chain.characteristic_length]).max(axis=1)
        v = (twists / scale[:, None])[:, None, :]
        x, y = self.centers.T
        vx, vy = v[..., 0] - v[..., 2] * y, v[..., 1] + v[..., 2] * x
        speed = np.hypot(vx, vy)
        size = np.where(speed > 0.0, self._loads / np.where(speed > 0.0, speed, 1.0), 0.0)
        fx, fy = size * vx, size * vy
        return np.stack([fx, fy, x * fy - y * fx], axis=-1)
