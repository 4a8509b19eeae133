"""Sets for loads with a known centre but unknown distribution: STABLE of Lynch & Mason, and the exact worst case.

STABLE at every contact is described in section 4.4 of Harada et al. 2006. The objects that contact k carries are one
body, with the hull S of their supports and their common centre of friction g. Let v(x) = v + omega J x, and w = +1 at
the left end e of the contact and -1 at the right end. A COR is stable if

    (1)  gamma . v(x) > 0                    for both facets gamma of the friction cone and all corners x of S,
    (2)  w (g - e) x v(g) > w omega p^2 / 2  and
         w (g - e) x v(g) > -w omega r^2     for both ends, p = |g - e|, r = the largest |x - g| over S.

The boundaries of (1) are lines perpendicular to the edges of the friction cone that touch S. Those of (2) are lines
perpendicular to e - g, one through the middle of e and g, the other at r^2 / p from g on the far side. All
inequalities are linear in the twist.

If the pusher pushes at a height h above the floor, friction moves the centre to some g + n with |n| <= h mu. If loads
are intervals, g can be anywhere in a polygon. (2) must hold for all these centres. Its second inequality is concave
in n, so the corners of a polygon around all n suffice. The first inequality becomes linear in n because a term
|omega| |n|^2 / 2 > 0 is left out.
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
    """A set that does not need known loads; it uses the intervals of a chain if there are any."""

    def __init__(self, chain: Chain, interval: IntervalChain | None) -> None:
        super().__init__(chain)
        self._as_numbers = interval is None

    @property
    def loads_known(self) -> bool:
        """Whether every object's load and its distribution are known, without intervals."""
        return self._as_numbers and super().loads_known


class StableUnknownSet(_UnknownLoadSet):
    """Twists that STABLE accepts at every contact: a convex cone inside `robust`.

    The margin is the sine of the angle to the nearest boundary, which is a great circle of the twist sphere.

    Args:
        chain: Objects and contacts.
        interval: Chain with intervals of masses and floor frictions; all their centres of friction must satisfy (2).
            None for plain numbers.

    Raises:
        SupportError: If a push at the contact height can tip an object.
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
        center = 0.5 * (reached.min(axis=0) + reached.max(axis=0))  # not the mean, because rounding can add corners
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
        hull: Corners (h, 2) of the hull S of the supports behind the contact, m.
        center: Centre of friction g (2,) of these supports, m.
        offsets: Corners n (j, 2) of a polygon around g, relative to g, that contains all possible centres, m.
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
    """Twists whose friction wrenches all contacts can transmit for every pressure with the given centres.

    Feet carry any loads in balance, and any other support has any pressure on its convex hull. For a known load only
    the centre is used; intervals of load fractions are respected. Margins are conservative by at most `MISS`
    (`core/centred.hpp`).

    Args:
        chain: Objects and contacts.
        interval: Chain with intervals of masses, floor frictions and load fractions; None for plain numbers.

    Raises:
        SupportError: If a push at the contact height can tip an object.
    """

    name = "robust"

    def __init__(self, chain: Chain, interval: IntervalChain | None = None) -> None:
        super().__init__(chain, interval)
        self._packed = pack_centred(chain, interval)

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return Wrenches(*uncertain.rows_of(self._packed, twists)).margins

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); see `StableSet` for `floor`."""
        return uncertain.margins_of(self._packed, twists, float(floor))
