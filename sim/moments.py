"""The moments of a motion that decide its robustness, and the contact conditions at them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

import pushplan.core.contacts as contacts
import pushplan.core.robustness as core
from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import Chain, InertiaTable, inertia_table
from pushplan.mechanics.contacts import carried_objects
from pushplan.mechanics.packed import contact_facets, pack_chain, pack_objects
from pushplan.mechanics.perturb import contact_ends
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

SAME = 1e-11
"""Difference up to which two directions, or a rate and its part along the twist, count as the same."""

STANDSTILL = 1e-30
"""Squared speed of a motion without inertia that still has a direction, m^2/s^2."""


class Moments(NamedTuple):
    """Moments of a motion, in the chain frame.

    Attributes:
        directions: Twists over max(|v_x|, |v_y|, |omega| length), (m, 3); floor friction depends on these only.
        twists: Twists, m/s, rad/s, (m, 3).
        rates: Time derivatives of the twists, m/s^2, rad/s^2, (m, 3).
        group: Group index, equal for neighbours of the same direction, (m,).
    """

    directions: FloatArray
    twists: FloatArray
    rates: FloatArray
    group: IntArray

    def at(self, which: IntArray) -> Moments:
        """Return the moments with indices `which` (k,)."""
        return Moments(self.directions[which], self.twists[which], self.rates[which], self.group[which])


def thinned(twists: FloatArray, rates: FloatArray, length: float) -> Moments:
    """Return the moments of a motion that can be the worst ones for any chain.

    Along an arc of constant twist V = s' xi every contact condition is linear in (s'', s'^2). Its minimum over the
    samples of the arc is therefore at a corner of their convex hull in that plane. The origin (no inertia) is one of
    the points, because the motion can also be slower.

    Args:
        twists: Nonzero body twists, m/s, rad/s, (m, 3).
        rates: Time derivatives of the twists, (m, 3).
        length: Characteristic length of the chain, m.
    """
    size = np.abs(twists * [1.0, 1.0, length]).max(axis=1)
    directions = twists / size[:, None]
    acceleration = (rates * directions).sum(axis=1) / (directions**2).sum(axis=1)
    astray = np.abs(rates - acceleration[:, None] * directions).max(axis=1)
    along = astray <= SAME * np.maximum(1.0, np.abs(acceleration))
    alike = (np.abs(np.diff(directions, axis=0)).max(axis=1) <= SAME) & along[1:] & along[:-1]
    group = np.concatenate([[0], np.cumsum(~alike)]).astype(np.int64)
    first = np.flatnonzero(np.concatenate([[True], ~alike]))
    points = np.insert(np.stack([acceleration, size**2], axis=1), first, [0.0, STANDSTILL], axis=0)
    lines = shapely.linestrings(points, indices=np.insert(group, first, group[first]))
    corners, which = shapely.get_coordinates(shapely.convex_hull(lines), return_index=True)
    unit = directions[first][which]
    found = corners[:, :1] * unit
    alone = ~along[first][which] & (corners[:, 1] > STANDSTILL)  # a moment outside of arcs is a group of its own
    found[alone] = rates[first[which[alone]]]
    return Moments(unit, np.sqrt(corners[:, 1:]) * unit, np.ascontiguousarray(found), which.astype(np.int64))


class Variants(NamedTuple):
    """Arrays of q perturbed chains; an array that is the same for all has a first axis of length 1.

    Attributes:
        objects: Array `objects` of a `PackedChain`, (q, n, 11).
        parts: Array `parts` of a `PackedChain`, (q, e, 5).
        links: Array `links` of a `PackedChain`.
        changed: Whether the floor friction of the object differs from that of the reference chain, (q, n).
        poses: Motions of the objects from their packed to their perturbed poses, (q, n, 3).
        centers: Centres of mass before that motion, m, (q, n, 2).
        facets: Facets of the contact cones, (q, n, 4, 3); a contact holds if all facets . (f_x, f_y, m) are > 0.
        exist: Whether the chain is valid, (q,): every contact has a length, every load is positive.
    """

    objects: FloatArray
    parts: FloatArray
    links: IntArray
    changed: BoolArray
    poses: FloatArray
    centers: FloatArray
    facets: FloatArray
    exist: BoolArray


@dataclass(frozen=True, eq=False)
class ChainMotion:
    """A chain with known loads, and the moments at which its contacts must hold.

    Raises:
        SupportError: If a load is not known.
    """

    chain: Chain
    moments: Moments

    @cached_property
    def packed(self) -> contacts.PackedChain:
        """Arrays of the chain."""
        return pack_chain(self.chain)

    @cached_property
    def inertia(self) -> InertiaTable:
        """Mass properties of the objects."""
        return inertia_table(self.chain)

    @cached_property
    def itself(self) -> Variants:
        """The nominal chain as one variant."""
        n, packed = len(self.chain.objects), self.packed
        objects, parts = packed.objects[None], packed.parts[None]
        still, every = np.zeros((1, n, 3)), np.ones((1, n), dtype=np.bool_)
        centers = np.ascontiguousarray(self.inertia.center[None])
        friction = np.array([contact.friction for contact in self.chain.contacts])
        facets = contact_facets(self.ends[None, :, 0], self.ends[None, :, 1], friction, 1.0)
        return Variants(objects, parts, packed.links, every, still, centers, facets, np.ones(1, np.bool_))

    @cached_property
    def _floor(self) -> FloatArray:
        """Wrenches that move each object against the floor, (m, n, 3)."""
        return core.floor_wrenches(self.itself, self.packed.series, self.moments.directions)

    @cached_property
    def nominal(self) -> FloatArray:
        """Facet values of the nominal chain, (m, n, 4)."""
        return np.asarray(self.values_of(self.itself._replace(changed=~self.itself.changed), None)[0])

    @cached_property
    def order(self) -> IntArray:
        """Indices of the moments, weakest first (smallest facet value over the carried friction load), (m,)."""
        loads = carried_objects(self.chain) @ self.packed.objects[:, 0] + 1e-300
        return np.argsort((self.nominal / loads[:, None]).min(axis=(1, 2)), kind="stable")

    def values_of(
        self, variants: Variants, which: IntArray | None, masses: FloatArray | None = None, about_last: bool = False
    ) -> FloatArray:
        """Return the facet values (q, k, n, 4), N and N m.

        Args:
            variants: Perturbed chains.
            which: Indices of moments, (k,); None for all.
            masses: Factors of the inertial masses, (q, n); None for 1.
            about_last: Whether `changed` compares with the last variant instead of the nominal chain.
        """
        moments = self.moments if which is None else self.moments.at(which)
        if about_last:
            floor = core.floor_wrenches(variants, self.packed.series, moments.directions)
        else:
            floor = self._floor if which is None else self._floor[which]
        mass, _, moment = self.inertia
        factor = np.ones((1, len(mass))) if masses is None else masses
        return core.facet_values(variants, self.packed.series, factor * mass, factor * moment, moments, floor)

    @cached_property
    def ends(self) -> FloatArray:
        """Right and left end of every contact, m, (n, 2, 2)."""
        return contact_ends(self.chain)

    def most_lean(self, index: int, axis: int) -> tuple[FloatArray, float]:
        """Return the chain's x or y axis (2,) in an object's own frame, and the largest load shift both ways."""
        obj = self.chain.objects[index]
        direction = rotate(-float(obj.pose_chain[2]), np.eye(2)[axis])
        return direction, min(obj.support.most_lean(sense * direction) for sense in (1.0, -1.0))

    @cached_property
    def lean_slopes(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Derivatives of the packed arrays `objects`, `parts` and `centers` by each load's shift in x and y.

        The arrays are linear in the shift at floor level; for pushes above the floor the error is of second order.
        """
        packed, height = self.packed, self.chain.contact_height
        found: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        for i, obj in enumerate(self.chain.objects):
            begin, end = packed.links[i, 1:3]
            for axis in (0, 1):
                direction, most = self.most_lean(i, axis)
                step = 0.01 * min(1.0, most)
                apart = 2.0 * step or 1.0  # a load that cannot shift has a zero derivative
                leant = [replace(obj, support=obj.support.leaning(direction, s)) for s in (-step, step)]
                below, above = (pack_objects([one], height) for one in leant)
                objects, parts, centers = (
                    np.zeros_like(a) for a in (packed.objects, packed.parts, self.inertia.center)
                )
                objects[i] = (above.objects[0] - below.objects[0]) / apart
                parts[begin:end] = (above.parts - below.parts) / apart
                shift = leant[1].support.center - leant[0].support.center
                centers[i] = rotate(float(obj.pose_chain[2]), shift) / apart
                found.append((objects, parts, centers))
        return found
