"""Packs chains with uncertain loads and frictions into arrays for the core.

The wrenches of inertia are linear in the masses, as the wrenches of friction are in the loads. The mass of an object
with an uncertain load is assumed to be distributed like its load.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Sized
from dataclasses import replace
from functools import lru_cache

import numpy as np

import pushplan.core.contacts as contacts
import pushplan.core.uncertain as uncertain
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY, Chain, InertiaTable, PushedObject, inertia_table
from pushplan.mechanics.contacts import carried_objects
from pushplan.mechanics.heights import CELLS_MISS, LoadArea, counts_by_centre, load_areas, loads_move
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.packed import chain_rows, pack_objects
from pushplan.mechanics.perturb import with_objects
from pushplan.mechanics.support import FeetSupport
from pushplan.util.arrays import FloatArray, IntArray

_AT_ONCE = 1 << 20
"""Largest size of the table of inertia wrenches at points, in numbers."""

_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def pack_loads(chain: Chain, interval: IntervalChain | None) -> uncertain.PackedLoads:
    """Return a chain as arrays; loads that pushes or inertia shift are reduced to their centres.

    Raises:
        SupportError: See `pack_intervals` and `pack_centred`.
    """
    if interval is None or counts_by_centre(chain, interval):
        return pack_centred(chain, interval, off=True)
    return pack_intervals(interval)


@lru_cache(maxsize=16)  # sets, checks and limits of a plan all use the same arrays
def pack_intervals(interval: IntervalChain) -> uncertain.PackedLoads:
    """Return a chain with intervals as arrays: feet, cells of uncertain pressures, and known loads.

    Raises:
        SupportError: See `packed.pack_chain`.
    """
    return _pack(interval.chain, interval.loads, interval, [])


def pack_centred(chain: Chain, interval: IntervalChain | None = None, off: bool = False) -> uncertain.PackedLoads:
    """Return a chain as arrays, with every load reduced to its centre.

    Loads on feet with intervals are kept if nothing shifts them. See `heights.load_areas` for `off`.

    Raises:
        SupportError: If a push at the contact heights can tip an object.
    """
    loads = np.array([[obj.friction_load, obj.friction_load] for obj in chain.objects])
    areas: list[LoadArea | None] = list(load_areas(chain, interval, off))
    if interval is not None and not loads_move(chain):
        for i in interval.fractions:
            areas[i] = None
    return _pack(chain, loads if interval is None else interval.loads, interval, areas)


def _pack(
    chain: Chain, loads: FloatArray, interval: IntervalChain | None, areas: Sequence[LoadArea | None]
) -> uncertain.PackedLoads:
    """Return the arrays; only the centre of the load is used for objects with an area."""
    n = len(chain.objects)
    known: list[PushedObject] = []
    unit, points, total, miss = np.full(n, -1), list[FloatArray](), np.ones(n), np.zeros((n, 2))
    for i, obj in enumerate(chain.objects):
        spans = None if interval is None else interval.fractions.get(i)
        error = 0.0 if interval is None or areas else interval.pressures.get(i, 0.0)
        own = np.zeros((0, 4))
        if areas and areas[i] is not None:
            pass
        elif spans is not None and isinstance(obj.support, FeetSupport):
            own = np.column_stack([transform_points(obj.pose_chain, obj.support.positions), spans])
        else:
            unit[i] = len(known)
            known.append(_unit(obj))
            if error > 0.0:
                places, parts = obj.support.cells()
                off = error * parts
                own = np.column_stack([transform_points(obj.pose_chain, places), -off, off])
                total[i], miss[i] = 0.0, (CELLS_MISS[0], error * CELLS_MISS[1])
        points.append(own)
    corners = [np.zeros((0, 2)) if area is None else area.points - area.center for area in areas or [None] * n]
    units = pack_objects(known or [_nothing()], chain.contact_height if known else 0.0)
    return uncertain.PackedLoads(
        units=units,
        unit=unit,
        points=np.concatenate(points),
        first=_firsts(points),
        total=total,
        miss=miss,
        centers=np.array([_center(area) for area in areas or [None] * n]),
        free=np.array([0 if area is None else 1 + int(area.solid) for area in areas or [None] * n]),
        corners=np.concatenate(corners),
        corner=_firsts(corners),
        centred=any(area is not None for area in areas),
        loads=loads,
        carried=carried_objects(chain),
        facets=chain_rows(chain),
        length=chain.characteristic_length,
    )


def _center(area: LoadArea | None) -> list[float]:
    """Return a row of `PackedLoads.centers`; its small offset points inside, but along no diagonal."""
    if area is None:
        return [0.0] * 8
    weights = 1.0 + (np.arange(1, len(area.points) + 1) * _GOLDEN) % 1.0
    nudge = 1e-10 * (weights @ area.points / weights.sum() - area.center)
    return [*area.center, area.shift, *nudge, area.more, *area.drift]


def _firsts(groups: Sequence[Sized]) -> IntArray:
    """Return the index at which each group begins in their concatenation, and the index of the end."""
    return np.cumsum([0, *map(len, groups)])


def _unit(obj: PushedObject) -> PushedObject:
    """Return the object with a unit friction load."""
    if obj.floor_friction > 0.0:
        return replace(obj, mass=1.0 / (obj.floor_friction * GRAVITY))
    return replace(obj, mass=1.0 / GRAVITY, floor_friction=1.0)


def _nothing() -> PushedObject:
    """Return a dummy object, because the core does not accept an empty chain."""
    foot = np.zeros((1, 2))
    return PushedObject("nothing", foot, 1.0, 1.0 / GRAVITY, FeetSupport(foot, np.ones(1)), np.zeros(3))


class IntervalInertia:
    """Wrenches of inertia in the worst case over intervals of masses and loads.

    The mass of an object on feet with intervals is distributed on the feet. Its moment of inertia is corrected at the
    middles of the intervals.
    """

    def __init__(self, interval: IntervalChain) -> None:
        floor = replace(interval, chain=interval.chain.at_floor())
        packed = _pack(floor.chain, interval.loads, floor, [])
        self._packed = packed.without_miss()
        self._masses = interval.mass
        self._known = inertia_table(with_objects(interval.chain, None, mass=1.0))
        moments = [np.zeros(0)] * len(interval.chain.objects)
        for i in range(len(moments)):
            own = packed.points[packed.first[i] : packed.first[i + 1]]
            moments[i] = np.zeros(len(own))
            if len(own) and packed.total[i] > 0.0:
                middle = own[:, 2:].mean(axis=1) / own[:, 2:].mean(axis=1).sum()
                about = float(middle @ np.square(own[:, :2] - middle @ own[:, :2]).sum(axis=1))
                moments[i] = np.full(len(own), self._known.moment[i] - about)
        places = np.ascontiguousarray(packed.points[:, :2])
        self._points = InertiaTable(np.ones(len(places)), places, np.concatenate(moments))

    def rows(self, twists: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the smallest contribution of inertia to the rows (m, n, 4), and its largest wrenches (m, n), N.

        Args:
            twists: Body twists (m, 3) in the chain frame.
            rates: Time derivatives (m, 3) of the twists.
        """
        parts = self._wrenches(twists, rates)
        found = [uncertain.inertia_rows_of(self._packed, self._masses, *part) for part in parts]
        return np.concatenate([rows for rows, _ in found]), np.concatenate([size for _, size in found])

    def forces(self, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the total forces (m, 3) on all objects as discs; see `core.uncertain.forces_of`."""
        parts = self._wrenches(twists, rates)
        return np.concatenate([uncertain.inertia_forces_of(self._packed, self._masses, *part) for part in parts])

    def _wrenches(self, twists: FloatArray, rates: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield the wrenches of 1 kg of each object and of 1 kg at each point, for a few motions at a time."""
        step = max(_AT_ONCE // (3 * max(len(self._points.mass), 1)), 1)
        for i in range(0, max(len(twists), 1), step):
            v, dv = twists[i : i + step], rates[i : i + step]
            yield (contacts.inertia_per_object(self._known, v, dv), contacts.inertia_per_object(self._points, v, dv))
