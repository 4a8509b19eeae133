"""Stable sets of chains with known loads (ecof, cof and translation), and intersections of sets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import pushplan.core.contacts as contacts
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.mechanics.contacts import carried_objects, cof, common_centers
from pushplan.mechanics.packed import pack_chain
from pushplan.mechanics.sphere import Meridians, twists_at
from pushplan.sets.boundary import SMALLEST_GAP, RefinedMeridians
from pushplan.sets.cor import Window, cor_polygon, unit_rows, velocity_rows
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


HELP = "more friction there, a wider contact, or fewer objects"
"""Remedies for a contact that does not hold."""


def weakest_contact(stable: StableSet, twist: FloatArray) -> int:
    """Return the index of the contact with the smallest margin under a body twist (3,)."""
    return int(np.argmin(stable.contact_margins(twist[None])[0]))


def contact_words(chain: Chain, index: int) -> str:
    """Return a phrase with the two bodies of a contact, for messages."""
    contact = chain.contacts[index]
    pushed = f"'{chain.objects[contact.pushed].name}'"
    where = "the plate" if contact.pusher == PLATE else f"'{chain.objects[contact.pusher].name}'"
    return f"{pushed} on {where}"


def emptiness(stable: StableSet, minimum: float) -> tuple[str, int | None]:
    """Return the reason why no push has a margin above a minimum.

    Returns:
        The reason, empty if a push has such a margin, and the index of the contact that does not hold. The index is
        None if all contacts hold, but with too small a margin.
    """
    twists, margins = stable.peaks
    best = float(margins.max(initial=-1.0))
    if best > minimum:
        return "", None
    if best > 0.0:
        return (f"no push has a margin above {minimum:.3g}; allowed: less than {best:.3g}, the largest margin", None)
    at_best = f" (the largest margin is {best + 0.0:.3g})" if len(margins) else ""
    weakest = weakest_contact(stable, twists[margins.argmax()]) if len(margins) else 0
    names = contact_words(stable.chain, weakest)
    what = f"the stable set is empty: no push keeps the contact of {names} and all others{at_best}"
    return f"{what}; allowed: {HELP}", weakest


class IntersectionSet(StableSet):
    """Intersection of two sets, with the name of the first; a margin is the smaller of both margins.

    Args:
        first: The main set.
        second: A set of the same chain that limits it.
    """

    def __init__(self, first: StableSet, second: StableSet) -> None:
        super().__init__(first.chain)
        self.name = first.name
        self._sets = (first, second)

    @property
    def loads_known(self) -> bool:
        """Whether both sets know the loads."""
        return all(part.loads_known for part in self._sets)

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        first, second = (part.contact_margin_values(twists) for part in self._sets)
        return np.minimum(first, second)

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); see `StableSet` for `floor`."""
        first, second = (part.margin_values(twists, floor) for part in self._sets)
        return np.minimum(first, second)


class EcofSet(StableSet):
    """Twists whose exact friction wrenches every contact can transmit.

    Attributes:
        packed: The chain as arrays for the core.

    Raises:
        SupportError: If a load is not known, or a push at the contact height can lift a part of an object.
    """

    name = "ecof"

    def __init__(self, chain: Chain) -> None:
        super().__init__(chain)
        self.packed = pack_chain(chain)

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return contacts.contact_margins_of(self.packed, contacts.wrenches_of(self.packed, twists))

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); see `StableSet` for `floor`."""
        return contacts.margins_of(self.packed, twists, floor)


class CofSet(StableSet):
    """Twists that are stable by Algorithm 2, which is exact for far CORs and approximate for near ones.

    The margin is that of the approximate wrench. A twist about a COF, for which the force has no direction, has the
    margin 0 at that contact.

    Attributes:
        centers: Centres of friction (n, 2) of the objects that each contact carries, in the chain frame, m.

    Raises:
        SupportError: If a load is not known, or a push at the contact height can lift a part of an object. The height
            has no other effect, because it shifts the load along the line of action.
    """

    name = "cof"

    def __init__(self, chain: Chain) -> None:
        super().__init__(chain)
        self._packed = pack_chain(chain)
        self._loads = carried_objects(chain) @ np.array([obj.friction_load for obj in chain.objects])
        loads = np.array([obj.friction_load for obj in chain.objects])
        self.centers = common_centers(carried_objects(chain), loads, np.array([cof(o) for o in chain.objects]))

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return contacts.contact_margins_of(self._packed, self._wrenches(twists))

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
        """Return the wrenches (k, n, 3) of the contacts: the force F_k u and its moment about the origin."""
        scale = np.abs(twists * [1.0, 1.0, self.chain.characteristic_length]).max(axis=1)
        v = (twists / scale[:, None])[:, None, :]
        x, y = self.centers.T
        vx, vy = v[..., 0] - v[..., 2] * y, v[..., 1] + v[..., 2] * x
        speed = np.hypot(vx, vy)
        size = np.where(speed > 0.0, self._loads / np.where(speed > 0.0, speed, 1.0), 0.0)
        fx, fy = size * vx, size * vy
        return np.stack([fx, fy, x * fy - y * fx], axis=-1)


class TranslationSet(StableSet):
    """Stable translations; twists with a rotation are not in the set.

    The margin of a translation is that of `ecof`. The margin of a twist that turns is at most minus the sine of its
    latitude on the twist sphere, so the margin is discontinuous at omega = 0. All CORs are at infinity.

    Args:
        chain: Objects and contacts.
        straight: Set that provides the margins of translations; None for Algorithm 2, which is exact for them.

    Raises:
        SupportError: See `CofSet`.
    """

    name = "translation"

    def __init__(self, chain: Chain, straight: StableSet | None = None) -> None:
        super().__init__(chain)
        self._straight = CofSet(chain) if straight is None else straight

    @property
    def loads_known(self) -> bool:
        """Whether every object's load and its distribution are known, without intervals."""
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
        """Return the interval [0, 0] at every longitude where latitude 0 is stable; no search is needed."""
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
