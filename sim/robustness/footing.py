"""Where one object's load rests, and what becomes of it when the load leans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pushplan.errors import SupportError
from pushplan.geometry.se2 import rotate
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.friction.packed import PackedChain
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport
from pushplan.util.arrays import FloatArray


class Loads(NamedTuple):
    """q loads of one object; directions are those of the chain frame.

    Attributes:
        base: (q, k) pressure per weight at the corners of a polygon, 1/m^2, or load fractions of points.
        stiffness: (q, k) how much corners or points take of a load that a push shifts.
        spots: (q, k, 2) corners or points about the stiffness' centre, m.
        second: (q, 2, 2) second moments of the stiffness.
        moved: (q, 2) by how much the stiffness' centre is off the stated one, m.
    """

    base: FloatArray
    stiffness: FloatArray
    spots: FloatArray
    second: FloatArray
    moved: FloatArray

    def room(self, shift: FloatArray) -> FloatArray:
        """Return the least pressure (q,) left by pushes that shift the load's centre by `shift` (q,) any way, m.

        See `mechanics.packed`; not positive: a part of the object could lift.
        """
        least: FloatArray = self.base.min(axis=1)
        if (shift == 0.0).all():
            return least
        gain = np.linalg.norm(self.spots @ np.linalg.inv(self.second), axis=2) * self.stiffness
        return np.asarray((self.base - shift[:, None] * gain).min(axis=1))


@dataclass(frozen=True, eq=False)
class Footing:
    """The load of an object as stated.

    Attributes:
        kind: The class of its support.
        spots: (k, 2) corners of a polygon about the centroid, or points about the centre of the stiffness, m.
        base: (k,) see `Loads`.
        even: (k,) what a leaning load is a share of: a polygon's mean pressure, a point's own load.
        arms: (k, 2) like `spots`, about the centroid of a polygon or the centre of the points' load, m.
        second: (2, 2) second moments of the stiffness.
    """

    kind: type
    spots: FloatArray
    base: FloatArray
    even: FloatArray
    arms: FloatArray
    second: FloatArray

    @classmethod
    def of(cls, obj: PushedObject, packed: PackedChain, i: int) -> Footing:
        """Return the footing of object i of a packed chain."""
        second = packed.objects[i, [8, 9, 9, 10]].reshape(2, 2)
        turn, support = float(obj.pose_chain[2]), obj.support
        if isinstance(support, UniformSupport):
            corners = rotate(turn, support.outline - support.moments.centroid)
            even = np.full(len(corners), 1.0 / support.moments.area)
            base = even + corners @ rotate(turn, support.gradient)
            return cls(UniformSupport, corners, base, even, corners, second)
        if not isinstance(support, FeetSupport | PressureMapSupport):
            raise SupportError(f"the load under {obj.name!r} is unknown")
        part = packed.parts[packed.links[i, 1] : packed.links[i, 2]]
        spots, loads = part[:, :2], part[:, 2]
        return cls(type(support), spots, loads, loads, spots - loads @ spots, second)

    def lean(self, axis: int) -> FloatArray | None:
        """Return e . (x - g) / h (k,) for e along x (0) or y (1); None where everything rests on a line across it."""
        reach = float(np.abs(self.arms[:, axis]).max())
        return self.arms[:, axis] / reach if reach > 1e-9 else None

    def leaning(self, shares: FloatArray, lean: FloatArray) -> Loads:
        """Return the loads base + even * share * lean for shares (q,)."""
        base = self.base + shares[:, None] * self.even * lean
        q = len(shares)
        spots, second = np.repeat(self.spots[None], q, axis=0), np.repeat(self.second[None], q, axis=0)
        stiffness, moved = np.ones_like(base), np.zeros((q, 2))
        if self.kind is FeetSupport:
            stiffness /= len(self.base)
        if self.kind is PressureMapSupport:
            stiffness, moved = base, base @ self.spots
            spots -= moved[:, None]
            second = np.swapaxes(spots * base[..., None], 1, 2) @ spots
        return Loads(base, stiffness, spots, second, moved)
