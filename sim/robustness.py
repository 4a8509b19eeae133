"""How far numbers of a chain may be off on a plan: roots of the contact conditions of perturbed chains.

Each object in turn gets another floor friction, a load that leans, another place along its contact or another
heading (`mechanics.perturb`), in both senses; all at once are in `joint_robustness`. All conditions of all perturbed
chains at all moments are asked in one call; where they are polynomials of degree 2 in the size of the change the
first root is a formula, else it is bracketed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

import pushplan.core.contacts as contacts
import pushplan.core.robustness as core
from pushplan.geometry.polygon import SHORTEST_CONTACT
from pushplan.geometry.se2 import rotate, transform_points
from pushplan.mechanics.chain import Chain, InertiaTable, PushedObject, inertia_table
from pushplan.mechanics.contacts import carried_objects
from pushplan.mechanics.heights import is_pressed
from pushplan.mechanics.packed import contact_facets, pack_chain, pack_objects, push_room
from pushplan.mechanics.perturb import Motion, aside, contact_ends, turn
from pushplan.plans.robustness import MOST_ANGLE, MOST_SHARE, USED_UP, Robustness
from pushplan.plans.segment import Segment
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.joint_robustness import MOST_SCALE, ErrorBox, JointErrors
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

SAME = 1e-11
"""Difference up to which two directions, or a rate and its part along the twist, count as the same."""

WEAK = 32
"""Moments with the least to spare that bound a size before all are asked."""

SECTIONS, FINE_SECTIONS = 12, 48
"""Sizes that are asked at once: of the weak moments at first, then of those that lose a contact."""

CHECKS = 2
"""Sizes up to the one found at which every moment is asked; a loss that ends again between two of them is missed."""

FINE = 1e-6
"""Share of its size to which a root is found."""


def robustness_of(
    chain: Chain, trajectory: Trajectory, box: ErrorBox | None = None, least: Robustness | None = None
) -> Robustness:
    """Return how far numbers of `chain` may be off when it is pushed along `trajectory`.

    Looked at are the trajectory's samples, those that an execution checks, with the twist and the twist rate as
    commanded; where the pusher rests, the direction that comes next.

    Args:
        chain: The objects, their contacts on edges of both bodies.
        trajectory: As commanded.
        box: What may be off at once; None for `ErrorBox.fixed`.
        least: What other pushes of the plan tolerate; then the less of either is returned, number by number.

    Returns:
        The robustness, its numbers None where a load is not known, or a push above the floor could lift a part.

    Raises:
        ChainError: When a contact does not lie on an edge of both bodies.
    """
    if not chain.loads_known or not is_pressed(chain):
        return Robustness()
    return robustness_along(chain, trajectory.directions, trajectory.rates_at(trajectory.t), box, least)


def least_robustness(segments: Sequence[Segment]) -> Robustness:
    """Return what all pushes among the segments of a plan tolerate; unknown where one of them is, or without any."""
    least: Robustness | None = None
    for push in reversed(segments):  # the last push of a row carries most: then others are asked up to its least only
        if push.pushes and push.load is not None:
            least = robustness_of(push.load.chain, push.contact_trajectory, ErrorBox.of(push.load), least)
            if not least.known:
                return least
    return least or Robustness()


def robustness_along(
    chain: Chain, twists: FloatArray, rates: FloatArray, box: ErrorBox | None = None, least: Robustness | None = None
) -> Robustness:
    """Return that of a motion with body twists (m, 3), none zero, and rates (m, 3); see `robustness_of`."""
    moments = thinned(twists, rates, chain.characteristic_length)
    course = Course(chain, moments)
    if not course.nominal.min() > 0.0:
        return USED_UP
    everyone, senses = range(len(chain.objects)), (1.0, -1.0)
    length = 2.0 * chain.characteristic_length  # more than any contact is long
    least = least or Robustness(0.0, MOST_SHARE, MOST_SHARE, length, MOST_ANGLE, MOST_SCALE)
    friction, floor, load, aside_by, turned_by, scale = astuple(least)
    position = [course.moving(aside, i, d) for i in everyone for d in senses]
    angle = [course.moving(turn, i, d) for i in everyone for d in senses]
    below, above = course.nominal[..., 0], course.nominal[..., 1]  # mu f_n - f_t and mu f_n + f_t
    box = ErrorBox.fixed(chain) if box is None else box
    about = course if box.chain is chain else Course(box.chain, moments)
    return Robustness(
        contact_friction=max(friction, float(np.max(np.abs(above - below) / (above + below)))),
        floor_friction=min(floor, *(course.least_floor(i) for i in everyone)),
        load=min(load, *(course.least_lean(i, axis) for i in everyone for axis in (0, 1))),
        position=course.first_loss(position, min(length, aside_by)),
        angle=course.first_loss(angle, turned_by),
        joint=JointErrors(about, box).worst(scale)[0],
    )


class Moments(NamedTuple):
    """Moments of a motion, in the chain frame.

    Attributes:
        directions: (m, 3) twists per max(|v_x|, |v_y|, |omega| length): what the floor's friction depends on.
        twists: (m, 3) m/s, rad/s.
        rates: (m, 3) their time derivatives, m/s^2, rad/s^2.
        group: (m,) equal for neighbours of the same direction.
    """

    directions: FloatArray
    twists: FloatArray
    rates: FloatArray
    group: IntArray

    def at(self, which: IntArray) -> Moments:
        """Return some of them, by their indices (k,)."""
        return Moments(self.directions[which], self.twists[which], self.rates[which], self.group[which])


def thinned(twists: FloatArray, rates: FloatArray, length: float) -> Moments:
    """Return the moments of a motion that can be the worst ones, whatever the chain.

    Along an arc of constant twist V = s' xi every contact condition is linear in (s'', s'^2): among all samples of
    the arc it is least at a corner of their convex hull in that plane.

    Args:
        twists: (m, 3) body twists, none zero.
        rates: (m, 3) their time derivatives.
        length: The chain's characteristic length, m.
    """
    size = np.abs(twists * [1.0, 1.0, length]).max(axis=1)
    directions = twists / size[:, None]
    acceleration = (rates * directions).sum(axis=1) / (directions**2).sum(axis=1)
    astray = np.abs(rates - acceleration[:, None] * directions).max(axis=1)
    along = astray <= SAME * np.maximum(1.0, np.abs(acceleration))
    alike = (np.abs(np.diff(directions, axis=0)).max(axis=1) <= SAME) & along[1:] & along[:-1]
    group = np.concatenate([[0], np.cumsum(~alike)]).astype(np.int64)
    first = np.flatnonzero(np.concatenate([[True], ~alike]))
    twice = 1 + (np.diff(group, prepend=-1) > 0)  # a line has two points, also where a group has but one
    points = np.stack([acceleration, size**2], axis=1)
    lines = shapely.linestrings(np.repeat(points, twice, axis=0), indices=np.repeat(group, twice))
    corners, which = shapely.get_coordinates(shapely.convex_hull(lines), return_index=True)
    unit = directions[first][which]
    found = corners[:, :1] * unit
    alone = ~along[first][which]  # a moment that is no arc's is a group of its own
    found[alone] = rates[first[which[alone]]]
    return Moments(unit, np.sqrt(corners[:, 1:]) * unit, np.ascontiguousarray(found), which.astype(np.int64))


class Variants(NamedTuple):
    """q perturbed chains; the first axis of an array in which they do not differ has length 1.

    Attributes:
        packed: The arrays of a `PackedChain`, `objects` (q, n, 11) and `parts` (q, e, 5).
        changed: (n,) whether the floor's friction on the object differs from the nominal one.
        poses: (q, n, 3) motions that take the objects from where they are packed to where they are.
        centers: (q, n, 2) centres of mass before that motion, m.
        facets: (q, n, 4, 3) the contact holds where all facets . (f_x, f_y, m) are > 0.
        exist: (q,) whether there is such a chain: every contact has a length, every load is positive.
    """

    objects: FloatArray
    parts: FloatArray
    links: IntArray
    changed: BoolArray
    poses: FloatArray
    centers: FloatArray
    facets: FloatArray
    exist: BoolArray


Change = Callable[[FloatArray], Variants]
"""The perturbed chains for sizes (q,) >= 0 of one change in one sense."""


@dataclass(frozen=True, eq=False)
class Course:
    """A chain, all loads known, and the moments at which its contacts have to hold.

    Raises:
        SupportError: When a load is not known.
    """

    chain: Chain
    moments: Moments

    @cached_property
    def packed(self) -> contacts.PackedChain:
        """The chain as arrays."""
        return pack_chain(self.chain)

    @cached_property
    def inertia(self) -> InertiaTable:
        """Mass properties."""
        return inertia_table(self.chain)

    @cached_property
    def itself(self) -> Variants:
        """The chain with its nominal numbers."""
        n, packed = len(self.chain.objects), self.packed
        objects, parts = packed.objects[None], packed.parts[None]
        still, every = np.zeros((1, n, 3)), np.ones(n, dtype=np.bool_)
        centers = np.ascontiguousarray(self.inertia.center[None])
        facets = self._facets(self.ends[None])
        return Variants(objects, parts, packed.links, every, still, centers, facets, np.ones(1, np.bool_))

    @cached_property
    def _floor(self) -> FloatArray:
        """(m, n, 3) wrenches that move each object against the floor."""
        return core.floor_wrenches(self.itself, self.packed.series, self.moments.directions)

    @cached_property
    def nominal(self) -> FloatArray:
        """(m, n, 4) values of the facets with the nominal numbers."""
        return np.asarray(self.values_of(self.itself._replace(changed=~self.itself.changed), None)[0])

    @cached_property
    def order(self) -> IntArray:
        """(m,) the moments, those with the least to spare per friction load that the contact carries first."""
        loads = carried_objects(self.chain) @ self.packed.objects[:, 0] + 1e-300
        return np.argsort((self.nominal / loads[:, None]).min(axis=(1, 2)), kind="stable")

    def _facets(self, ends: FloatArray) -> FloatArray:
        friction = np.array([contact.friction for contact in self.chain.contacts])
        return contact_facets(ends[:, :, 0], ends[:, :, 1], friction, 1.0)

    def values_of(self, variants: Variants, which: IntArray | None, masses: FloatArray | None = None) -> FloatArray:
        """Return the facets' values (q, k, n, 4) at moments `which` (k,), None for all, N and N m.

        Args:
            variants: Chains.
            which: Indices of moments.
            masses: (q, n) factors of the masses that inertia acts on; None for 1.
        """
        moments = self.moments if which is None else self.moments.at(which)
        floor = self._floor if which is None else self._floor[which]
        mass, _, moment = self.inertia
        factor = np.ones((1, len(mass))) if masses is None else masses
        return core.facet_values(variants, self.packed.series, factor * mass, factor * moment, moments, floor)

    def moving(self, motion: Callable[[Chain, int, FloatArray], Motion], index: int, sense: float) -> Change:
        """Return the change that moving an object in one sense (+1 or -1) is, `perturb.aside` or `perturb.turn`."""

        def change(sizes: FloatArray) -> Variants:
            moved = motion(self.chain, index, sense * sizes)
            exist = np.asarray((moved.lengths > SHORTEST_CONTACT).all(axis=1))
            ends = np.where(exist[:, None, None, None], moved.ends, self.ends)
            return self.itself._replace(
                changed=moved.moved, poses=moved.poses, facets=self._facets(ends), exist=exist
            )

        return change

    @cached_property
    def ends(self) -> FloatArray:
        """(n, 2, 2) right and left end of every contact, m."""
        return contact_ends(self.chain)

    def standing(self, index: int, objects: Sequence[PushedObject]) -> Variants:
        """Return the chains with another object in place of one, all of the same outline.

        Raises:
            SupportError: When a push at the contact height could lift a part of one.
        """
        packed, height = self.packed, self.chain.contact_height
        many, parts = (np.repeat(a[None], len(objects), axis=0) for a in (packed.objects, packed.parts))
        centers, links = np.repeat(self.itself.centers, len(objects), axis=0), packed.links.copy()
        begin, end = links[index, 1:3]
        for j, obj in enumerate(objects):
            own = pack_objects([obj], height)
            many[j, index], parts[j, begin:end] = own.objects[0], own.parts
            links[index, 0] = own.links[0, 0]
            centers[j, index] = transform_points(obj.pose_chain, obj.support.center)
        changed, exist = np.arange(len(links)) == index, np.ones(len(objects), dtype=np.bool_)
        return self.itself._replace(
            objects=many, parts=parts, links=links, changed=changed, centers=centers, exist=exist
        )

    def least_floor(self, index: int) -> float:
        """Return the largest share by which the floor friction of an object may be off either way."""
        obj = self.chain.objects[index]

        def at(size: float) -> PushedObject:
            return replace(obj, floor_friction=obj.floor_friction * (1.0 + size))

        return self._least_either_way(index, at, MOST_SHARE)

    def most_lean(self, index: int, axis: int) -> tuple[FloatArray, float]:
        """Return the chain frame's x or y (2,) in an object's own frame, and how far its load may lean either way."""
        obj = self.chain.objects[index]
        direction = rotate(-float(obj.pose_chain[2]), np.eye(2)[axis])
        return direction, min(obj.support.most_lean(sense * direction) for sense in (1.0, -1.0))

    def least_lean(self, index: int, axis: int) -> float:
        """Return the largest share by which the load of an object may lean along the chain frame's x or y."""
        obj, (direction, most) = self.chain.objects[index], self.most_lean(index, axis)

        def at(size: float) -> PushedObject:
            return replace(obj, support=obj.support.leaning(direction, size))

        return self._least_either_way(index, at, min(most, MOST_SHARE))

    def _least_either_way(self, index: int, at: Callable[[float], PushedObject], most: float) -> float:
        """Return the first loss, up to `most`, of a change of either sign, given by its object for any size.

        The arrays of a `PackedChain` are polynomials of degree 2 in a share of friction or load, and so are the
        conditions of a push at the floor. Above it friction shifts the load: then only the arrays are.
        """
        height = self.chain.contact_height
        if not most > 0.0:
            return 0.0
        most = most if height == 0.0 else self._most_pressed(at, most * (1.0 - 1e-9))
        sample = 0.5 * most
        sampled = self.standing(index, [at(-sample), at(sample)])
        if height == 0.0:
            return min(most, self._least_root(sampled, sample))

        def between(arrays: FloatArray, middle: FloatArray, sizes: FloatArray) -> FloatArray:
            s = (sizes / sample).reshape(-1, *[1] * middle.ndim)
            below, above = arrays
            return np.ascontiguousarray(middle + 0.5 * s * (above - below + s * (above + below - 2.0 * middle)))

        def change(sense: float) -> Change:
            return lambda sizes: sampled._replace(
                objects=between(sampled.objects, self.packed.objects, sense * sizes),
                parts=between(sampled.parts, self.packed.parts, sense * sizes),
                centers=between(sampled.centers, self.inertia.center, sense * sizes),
                exist=np.ones(len(sizes), dtype=np.bool_),
            )

        return self.first_loss([change(1.0), change(-1.0)], most)

    def _most_pressed(self, at: Callable[[float], PushedObject], most: float) -> float:
        """Return the largest size up to `most`, of either sign, at which a push lifts no part of the object."""

        def room(size: float) -> float:
            return min(push_room(at(sense * size), self.chain.contact_height) for sense in (1.0, -1.0))

        if room(most) > 0.0:
            return most
        kept, lost = 0.0, most
        while lost - kept > FINE * lost:  # a root finder of scipy's would take a fifth of a second to load
            middle = 0.5 * (kept + lost)
            kept, lost = (middle, lost) if room(middle) > 0.0 else (kept, middle)
        return kept

    def _least_root(self, variants: Variants, size: float) -> float:
        """Return the least |s| of a root of polynomials of degree 2 that are given at -size, 0 and size; or inf."""
        below, above = self.values_of(variants, None)
        c = self.nominal
        a, b = 0.5 * (above + below) - c, 0.5 * (above - below)
        square = b**2 - 4.0 * a * c
        q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(square, 0.0)), b))
        with np.errstate(divide="ignore", invalid="ignore"):
            roots = np.fmin(np.abs(c / q), np.abs(q / a))
        return size * (1.0 + 1e-12) * float(np.min(roots, where=square >= 0.0, initial=np.inf))

    def first_loss(self, changes: Sequence[Change], most: float) -> float:
        """Return the largest size up to `most` before which none of the changes loses a contact."""
        for which in (self.order[:WEAK], None):
            for change in changes:
                most = self._narrowed(change, which, most)
        return most

    def _narrowed(self, change: Change, which: IntArray | None, most: float) -> float:
        """Return the size just below the first loss in (0, most]; `most` where none is seen at some sizes."""
        low, high, lost = 0.0, most, False
        count = CHECKS if which is None else SECTIONS
        while not lost or high - low > FINE * high:
            sizes = low + (high - low) * (np.arange(count) + 1.0) / count
            losses = self._lost(change(sizes), which)
            at = np.flatnonzero(losses.any(axis=1))
            if not len(at):
                return high if lost else most
            lost, count = True, FINE_SECTIONS
            which = np.flatnonzero(losses[at[0]]) if which is None else which[losses[at[0]]]
            low, high = float(sizes[at[0] - 1]) if at[0] else low, float(sizes[at[0]])
        return low

    def _lost(self, variants: Variants, which: IntArray | None) -> BoolArray:
        """Return whether a contact is lost (q, k) at moments (k,)."""
        values = self.values_of(variants, which)
        return (values.reshape(*values.shape[:2], -1) <= 0.0).any(axis=2) | ~variants.exist[:, None]
