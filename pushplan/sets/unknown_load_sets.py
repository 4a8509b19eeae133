"""Sets for loads of which only the centre is known: STABLE of Lynch & Mason, and the exact worst case.

STABLE at every contact is section 4.4 of Harada et al. 2006. The objects that contact k carries count as one, with
the hull S of their supports and their common centre of friction g. With v(x) = v + omega J x and w = +1, -1 at the
left, right end e of the contact, all CORs are kept for which

    (1)  gamma . v(x) > 0                    for both facets gamma of the friction cone and all corners x of S,
    (2)  w (g - e) x v(g) > w omega p^2 / 2  and
         w (g - e) x v(g) > -w omega r^2     for both ends, p = |g - e|, r = the largest |x - g| over S.

(1) are lines perpendicular to the edges of the friction cone that touch S, (2) lines perpendicular to e - g
through the middle of e and g, and at r^2 / p from g on the far side. All are linear in the twist.

When the pusher pushes at a height h above the floor, friction moves the centre to some g + n, |n| <= h mu,
and when loads are only known as intervals, g may lie anywhere in a polygon; (2) has to hold for all of these.
The second inequality is concave in n, so the corners of a polygon around all n suffice; the first one is kept
linear in n by leaving out a term |omega| |n|^2 / 2 > 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import pushplan.core.uncertain as uncertain
from pushplan.geometry.polygon import convex_hull
from pushplan.mechanics.chain import Chain, Contact
from pushplan.mechanics.contacts import carried_objects, center_range
from pushplan.mechanics.dynamics import Wrenches
from pushplan.mechanics.heights import load_areas
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.packed import contact_rows
from pushplan.mechanics.uncertain import pack_centred
from pushplan.sets.cor import Window, cor_polygon, smallest_sines, unit_rows, velocity_rows
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_SIDES = 12


class _UnknownLoadSet(StableSet):
    """A set that asks for nothing of loads but what a chain with intervals states of them, if there is one."""

    def __init__(self, chain: Chain, interval: IntervalChain | None) -> None:
        super().__init__(chain)
        self._as_numbers = interval is None

    @property
    def loads_known(self) -> bool:
        """Whether the load under every object is known, in its distribution and as a number."""
        return self._as_numbers and super().loads_known


class StableUnknownSet(_UnknownLoadSet):
    """Twists that STABLE accepts at every contact: a convex cone inside `robust`.

    The margin is the sine of the angle, on the twist sphere, to the nearest of the great circles above.

    Args:
        chain: Objects and contacts.
        interval: The chain with intervals of masses and floor frictions; all centres of friction that these allow
            have to satisfy (2). None where they are numbers.

    Raises:
        SupportError: If a push at the contact height could tip an object.
    """

    name = "stable"

    def __init__(self, chain: Chain, interval: IntervalChain | None = None) -> None:
        super().__init__(chain, interval)
        rows = _chain_rows(chain, interval)
        self._owner = np.repeat(np.arange(len(rows)), [len(part) for part in rows])
        self._rows = np.concatenate(rows)

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return smallest_sines(self._rows, self._owner, twists, self.chain.characteristic_length)

    def cor_region(self, sense: int = +1, window: Window | None = None) -> BaseGeometry:
        """Return the stable centres of rotation of one sense, an exact convex polygon; see `StableSet`."""
        return cor_polygon(self._rows, self.chain.characteristic_length, sense, window)


def _chain_rows(chain: Chain, interval: IntervalChain | None) -> list[FloatArray]:
    """Return the unit rows (m, 3) of every contact."""
    areas, length = load_areas(chain, interval), chain.characteristic_length
    loads = np.array([[obj.friction_load, obj.friction_load] for obj in chain.objects])
    if interval is not None:
        loads = interval.loads
    centers, rows = np.array([area.center for area in areas]), []
    for contact, behind in zip(chain.contacts, carried_objects(chain), strict=True):
        members = np.flatnonzero(behind)
        hull = convex_hull(np.concatenate([areas[i].points for i in members]))
        reached = center_range(loads[members], centers[members])
        center = 0.5 * (reached.min(axis=0) + reached.max(axis=0))  # not their mean: rounding may add corners
        shifts = _around(max(areas[i].reach for i in members))
        offsets = convex_hull((reached - center + shifts[:, None]).reshape(-1, 2))
        moving = float(loads[members, 1].sum() > 0.0)
        rows.append(moving * contact_conditions(contact, hull, center, offsets, length))
    return rows


def contact_conditions(
    contact: Contact, hull: FloatArray, center: FloatArray, offsets: FloatArray, length: float
) -> FloatArray:
    """Return the unit rows (m, 3) of the inequalities (1) and (2) for one contact.

    Args:
        contact: The contact.
        hull: (h, 2) corners of the hull S of everything behind it that may carry load, m.
        center: (2,) centre of friction g of that, m.
        offsets: (j, 2) corners n of a polygon around all places g + n where the centre may be, m.
        length: Characteristic length, m.
    """
    facets = contact_rows(contact, length)[:2, None, :2]
    parts = [velocity_rows(facets, hull[None], length).reshape(-1, 3)]
    for end, side in ((contact.right, -1.0), (contact.left, +1.0)):
        parts.append(_moment_rows(end, side, center, hull, offsets, length))
    return unit_rows(np.concatenate(parts), length)


def _moment_rows(
    end: FloatArray, side: float, center: FloatArray, hull: FloatArray, offsets: FloatArray, length: float
) -> FloatArray:
    """Return the rows (2 m, 3) of the inequalities (2) at one end, for each of the offsets n (m, 2)."""
    arm = center - end + offsets
    turned = side * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    moment = velocity_rows(turned, np.broadcast_to(center, arm.shape), length)
    far = np.linalg.norm(hull[None] - center - offsets[:, None], axis=2).max(axis=1)
    near_turn = -0.5 * side * ((center - end) ** 2).sum()
    far_turn = side * ((arm * offsets).sum(axis=1) + far**2)
    near, beyond = moment.copy(), moment.copy()
    near[:, 2] += near_turn / length
    beyond[:, 2] += far_turn / length
    return np.concatenate([near, beyond])


def _around(shift: float) -> FloatArray:
    """Return the corners (m, 2) of a polygon around the disc with radius `shift`; the origin for 0."""
    if shift == 0.0:
        return np.zeros((1, 2))
    angle = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.asarray(shift / np.cos(np.pi / _SIDES) * corners, dtype=np.float64)


class RobustSet(_UnknownLoadSet):
    """Twists that every pressure with the given centres lets all contacts transmit.

    Feet carry any loads that balance; any other support counts as its convex hull, with any pressure. A load
    that is known counts by its centre alone, load fractions in intervals as what they are. Margins err on the safe
    side, by at most `MISS` (`core/centred.hpp`).

    Args:
        chain: Objects and contacts.
        interval: The chain with intervals of masses, floor frictions and load fractions; None where they are numbers.

    Raises:
        SupportError: If a push at the contact height could tip an object.
    """

    name = "robust"

    def __init__(self, chain: Chain, interval: IntervalChain | None = None) -> None:
        super().__init__(chain, interval)
        self._packed = pack_centred(chain, interval)

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return Wrenches(*uncertain.rows_of(self._packed, twists)).margins

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones."""
        return uncertain.margins_of(self._packed, twists, float(floor))
