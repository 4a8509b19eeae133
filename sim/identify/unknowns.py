"""Unknown parameters of a chain as points of the unit cube, and the packed world for such a point.

Even pressure under a flat plate is rare. Edges wear and bend, part of the load moves to the border, and the centre of
pressure is seldom the centroid.
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
"""Largest tilt: both tilts together leave a tenth of the pressure at the lightest corner."""
_LEAST = 1e-4
"""Smallest load of a point as a share of the mean load: the same points then carry load for all parameters."""


@dataclass(frozen=True, eq=False)
class PressedOutline:
    """Points inside and along an outline, and their loads for a border share and tilts.

    Attributes:
        points: Points in the object's own frame, m, (k, 2).
        inside: Loads without a border, (k,), summing to 1.
        edge: Loads of a border that carries everything, (k,), summing to 1.
        across: Coordinates of the points over the outline's extent along x and y, -1 to 1, (k, 2).
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
            outline: Vertices, m, (v, 2).
            support: Pressure without border and tilts; None for even pressure.
            degree: Degree up to which the points inside match the moments of that pressure.
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
            tilts: Relative growth of the pressure over half of the outline's extent, along x and y, (2,).
        """
        flat = (1.0 - border) * self.inside + border * self.edge
        loads = np.maximum(flat * (1.0 + self.across @ tilts), _LEAST / len(flat))
        return np.asarray(loads / loads.sum())

    def support(self, border: float, tilts: FloatArray) -> FeetSupport:
        """Return the points with their loads."""
        return FeetSupport(self.points, self.loads(border, tilts))


FRICTION = (0.02, 1.0)
RATIO = (0.25, 4.0)
"""Range of the friction load (coefficient times weight) of an object over the first's, times the nominal ratio."""
MODEL_ERROR = 0.06
"""Relative error of the model that all pushes share: from motions, the friction of real pushes is 6 % lower than from
forces (`benchmarks/stable_pushes.py`)."""
MOST_FEET = 6
"""Largest number of feet that keep their stated loads or get one unknown load each; more feet, and pressure maps, get
two unknown tilts."""


LOADS = ("border", "tilt", "foot")
"""Kinds of unknowns that determine the load under an object."""


@dataclass(frozen=True)
class Unknown:
    """An unknown number whose prior is uniform between two limits.

    Attributes:
        kind: `contact_friction`, `floor_ratio`, `border`, `tilt`, `foot` or `floor_friction`.
        of: Index of the contact or object.
        name: Name in tables and messages.
        low: Smallest value.
        high: Largest value.
        logarithmic: Whether the logarithm is uniform instead of the number.
    """

    kind: str
    of: int
    name: str
    low: float
    high: float
    logarithmic: bool = False

    def value(self, part: FloatArray) -> FloatArray:
        """Return the values at shares (...) of the range from `low` to `high`."""
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** part)
        return np.asarray(self.low + (self.high - self.low) * part)

    def share(self, values: FloatArray) -> FloatArray:
        """Return the shares (...) of the range from `low` to `high` at values; the inverse of `value`."""
        if self.logarithmic:
            return np.asarray(np.log(values / self.low) / np.log(self.high / self.low))
        return np.asarray((values - self.low) / (self.high - self.low))

    def unit(self, value: float) -> float:
        """Return the change of the part from `low` to `high` that counts as a relative change of 1 of a value.

        Loads differ less between pushes than frictions: there it is a quarter of what is possible.
        """
        if self.kind in LOADS:
            return 0.25
        return 1.0 / float(np.log(self.high / self.low)) if self.logarithmic else value / (self.high - self.low)


@dataclass(frozen=True, eq=False)
class Load:
    """Load under an object as a function of its unknowns.

    Attributes:
        points: Points that carry the load, in the object's own frame, m, (k, 2).
        loads: Function from the values of the unknowns to shares of the weight (k,).
        unknowns: Unknowns of this load.
    """

    points: FloatArray
    loads: Callable[[FloatArray], FloatArray]
    unknowns: tuple[Unknown, ...]


@dataclass(frozen=True, eq=False)
class Unknowns:
    """All unknown numbers of a world, in this order: contact friction, floor ratios, loads, floor friction.

    Attributes:
        world: Nominal world; unknown loads are replaced by the middle of their ranges.
        packed: The same world, packed for `core.slip`.
        loads: Load of each object.
        each: All unknowns.
        absolute: Whether the floor friction of the first object is unknown, too; this needs measured forces.
    """

    world: World
    packed: slip.World
    loads: tuple[Load, ...]
    each: tuple[Unknown, ...]
    absolute: bool

    @classmethod
    def from_world(cls, world: World, absolute: bool = False) -> Unknowns:
        """Return the unknowns of a world of which only shapes, poses, masses and stated loads of feet are known.

        Args:
            world: Nominal world; its floor frictions are the centre of the search.
            absolute: Whether the floor friction of the first object is unknown, not only the ratios to it.
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

    def with_model_error(self, values: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return values (..., p) with frictions spread by `MODEL_ERROR`."""
        friction = np.array([one.kind not in LOADS for one in self.each])
        spread = np.exp(MODEL_ERROR * friction * rng.standard_normal(values.shape))
        ends = np.array([(one.low, one.high) for one in self.each]).T
        return np.asarray(np.clip(values * spread, *ends))

    def units(self, parts: FloatArray) -> FloatArray:
        """Return the change of each of parts (p,) in the unit cube that counts as a relative change of 1."""
        values = self.values(parts)
        return np.array([one.unit(float(value)) for one, value in zip(self.each, values, strict=True)])

    def values(self, parts: FloatArray) -> FloatArray:
        """Return the values (..., p) at points (..., p) of the unit cube."""
        return np.stack([one.value(parts[..., k]) for k, one in enumerate(self.each)], axis=-1)

    def fractions(self, values: FloatArray) -> list[FloatArray]:
        """Return the shares of the weight on the points under every object, for values (p,)."""
        ends = np.cumsum([0, *(len(load.unknowns) for load in self.loads)]) + 2 * len(self.loads) - 1
        spans = zip(self.loads, ends[:-1], ends[1:], strict=True)
        return [load.loads(values[a:b]) for load, a, b in spans]

    def friction_loads(self, values: FloatArray) -> FloatArray:
        """Return the friction load (coefficient times weight) of every object (..., n), N, for values (..., p)."""
        n, obj = len(self.loads), self.world.chain.objects[0]
        scale = values[..., -1:] / obj.floor_friction if self.absolute else np.ones((*values.shape[:-1], 1))
        first = obj.friction_load * scale
        return np.concatenate([first, first * values[..., n : 2 * n - 1]], axis=-1)

    def packed_for(self, values: FloatArray) -> slip.World:
        """Return the packed world with these values (p,)."""
        weights, fractions = self.friction_loads(values), self.fractions(values)
        feet = np.concatenate([w * f for w, f in zip(weights, fractions, strict=True)])
        return self.packed.with_loads(weights, feet, values[: len(self.world.chain.contacts)])

    def world_for(self, values: FloatArray) -> World:
        """Return the world with these values (p,)."""
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
    """Return the load under object i with its unknowns."""
    support = obj.support
    if isinstance(support, FeetSupport) and len(support.positions) <= MOST_FEET:
        if (fractions := support.fractions) is not None:
            return Load(support.positions, lambda _: fractions, ())
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
    if not isinstance(support, UniformSupport):  # model an unknown pressure as the affine one with its centre
        support = UniformSupport(obj.outline, getattr(support, "center_of_mass", support.center))
    pressed = PressedOutline.from_outline(obj.outline, support)
    border = Unknown("border", i, f"share of the load on the border of {obj.name}", 0.0, MOST_BORDER)
    return Load(pressed.points, lambda values: pressed.loads(float(values[0]), values[1:]), (border, *tilts))


def _normalised(loads: FloatArray) -> FloatArray:
    return np.asarray(loads / loads.sum())


def _broken_stick(parts: FloatArray) -> FloatArray:
    """Map points (k - 1,) of the unit cube to loads of k feet (k,); uniform points give uniform loads."""
    k = len(parts) + 1
    left, loads = 1.0, []
    for j, part in enumerate(np.clip(parts, 1e-4, 1.0 - 1e-4)):
        broken = left * (1.0 - (1.0 - part) ** (1.0 / (k - 1 - j)))
        loads.append(broken)
        left -= broken
    return np.array([*loads, left])
