"""What may be off about one object: the floor's friction, its place, its heading.

Every change makes variants of a chain from sizes: 0 is the chain as stated.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pushplan.geometry.contact_segments import SHORTEST_CONTACT
from pushplan.mechanics.friction.packed import AFFINE
from pushplan.mechanics.support import UniformSupport
from pushplan.sim.robustness.change_kernel import Variants
from pushplan.sim.robustness.model import Model
from pushplan.sim.robustness.overlap import Overlap
from pushplan.sim.robustness.tolerance import MOST_ANGLE, MOST_SHARE
from pushplan.util.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Change(ABC):
    """One object off in one sense.

    Attributes:
        model: The chain and its way.
        index: Of the object.
        sense: +1 or -1.
    """

    model: Model
    index: int
    sense: float

    @property
    @abstractmethod
    def most(self) -> float:
        """Largest size that is looked at."""

    @abstractmethod
    def at(self, sizes: FloatArray) -> Variants:
        """Return the variants for sizes (q,), >= 0."""

    @property
    def linear(self) -> bool:
        """Whether all contact conditions are polynomials of degree 2, at most, in the size."""
        return False

    @property
    def _alone(self) -> BoolArray:
        """(n,) the object only."""
        return np.asarray(np.arange(len(self.model.carried)) == self.index)

    def _variants(self, sizes: FloatArray, moved: BoolArray, **changed: FloatArray) -> Variants:
        """Return the chain as stated but for `changed`; `moved` (n,) marks what meets another friction."""
        stated = self.model.stated._replace(holds=np.ones(len(sizes)), moved=moved)
        return stated._replace(**changed)  # type: ignore[arg-type]


class FloorChange(Change):
    """The coefficient of friction between floor and object times 1 + size or 1 - size."""

    @property
    def most(self) -> float:
        """`MOST_SHARE`."""
        return MOST_SHARE

    @property
    def linear(self) -> bool:
        """Unless the object is pushed above the floor: then the friction shifts its load."""
        return bool(self.model.packed.objects[self.index, 7] == 0.0)

    def at(self, sizes: FloatArray) -> Variants:
        """See `Change.at`."""
        factor, i = 1.0 + self.sense * sizes, self.index
        objects = np.repeat(self.model.packed.objects[None], len(sizes), axis=0)
        objects[:, i, 0] *= factor
        objects[:, i, 7] *= factor
        footing = self.model.footing(i)
        loads = footing.leaning(np.zeros(len(sizes)), np.zeros(len(footing.base)))
        holds = loads.room(objects[:, i, 7])
        return self._variants(sizes, self._alone, objects=objects, holds=holds)


@dataclass(frozen=True, eq=False)
class LoadChange(Change):
    """The load of the object leaning: p(x) + size p e . (x - g) / h, its centre of mass with it.

    h is the largest |e . (x - g)|, so that the outermost load changes by the share `size`. On a polygon the
    change is a share of the mean pressure and g is the centroid; on points it is one of each point's load, and g
    their centre.

    Attributes:
        axis: e is the chain frame's x (0) or y (1), times the sense.
    """

    axis: int = 0

    @cached_property
    def lean(self) -> FloatArray | None:
        """(k,) e . (x - g) / h; None where everything rests on a line across e."""
        lean = self.model.footing(self.index).lean(self.axis)
        return None if lean is None else self.sense * lean

    @property
    def linear(self) -> bool:
        """Unless the object is pushed above the floor: then the friction shifts its load."""
        return bool(self.model.packed.objects[self.index, 7] == 0.0)

    @property
    def most(self) -> float:
        """Largest size at which no pressure is negative, at most `MOST_SHARE`."""
        footing, lean = self.model.footing(self.index), self.lean
        assert lean is not None
        lost = np.maximum(-footing.even * lean, 0.0)
        room = np.divide(footing.base, lost, out=np.full_like(lost, np.inf), where=lost > 0.0)
        return min(MOST_SHARE, float(room.min()))

    def at(self, sizes: FloatArray) -> Variants:
        """See `Change.at`."""
        model, i, lean = self.model, self.index, self.lean
        assert lean is not None
        footing, packed = model.footing(i), model.packed
        loads = footing.leaning(sizes, lean)
        objects = np.repeat(packed.objects[None], len(sizes), axis=0)
        centers = np.repeat(model.inertia.center[None], len(sizes), axis=0)
        parts, links = packed.parts[None], packed.links
        if footing.kind is UniformSupport:
            reach = np.abs(footing.arms[:, self.axis]).max()
            gradient = np.zeros((len(sizes), 2))
            gradient[:, self.axis] = self.sense * sizes * footing.even[0] / reach
            objects[:, i, 5:7] += gradient
            centers[:, i] += gradient @ footing.second
            links = links.copy()
            links[i, 0] = AFFINE
        else:
            objects[:, i, 1:3] += loads.moved
            objects[:, i, 8:11] = loads.second[:, [0, 0, 1], [0, 1, 1]]
            parts = np.repeat(parts, len(sizes), axis=0)
            part = parts[:, links[i, 1] : links[i, 2]]
            part[..., :2], part[..., 2], part[..., 3] = loads.spots, loads.base, loads.stiffness
            centers[:, i] += (loads.base - footing.base) @ footing.spots
        holds = loads.room(objects[:, i, 7])
        changed = {"objects": objects, "parts": parts, "centers": centers, "holds": holds}
        return self._variants(sizes, self._alone, **changed)._replace(links=links)


class Turn(Change):
    """The object, with all that it carries, turned by the size (rad) about the middle of its contact."""

    @property
    def most(self) -> float:
        """`MOST_ANGLE`."""
        return MOST_ANGLE

    def at(self, sizes: FloatArray) -> Variants:
        """See `Change.at`."""
        model, i = self.model, self.index
        turned = model.carried[i]
        cos, sin = np.cos(sizes)[:, None], self.sense * np.sin(sizes)[:, None]
        middle = model.ends[:, i].mean(axis=0)

        def turn(points: FloatArray) -> FloatArray:
            x, y = points[..., 0] - middle[0], points[..., 1] - middle[1]
            return np.asarray(np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1) + middle)

        moves = np.repeat(model.stated.moves, len(sizes), axis=0)
        shift = turn(np.zeros((1, 2)))
        moves[:, turned] = np.concatenate([cos, sin, shift[:, 0]], axis=1)[:, None]
        centers = np.repeat(model.inertia.center[None], len(sizes), axis=0)
        centers[:, turned] = turn(model.inertia.center[turned])
        ends = np.repeat(model.ends[:, None], len(sizes), axis=1)
        beyond = turned & (np.arange(len(turned)) != i)
        ends[:, :, beyond] = turn(model.ends[:, beyond][:, None, :])
        return self._variants(sizes, turned, moves=moves, centers=centers, facets=model.facets(ends))


class Shift(Change):
    """The object, but nothing that it carries, aside along its contact by the size (m): contacts are overlaps.

    A contact behind it that is not parallel to its own one sees the part of the shift along itself.
    """

    @property
    def most(self) -> float:
        """More than any contact is long, m."""
        return 2.0 * self.model.chain.characteristic_length

    @cached_property
    def _aside(self) -> FloatArray:
        return np.asarray(self.sense * self.model.chain.contacts[self.index].tangent)

    @cached_property
    def _overlaps(self) -> dict[int, Overlap]:
        """Of the object's own contact and those of what it carries."""
        contacts = self.model.chain.contacts
        touching = [k for k, c in enumerate(contacts) if self.index in (c.pushed, c.pusher)]
        return {k: Overlap.of(self.model.chain, k) for k in touching}

    def at(self, sizes: FloatArray) -> Variants:
        """See `Change.at`."""
        model, i = self.model, self.index
        moves = np.repeat(model.stated.moves, len(sizes), axis=0)
        moves[:, i, 2:] = sizes[:, None] * self._aside
        centers = np.repeat(model.inertia.center[None], len(sizes), axis=0)
        centers[:, i] += moves[:, i, 2:]
        ends = np.repeat(model.ends[:, None], len(sizes), axis=1)
        holds = np.full(len(sizes), np.inf)
        for k, overlap in self._overlaps.items():
            tangent = model.chain.contacts[k].tangent
            along = moves[:, i, 2:] @ tangent
            ends[:, :, k] += overlap.change(along, pushed=k == i)[..., None] * tangent
            holds = np.minimum(holds, (ends[1, :, k] - ends[0, :, k]) @ tangent - SHORTEST_CONTACT)
        ends[:, holds <= 0.0] = model.ends[:, None]
        facets = model.facets(ends)
        return self._variants(sizes, self._alone, moves=moves, centers=centers, facets=facets, holds=holds)
