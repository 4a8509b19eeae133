"""How far all numbers of a chain may be off at once on a plan: the scale of a box of errors.

rho = min over moments and contact conditions of sup {r: the condition holds for all |delta_j| <= r u_j}, u being the
half widths of the box. In each number a condition is nearly monotonic, so its worst errors are a corner of the box.
It is found by linearising about a point, taking the corner that this says is the worst, linearising again there,
until no corner is worse than those that are known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pushplan.core.contacts import AFFINE, UNIFORM
from pushplan.geometry.polygon import SHORTEST_CONTACT
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.packed import contact_facets, push_room
from pushplan.mechanics.perturb import aside_slides, displace
from pushplan.plans.robustness import BOX, MOST_ANGLE
from pushplan.util.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from pushplan.plans.load import Load
    from pushplan.sim.robustness import Course, Variants

FINE = 1e-4
"""Share of itself to which the scale is found."""

SECTIONS = 8
"""Scales that are asked at once."""

CORNERS = 24
"""Corners that one linearisation may add."""

ROUNDS = 8
"""Linearisations at most."""

WEAK = 192
"""Moments with the least to spare that are asked before all are."""

NO_CONTACT = 1e6
"""How negative the conditions of a chain count of which a contact has no length, N."""

MOST_SCALE = 10.0
"""Largest scale that is looked at."""

SHIFT = 7
"""Column of `PackedChain.objects`: how far a push shifts the load, which grows with the floor's friction."""

KINDS = ("floor_friction", "mass", "lean_x", "lean_y", "position", "angle")
"""What is off of each object, in this order; contact frictions are always lower, which is always worse."""


@dataclass(frozen=True, eq=False)
class ErrorBox:
    """By how much numbers of a chain may be off at a scale of 1, and the chain with the numbers in the middle.

    Attributes:
        chain: With the middle of every interval.
        contact_friction: (n,) shares of the contacts' coefficients.
        widths: (n, 6) half widths of `KINDS`: shares, m, rad.
    """

    chain: Chain
    contact_friction: FloatArray
    widths: FloatArray

    @classmethod
    def fixed(cls, chain: Chain) -> ErrorBox:
        """Return the box `BOX` about the numbers of a chain."""
        n, off = len(chain.objects), BOX
        row = [off.floor_friction, off.mass, off.load, off.load, off.position, off.angle]
        return cls(chain, np.full(n, off.contact_friction), np.tile(row, (n, 1)))

    @classmethod
    def of(cls, load: Load) -> ErrorBox:
        """Return what the scenario of a load states as intervals, or the fixed box where it states none."""
        problem, chain = load.problem, load.chain
        if not problem.states_intervals:
            return cls.fixed(chain)
        n = len(chain.objects)
        share = np.full(n, problem.uncertainty.contact_friction)
        if problem.contact_friction is not None:
            share = _half_widths(problem.contact_friction)
        # The contacts of such a chain have the lowest coefficients; their middles are higher by this.
        contacts = tuple(
            replace(contact, friction=contact.friction / (1.0 - off)) if off < 1.0 else contact
            for contact, off in zip(chain.contacts, share, strict=True)
        )
        widths, interval = np.zeros((n, len(KINDS))), problem.interval
        if interval is not None:
            for column, spans in enumerate((interval.floor_friction, interval.mass)):
                widths[:, column] = _half_widths(spans)
            for i, spans in interval.fractions.items():
                widths[i, 2:4] = _half_widths(spans).min()
            for i, off in interval.pressures.items():
                widths[i, 2:4] = off
        return cls(replace(chain, contacts=contacts), share, widths)


def _half_widths(spans: FloatArray) -> FloatArray:
    """Return the half widths (k,) of intervals (k, 2) as shares of their middles."""
    return np.asarray(np.diff(spans)[:, 0] / np.maximum(spans.sum(axis=1), 1e-300))


@dataclass(frozen=True, eq=False)
class JointErrors:
    """A course on which all numbers may be off at once."""

    course: Course
    box: ErrorBox

    @cached_property
    def _slopes(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """What the packed arrays `objects`, `parts` and `centers` change with a share of each load's lean in x and y.

        They are linear in it, at least at floor level; above it what is left out is of second order.
        """
        chain = self.course.chain
        found: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        for i, obj in enumerate(chain.objects):
            for axis in (0, 1):
                direction, most = self.course.most_lean(i, axis)
                step = 0.01 * min(1.0, most)
                if not step > 0.0:  # then `most` is zero, and nothing is asked
                    continue
                leant = [replace(obj, support=obj.support.leaning(direction, s)) for s in (-step, step)]
                at = self.course.standing(i, leant)
                objects, parts, centers = ((a[1] - a[0]) / (2.0 * step) for a in (at.objects, at.parts, at.centers))
                found.append((objects, parts, centers))
        return found

    @cached_property
    def most(self) -> float:
        """Largest scale at which every number still means something: no load is negative, no friction."""
        widths, share = self.box.widths, self.box.contact_friction
        least = [MOST_SCALE]
        least += [1.0 / off for off in [*share, *widths[:, 0], *widths[:, 1]] if off > 0.0]
        least += [MOST_ANGLE / off for off in widths[:, 5] if off > 0.0]
        height = self.course.chain.contact_height
        for i, (obj, row) in enumerate(zip(self.course.chain.objects, widths, strict=True)):
            leans = sum(row[2 + axis] / max(self.course.most_lean(i, axis)[1], 1e-300) for axis in (0, 1))
            if leans > 0.0:
                least.append((1.0 - 1e-9) / leans)
            if height > 0.0:  # a push shifts more with more friction, and what leans bears less of it
                room = push_room(obj, height)
                least.append(max(room, 0.0) / (height * obj.floor_friction * (row[0] + leans) + 1e-300))
        return min(least)

    def variants(self, scales: FloatArray, corners: FloatArray) -> Variants:
        """Return the chains at scales (q,) of points (q, n, 6) of the box, contact frictions at their lowest."""
        itself, chain = self.course.itself, self.course.chain
        n = len(chain.objects)
        off = scales[:, None, None] * corners * self.box.widths
        arrays = [np.repeat(a, len(scales), axis=0) for a in (itself.objects, itself.parts, itself.centers)]
        for k, slopes in enumerate(self._slopes):
            i, axis = divmod(k, 2)
            for array, slope in zip(arrays, slopes, strict=True):
                array += off[:, i, 2 + axis, None, None] * slope
        arrays[0][:, :, 0] *= (1.0 + off[:, :, 0]) * (1.0 + off[:, :, 1])
        arrays[0][:, :, SHIFT] *= 1.0 + off[:, :, 0]
        moved = displace(chain, aside_slides(chain, off[:, :, 4]), off[:, :, 5])
        exist = np.asarray((moved.lengths > SHORTEST_CONTACT).all(axis=1))
        ends = np.where(exist[:, None, None, None], moved.ends, self.course.ends)
        friction = np.array([contact.friction for contact in chain.contacts])
        friction = friction * (1.0 - scales[:, None] * self.box.contact_friction)
        links = itself.links.copy()
        links[:, 0] = np.where(links[:, 0] == UNIFORM, AFFINE, links[:, 0])
        return itself._replace(
            objects=np.ascontiguousarray(arrays[0]),
            parts=np.ascontiguousarray(arrays[1]),
            links=links,
            changed=np.ones(n, dtype=np.bool_),
            poses=np.ascontiguousarray(moved.poses),
            centers=np.ascontiguousarray(arrays[2]),
            facets=contact_facets(ends[:, :, 0], ends[:, :, 1], friction, 1.0),
            exist=exist,
        )

    def values(self, scales: FloatArray, corners: FloatArray, which: IntArray | None) -> FloatArray:
        """Return the conditions' values (q, k, 4 n) at moments `which` (k,), None for all.

        They are -NO_CONTACT where a contact has no length.
        """
        variants = self.variants(scales, corners)
        masses = 1.0 + scales[:, None] * corners[:, :, 1] * self.box.widths[:, 1]
        found = self.course.values_of(variants, which, masses)
        found = found.reshape(*found.shape[:2], -1)
        found[~variants.exist] = -NO_CONTACT
        return np.asarray(found)

    def worst(self, most: float = MOST_SCALE) -> tuple[float, FloatArray]:
        """Return rho, at most `most` and `self.most`, and the point (n, 6) of the box that loses a contact above it.

        The point is zero where none does up to there, or where a contact is lost with all numbers in the middle.
        """
        middle = np.zeros((1, len(self.course.chain.objects), len(KINDS)))
        scale, known, about = min(most, self.most), middle, middle[0]
        if not scale > 0.0 or (self.values(np.zeros(1), middle, None) <= 0.0).any():
            return 0.0, about
        which: IntArray | None = None
        for _ in range(ROUNDS):
            corners, moments = self._corners(scale if len(known) > 1 else min(1.0, scale), about, which)
            which = moments if which is None else which
            fresh = np.array([c for c in corners if not (known == c).all(axis=(1, 2)).any()])
            if not len(fresh):
                break
            known = np.concatenate([known, fresh])
            found, at = self._first_loss(fresh, scale, which)
            if at is None:
                break
            scale, about = found, fresh[at]
        values = self.values(np.full(len(known), scale * (1.0 - FINE)), known, None)
        lost = (values <= 0.0).any(axis=(1, 2))
        if lost.any():
            scale, at = self._first_loss(known[lost], scale, None)
            about = about if at is None else known[lost][at]
        return scale, about

    def _corners(self, scale: float, about: FloatArray, which: IntArray | None) -> tuple[FloatArray, IntArray]:
        """Return corners (c, n, 6) that are the worst ones as seen from a point (n, 6) of the box at a scale.

        Also which `WEAK` of the moments `which` lose a contact first, seen so.

        Of each condition the change with each number alone is looked at, to either side: a contact that shortens
        whichever way an object moves has no gradient.
        """
        shape, size = about.shape, about.size
        points = np.repeat(about.reshape(1, -1), 2 * size + 1, axis=0)
        each = np.arange(size)
        points[each, each], points[size + each, each] = -1.0, 1.0
        values = self.values(np.full(len(points), scale), points.reshape(-1, *shape), which)
        values = values.reshape(len(points), -1)
        below, above, here = values[:size], values[size:-1], values[-1]
        gain = here - np.minimum(np.minimum(below, above), here)
        total = gain.sum(axis=0)
        # The share of the changes at which a condition is lost, if they simply add up.
        share = here / np.maximum(total, 1e-300)
        chosen = np.argsort(share, kind="stable")[: 4 * CORNERS]
        first_lost = share.reshape(-1, 4 * len(about)).min(axis=1)
        corners = np.where(gain > 0.0, np.where(below < above, -1.0, 1.0), about.reshape(-1, 1))[:, chosen].T
        _, first = np.unique(corners, axis=0, return_index=True)
        return corners[np.sort(first)[:CORNERS]].reshape(-1, *shape), np.argsort(first_lost)[:WEAK]

    def _first_loss(self, corners: FloatArray, most: float, which: IntArray | None) -> tuple[float, int | None]:
        """Return the largest scale up to `most` before which no corner loses a contact, and the one that does first.

        What is lost at a scale and holds again at a slightly larger one may be missed.
        """
        low, high, losing, lost = 0.0, most, np.arange(len(corners)), False
        while high - low > FINE * high:
            scales = low + (high - low) * (np.arange(SECTIONS) + 1.0) / SECTIONS
            values = self.values(np.tile(scales, len(losing)), np.repeat(corners[losing], SECTIONS, axis=0), which)
            lost_at = (values <= 0.0).any(axis=2).reshape(len(losing), SECTIONS, -1)
            gone = np.asarray(lost_at.any(axis=2))
            if not gone.any():
                return (high, int(losing[0])) if lost else (most, None)
            first = np.where(gone.any(axis=1), gone.argmax(axis=1), SECTIONS)
            k, lost = int(first.min()), True
            losing, seen = losing[first == k], np.flatnonzero(np.any(lost_at[first == k, k], axis=0))
            which = seen if which is None else which[seen]
            low, high = float(scales[k - 1]) if k else low, float(scales[k])
        return low, int(losing[0])
