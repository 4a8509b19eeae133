"""Largest scale of a box of parameter errors at which a plan keeps all contacts, one error alone or all together.

rho = min over moments and contact conditions of sup {r: the condition holds for all |delta_j| <= r u_j}, with half
widths u. A condition is nearly monotonic in each parameter, so its worst errors are a corner of the box. The search
linearises about a point, moves to the worst corner of this model, and linearises there. It ends when no new corner is
worse.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pushplan.core.contacts import AFFINE, UNIFORM
from pushplan.geometry.polygon import SHORTEST_CONTACT
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.packed import contact_facets, push_room
from pushplan.mechanics.perturb import aside_slides, displace
from pushplan.plans.load import Load
from pushplan.plans.robustness import BOX, MOST_ANGLE
from pushplan.sim.moments import ChainMotion, Variants
from pushplan.util.arrays import FloatArray, IntArray

FINE = 1e-6
"""Relative accuracy of the scale."""

SECTIONS, AT_ONCE, MOST_SECTIONS = 4, 512, 128
"""Smallest number of scales per call, chains times moments times scales per call, and largest number of scales."""

CORNERS = 24
"""Largest number of corners that one linearisation adds."""

ROUNDS = 8
"""Largest number of linearisations."""

FEW, WEAK = 32, 384
"""Number of the weakest moments that are tested before all others: for single and for joint errors.

With half as many for joint errors, the search missed the loss of a contact on two of 499 plans.
"""

NO_CONTACT = 1e6
"""Negative value of all conditions of a chain with a contact of zero length, N."""

MOST_SCALE = 10.0
"""Largest scale of the search."""

SHIFT = 7
"""Column of `PackedChain.objects` with the load shift by the push, which grows with floor friction."""

KINDS = ("floor_friction", "mass", "lean_x", "lean_y", "position", "angle")
"""Errors of each object, in this order. Contact frictions are always at their lowest, which is always worse."""


@dataclass(frozen=True, eq=False)
class ErrorBox:
    """Box of parameter errors at a scale of 1, and the chain at its centre.

    Attributes:
        chain: Chain with the midpoint of every interval.
        contact_friction: Largest decrease of the contacts' friction coefficients, as shares, (n,).
        widths: Half widths of `KINDS`: shares, m, rad, (n, 6).
    """

    chain: Chain
    contact_friction: FloatArray
    widths: FloatArray

    @classmethod
    def fixed(cls, chain: Chain) -> ErrorBox:
        """Return the box `BOX` about the parameters of a chain."""
        n, off = len(chain.objects), BOX
        row = [off.floor_friction, off.mass, off.load, off.load, off.position, off.angle]
        return cls(chain, np.full(n, off.contact_friction), np.tile(row, (n, 1)))

    @classmethod
    def of_kind(cls, chain: Chain, kind: str) -> ErrorBox:
        """Return a box with half widths of 1, 1 m or 1 rad for one kind of error, and 0 for the others."""
        n = len(chain.objects)
        return cls(chain, np.zeros(n), np.tile([float(kind == one) for one in KINDS], (n, 1)))

    @classmethod
    def of(cls, load: Load) -> ErrorBox:
        """Return the box of the intervals that the scenario of a load specifies; without any, the fixed box."""
        problem, chain = load.problem, load.chain
        if not problem.states_intervals:
            return cls.fixed(chain)
        n = len(chain.objects)
        share = np.full(n, problem.uncertainty.contact_friction)
        if problem.contact_friction is not None:
            share = _half_widths(problem.contact_friction)
        # The contacts of such a chain have the lowest coefficients; the midpoints follow from them.
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
    """Return the half widths (k,) of intervals (k, 2) as shares of their midpoints."""
    return np.asarray(np.diff(spans)[:, 0] / np.maximum(spans.sum(axis=1), 1e-300))


@dataclass(frozen=True, eq=False)
class JointErrors:
    """A motion of a chain with a box of parameter errors."""

    motion: ChainMotion
    box: ErrorBox

    @cached_property
    def most(self) -> float:
        """Largest scale at which every parameter is still valid: no load and no friction is negative."""
        widths, share = self.box.widths, self.box.contact_friction
        least = [MOST_SCALE]
        least += [1.0 / off for off in [*share, *widths[:, 0], *widths[:, 1]] if off > 0.0]
        least += [MOST_ANGLE / off for off in widths[:, 5] if off > 0.0]
        height = self.motion.chain.contact_height
        for i, (obj, row) in enumerate(zip(self.motion.chain.objects, widths, strict=True)):
            leans = sum(row[2 + axis] / max(self.motion.most_lean(i, axis)[1], 1e-300) for axis in (0, 1))
            if leans > 0.0:
                least.append((1.0 - 1e-9 * (height > 0.0)) / leans)
            if height > 0.0:  # the push shifts the load more with more friction, and a shifted load has less room
                room = push_room(obj, height)
                least.append(max(room, 0.0) / (height * obj.floor_friction * (row[0] + leans) + 1e-300))
        return min(least)

    def variants(self, scales: FloatArray, corners: FloatArray, about_last: bool = False) -> Variants:
        """Return the chains at scales (q,) of points (q, n, 6) of the box, with the lowest contact frictions.

        `changed` compares them with the last one if `about_last`, else with the nominal chain.
        """
        itself, chain = self.motion.itself, self.motion.chain
        off = scales[:, None, None] * corners * self.box.widths
        arrays = [np.repeat(a, len(scales), axis=0) for a in (itself.objects, itself.parts, itself.centers)]
        links = itself.links
        if off[:, :, 2:4].any():
            links = links.copy()
            links[:, 0] = np.where(links[:, 0] == UNIFORM, AFFINE, links[:, 0])
            for k, slopes in enumerate(self.motion.lean_slopes):
                i, axis = divmod(k, 2)
                for array, slope in zip(arrays, slopes, strict=True):
                    array += off[:, i, 2 + axis, None, None] * slope
        arrays[0][:, :, 0] *= (1.0 + off[:, :, 0]) * (1.0 + off[:, :, 1])
        arrays[0][:, :, SHIFT] *= 1.0 + off[:, :, 0]
        moved = displace(chain, aside_slides(chain, off[:, :, 4]), off[:, :, 5])
        exist = np.asarray((moved.lengths > SHORTEST_CONTACT).all(axis=1))
        ends = np.where(exist[:, None, None, None], moved.ends, self.motion.ends)
        friction = np.array([contact.friction for contact in chain.contacts])
        friction = friction * (1.0 - scales[:, None] * self.box.contact_friction)
        changed = np.concatenate([off[:, :, :4], moved.poses], axis=2)
        changed = np.asarray((changed != (changed[-1] if about_last else 0.0)).any(axis=2))
        return itself._replace(
            objects=np.ascontiguousarray(arrays[0]),
            parts=np.ascontiguousarray(arrays[1]),
            links=links,
            changed=changed,
            poses=np.ascontiguousarray(moved.poses),
            centers=np.ascontiguousarray(arrays[2]),
            facets=contact_facets(ends[:, :, 0], ends[:, :, 1], friction, 1.0),
            exist=exist,
        )

    def values(
        self, scales: FloatArray, corners: FloatArray, which: IntArray | None, about_last: bool = False
    ) -> FloatArray:
        """Return the values of the conditions (q, k, 4 n) at moments `which` (k,), None for all.

        They are -NO_CONTACT for a chain with a contact of zero length. If most points differ from the last one in few
        objects, `about_last` saves most of the time.
        """
        variants = self.variants(scales, corners, about_last)
        masses = 1.0 + scales[:, None] * corners[:, :, 1] * self.box.widths[:, 1]
        found = self.motion.values_of(variants, which, masses, about_last)
        found = found.reshape(*found.shape[:2], -1)
        found[~variants.exist] = -NO_CONTACT
        return np.asarray(found)

    def worst(self, most: float = MOST_SCALE) -> tuple[float, FloatArray]:
        """Return rho, at most `most` and `self.most`, and the point (n, 6) of the box that first loses a contact.

        The point is zero if no point loses a contact, or if the chain at the centre already does.
        """
        middle = np.zeros((1, len(self.motion.chain.objects), len(KINDS)))
        scale, known, about = min(most, self.most), middle, middle[0]
        if not scale > 0.0 or (self.values(np.zeros(1), middle, None) <= 0.0).any():
            return 0.0, about
        which = self.motion.order[:WEAK]
        for _ in range(ROUNDS):
            corners = self._corners(scale if len(known) > 1 else min(1.0, scale), about, which)
            fresh = np.array([c for c in corners if not (known == c).all(axis=(1, 2)).any()])
            if not len(fresh):
                break
            known = np.concatenate([known, fresh])
            found, at = self._first_loss(fresh, scale, which)
            if at is None:
                break
            scale, about = found, fresh[at]
        scale, at = self._first_loss(known, scale, None)
        return scale, about if at is None else known[at]

    def alone(self, most: float) -> float:
        """Return the largest scale, at most `most` and `self.most`, at which each single error keeps all contacts."""
        numbers, shape = np.argwhere(self.box.widths > 0.0), self.box.widths.shape
        either_way = np.zeros((len(numbers), 2, *shape))
        either_way[np.arange(len(numbers)), :, numbers[:, 0], numbers[:, 1]] = 1.0, -1.0
        scale = min(most, self.most)
        if scale > 0.0:
            scale, _ = self._first_loss(either_way.reshape(-1, *shape), scale, self.motion.order[:FEW])
            for points in either_way:  # one object at a time, so that the results of the others are reused
                scale, _ = self._first_loss(points, scale, None)
        return scale

    def _corners(self, scale: float, about: FloatArray, which: IntArray) -> FloatArray:
        """Return the corners (c, n, 6) that are worst in the linear model about a point (n, 6) of the box.

        The model uses the change of each condition with each parameter on both sides. A gradient would fail for a
        contact that shortens in whichever direction an object moves.
        """
        shape, size = about.shape, about.size
        points = np.repeat(about.reshape(1, -1), 2 * size + 1, axis=0)
        each = np.arange(size)
        points[each, each], points[size + each, each] = -1.0, 1.0
        values = self.values(np.full(len(points), scale), points.reshape(-1, *shape), which, about_last=True)
        values = values.reshape(len(points), -1)
        below, above, here = values[:size], values[size:-1], values[-1]
        gain = here - np.minimum(np.minimum(below, above), here)
        total = gain.sum(axis=0)
        # Share of the changes at which a condition is lost if they add up.
        share = here / np.maximum(total, 1e-300)
        chosen = np.argsort(share, kind="stable")[: 4 * CORNERS]
        corners = np.where(gain > 0.0, np.where(below < above, -1.0, 1.0), about.reshape(-1, 1))[:, chosen].T
        _, first = np.unique(corners, axis=0, return_index=True)
        return corners[np.sort(first)[:CORNERS]].reshape(-1, *shape)

    def _first_loss(self, corners: FloatArray, most: float, which: IntArray | None) -> tuple[float, int | None]:
        """Return the smallest scale at which a corner loses a contact, and its index; `most` and None without one.

        The search can miss a contact that is lost at one scale and holds again at a slightly larger one.
        """
        low, high, losing, lost = 0.0, most, np.arange(len(corners)), False
        while high - low > FINE * high:
            count = 1  # once the weak moments are tested, few others lose a contact earlier
            if which is not None:
                count = min(max(SECTIONS, AT_ONCE // (len(losing) * len(which))), MOST_SECTIONS)
            scales = low + (high - low) * (np.arange(count) + 1.0) / count
            just_below = np.tile((1.0 - 1e-9) * scales, len(losing))  # the largest scale can leave no friction at all
            values = self.values(just_below, np.repeat(corners[losing], count, axis=0), which)
            lost_at = (values <= 0.0).any(axis=2).reshape(len(losing), count, -1)
            gone = np.asarray(lost_at.any(axis=2))
            if not gone.any():
                return (high, int(losing[0])) if lost else (most, None)
            first = np.where(gone.any(axis=1), gone.argmax(axis=1), count)
            k, lost = int(first.min()), True
            losing, seen = losing[first == k], np.flatnonzero(np.any(lost_at[first == k, k], axis=0))
            which = seen if which is None else which[seen]
            low, high = float(scales[k - 1]) if k else low, float(scales[k])
        return low, int(losing[0])
