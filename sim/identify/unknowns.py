"""What is not known of a chain, as numbers in the unit cube, and the packed world that such numbers make.

Even pressure under flat plates is the exception: edges wear and bend, so that part of the load moves to the border,
and the centre of the load is seldom the centroid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely

import pushplan.core.slip as slip
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.slip.feet import feet_of
from pushplan.slip.packing import pack_world
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

MOST_BORDER = 0.95
MOST_TILT = 0.45
"""Two tilts together leave a tenth of the pressure at the worst corner."""
_LEAST = 1e-4
"""Part of the mean load that every point keeps, so that the same points carry whatever the numbers are."""


@dataclass(frozen=True, eq=False)
class PressedOutline:
    """Points inside and along an outline, and their loads for a border and tilts.

    Attributes:
        points: (k, 2) in the object's own frame, m.
        inside: (k,) loads without a border, summing to 1.
        edge: (k,) loads of a border that carries everything, summing to 1.
        across: (k, 2) where the points are, from -1 to 1 over the outline's extent along x and y.
    """

    points: FloatArray
    inside: FloatArray
    edge: FloatArray
    across: FloatArray

    @classmethod
    def from_outline(
        cls, outline: FloatArray, support: Support | None = None, degree: int = 5, marks: int = 24
    ) -> PressedOutline:
        """Return the points of an outline.

        Args:
            outline: (v, 2) m.
            support: What is pressed without border and tilts; None for even pressure.
            degree: Up to which the points inside have the moments of that pressure.
            marks: Number of points along the outline.
        """
        within = feet_of(support or UniformSupport(outline), degree)
        ring = shapely.LinearRing(outline)
        places = shapely.line_interpolate_point(ring, (np.arange(marks) + 0.5) / marks, normalized=True)
        points = np.concatenate([within.positions, shapely.get_coordinates(places)])
        middle, half = 0.5 * (outline.max(axis=0) + outline.min(axis=0)), 0.5 * np.ptp(outline, axis=0)
        inside = np.concatenate([within.fractions, np.zeros(marks)])
        edge = np.concatenate([np.zeros(len(within.fractions)), np.full(marks, 1.0 / marks)])
        return cls(points, inside, edge, (points - middle) / half)

    def loads(self, border: float, tilts: FloatArray) -> FloatArray:
        """Return the load on every point (k,), summing to 1.

        Args:
            border: Share of the load along the outline.
            tilts: (2,) by how much the pressure grows over half of the outline's extent, along x and y.
        """
        flat = (1.0 - border) * self.inside + border * self.edge
        loads = np.maximum(flat * (1.0 + self.across @ tilts), _LEAST / len(flat))
        return np.asarray(loads / loads.sum())

    def support(self, border: float, tilts: FloatArray) -> FeetSupport:
        """Return the points with their loads."""
        return FeetSupport(self.points, self.loads(border, tilts))


FRICTION = (0.02, 1.0)
RATIO = (0.25, 4.0)
"""Floor friction (coefficient times weight) of an object over that of the first, as a multiple of what is stated."""
MOST_FEET = 6
"""Up to so many feet each has its own load; more of them, and the points of a pressure map, lean together."""


@dataclass(frozen=True)
class Unknown:
    """One number that is not known; before anything was measured, it is anywhere between its ends alike.

    Attributes:
        kind: `contact_friction`, `floor_ratio`, `border`, `tilt`, `foot` or `floor_friction`.
        of: The contact's or the object's index.
        name: For people.
        low: Least value.
        high: Largest value.
        logarithmic: Whether its logarithm is spread evenly, not itself.
    """

    kind: str
    of: int
    name: str
    low: float
    high: float
    logarithmic: bool = False

    def value(self, part: FloatArray) -> FloatArray:
        """Return the values at parts of the way (...) from `low` to `high`."""
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** part)
        return np.asarray(self.low + (self.high - self.low) * part)


@dataclass(frozen=True, eq=False)
class Load:
    """How the load under an object follows from its unknowns.

    Attributes:
        points: (k, 2) that carry it, in the object's own frame, m.
        loads: From the unknowns' values to (k,) parts of the weight.
        unknowns: These.
    """

    points: FloatArray
    loads: Callable[[FloatArray], FloatArray]
    unknowns: tuple[Unknown, ...]


@dataclass(frozen=True, eq=False)
class Unknowns:
    """All unknown numbers of a world, in one order: contacts' friction, floor ratios, loads, floor friction.

    Attributes:
        world: What is stated; its loads are known (some, where they are to be found).
        packed: It as it is pushed.
        loads: One an object.
        each: All unknowns.
        absolute: Whether the first object's floor friction is one, the last: forces were measured.
    """

    world: World
    packed: slip.World
    loads: tuple[Load, ...]
    each: tuple[Unknown, ...]
    absolute: bool

    @classmethod
    def from_world(cls, world: World, absolute: bool = False) -> Unknowns:
        """Return what is not known of a world, were nothing stated but shapes, places and masses.

        Args:
            world: What is stated; floor frictions are looked for around it.
            absolute: Whether the first object's floor friction is to be found, too, not only ratios to it.
        """
        chain = world.chain
        loads = tuple(_load(i, obj) for i, obj in enumerate(chain.objects))
        for obj, load in zip(chain.objects, loads, strict=True):
            even = load.loads(np.array([0.5 * (u.low + u.high) for u in load.unknowns]))
            world = world.with_support(FeetSupport(load.points, even), obj.name)
        frictions = [
            Unknown("contact_friction", k, f"friction of {chain.contact_name(k)}", *FRICTION)
            for k in range(len(chain.contacts))
        ]
        first = chain.objects[0]
        ratios = [
            Unknown("floor_ratio", i, f"floor friction of {obj.name} over {first.name}", *_ratio(world, i), True)
            for i, obj in enumerate(chain.objects)
            if i > 0
        ]
        of_loads = [unknown for load in loads for unknown in load.unknowns]
        ends = (RATIO[0] * first.floor_friction, RATIO[1] * first.floor_friction)
        scale = [Unknown("floor_friction", 0, f"floor friction of {first.name}", *ends, True)] * absolute
        each = (*frictions, *ratios, *of_loads, *scale)
        return cls(world, pack_world(world, world.chain), loads, each, absolute)

    def values(self, parts: FloatArray) -> FloatArray:
        """Return the values (..., p) at places (..., p) in the unit cube."""
        return np.stack([one.value(parts[..., k]) for k, one in enumerate(self.each)], axis=-1)

    def fractions(self, values: FloatArray) -> list[FloatArray]:
        """Return the parts of the weight on the points under every object, for values (p,)."""
        ends = np.cumsum([0, *(len(load.unknowns) for load in self.loads)]) + 2 * len(self.loads) - 1
        spans = zip(self.loads, ends[:-1], ends[1:], strict=True)
        return [load.loads(values[a:b]) for load, a, b in spans]

    def friction_loads(self, values: FloatArray) -> FloatArray:
        """Return coefficient times weight of every object (..., n), N, for values (..., p)."""
        n, obj = len(self.loads), self.world.chain.objects[0]
        scale = values[..., -1:] / obj.floor_friction if self.absolute else np.ones((*values.shape[:-1], 1))
        first = obj.friction_load * scale
        return np.concatenate([first, first * values[..., n : 2 * n - 1]], axis=-1)

    def packed_for(self, values: FloatArray) -> slip.World:
        """Return the world that has these values (p,), as it is pushed."""
        weights, fractions = self.friction_loads(values), self.fractions(values)
        feet = np.concatenate([w * f for w, f in zip(weights, fractions, strict=True)])
        return self.packed.with_loads(weights, feet, values[: len(self.world.chain.contacts)])

    def world_for(self, values: FloatArray) -> World:
        """Return the world that has these values (p,)."""
        chain = self.world.chain
        weights, fractions = self.friction_loads(values), self.fractions(values)
        objects = tuple(
            replace(
                obj,
                floor_friction=float(weight / obj.friction_load * obj.floor_friction),
                support=FeetSupport(load.points, part),
            )
            for obj, load, weight, part in zip(chain.objects, self.loads, weights, fractions, strict=True)
        )
        contacts = tuple(replace(contact, friction=float(values[k])) for k, contact in enumerate(chain.contacts))
        return replace(self.world, chain=replace(chain, objects=objects, contacts=contacts))


def _ratio(world: World, i: int) -> tuple[float, float]:
    objects = world.chain.objects
    stated = objects[i].friction_load / objects[0].friction_load
    return RATIO[0] * stated, RATIO[1] * stated


def _load(i: int, obj: PushedObject) -> Load:
    """Return what is not known of the load under object i."""
    support = obj.support
    if isinstance(support, FeetSupport) and len(support.positions) <= MOST_FEET:
        names = [f"load of foot {k + 1} of {obj.name}" for k in range(len(support.positions) - 1)]
        feet = tuple(Unknown("foot", i, name, 0.0, 1.0) for name in names)
        return Load(support.positions, _broken_stick, feet)
    tilts = tuple(
        Unknown("tilt", i, f"tilt of the load of {obj.name} along {axis}", -MOST_TILT, MOST_TILT) for axis in "xy"
    )
    on_points = support.known and not isinstance(support, UniformSupport)
    if on_points or isinstance(support, FeetSupport):
        points = support.point_loads.positions if on_points else support.carriers[0]
        stated = support.point_loads.fractions if on_points else np.full(len(points), 1.0 / len(points))
        middle, half = 0.5 * (points.max(axis=0) + points.min(axis=0)), 0.5 * np.ptp(points, axis=0)
        across = (points - middle) / np.maximum(half, 1e-9)
        return Load(points, lambda values: _normalised(stated * (1.0 + across @ values)), tilts)
    if not isinstance(support, UniformSupport):  # an unknown pressure begins as the affine one with its centre
        support = UniformSupport(obj.outline, getattr(support, "center_of_mass", support.center))
    pressed = PressedOutline.from_outline(obj.outline, support)
    border = Unknown("border", i, f"share of the load on the border of {obj.name}", 0.0, MOST_BORDER)
    return Load(pressed.points, lambda values: pressed.loads(float(values[0]), values[1:]), (border, *tilts))


def _normalised(loads: FloatArray) -> FloatArray:
    return np.asarray(loads / loads.sum())


def _broken_stick(parts: FloatArray) -> FloatArray:
    """Return loads of k feet (k,), all alike likely, for places (k - 1,) in the unit cube."""
    k = len(parts) + 1
    left, loads = 1.0, []
    for j, part in enumerate(np.clip(parts, 1e-4, 1.0 - 1e-4)):
        broken = left * (1.0 - (1.0 - part) ** (1.0 / (k - 1 - j)))
        loads.append(broken)
        left -= broken
    return np.array([*loads, left])
