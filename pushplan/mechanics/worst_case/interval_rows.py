"""The contact conditions in the worst case over masses, loads and floor frictions in given intervals.

A row of contact k is sum_i F_i q_i: linear in the friction load F_i = mu_i m_i g of every object, and, with q_i =
sum_j phi_j q_ij, in the load fractions phi_j of its feet. Its least value over a product of intervals is
therefore taken at one of their vertices, and as the F_i are independent it is

    sum_i min over F_i in {low, high} of F_i min over phi of q_i :

the vertices are never enumerated. Of the fractions, which sum to 1, the least comes from giving the smallest
q_ij as much as allowed; a pressure that may be off by a share takes off what `pressure_error` says. What inertia
adds is linear in the masses m_i in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import replace
from functools import lru_cache

import numpy as np

from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY, Chain, PushedObject
from pushplan.mechanics.contacts.carried import carried_objects
from pushplan.mechanics.friction.packed import contact_rows, pack_objects
from pushplan.mechanics.inertia import Inertia, InertiaTable, inertia_of, inertia_per_object
from pushplan.mechanics.support import FeetSupport
from pushplan.mechanics.worst_case.interval_chain import IntervalChain
from pushplan.mechanics.worst_case.interval_kernel import (
    PackedIntervals,
    inertia_rows_of,
    quasi_static_rows_of,
)
from pushplan.mechanics.worst_case.load_cells import load_cells
from pushplan.util.arrays import FloatArray, IntArray

_AT_ONCE = 1 << 20
"""Numbers in the table of what inertia asks for in the cells of pressures, at most."""


class IntervalRows:
    """The rows of a chain with intervals, ready to be asked many times.

    Attributes:
        packed: The chain as arrays.

    Raises:
        SupportError: See `packed.pack_chain`.
    """

    def __init__(self, interval: IntervalChain) -> None:
        self.packed = pack_intervals(interval)
        self._masses, self._unit_masses = interval.mass, _unit_masses(interval)
        places = np.ascontiguousarray(self.packed.cells[:, :2])
        self._cells = InertiaTable(np.ones(len(places)), places, np.zeros(len(places)))

    def least(self, twists: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least rows (m, n, 4) and the largest wrenches (m, n), N, at body twists (m, 3).

        Args:
            twists: In the chain frame, none of them 0.
        """
        return quasi_static_rows_of(self.packed, np.ascontiguousarray(twists))

    def inertia(self, twists: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least that inertia adds to the rows (m, n, 4), and its largest wrenches (m, n), N.

        Where loads are uncertain, the mass of an object is taken to lie where its load is: on feet as masses on
        these, with what they lack of its moment of inertia (or have too much) added at the intervals' middles.

        Args:
            twists: (m, 3) body twists in the chain frame.
            rates: (m, 3) their time derivatives.
        """
        step = max(_AT_ONCE // (3 * max(len(self.packed.cells), 1)), 1)
        found = []
        for i in range(0, max(len(twists), 1), step):
            v, dv = np.ascontiguousarray(twists[i : i + step]), np.ascontiguousarray(rates[i : i + step])
            wrenches = inertia_per_object(self._unit_masses, v, dv)
            pulls = inertia_per_object(self._cells, v, dv)
            found.append(inertia_rows_of(self.packed, self._masses, wrenches, pulls))
        return np.concatenate([rows for rows, _ in found]), np.concatenate([size for _, size in found])


@lru_cache(maxsize=16)  # sets, judges and limits of one plan all ask for the same
def pack_intervals(interval: IntervalChain) -> PackedIntervals:
    """Return a chain with intervals as arrays.

    Raises:
        SupportError: See `packed.pack_chain`.
    """
    chain = interval.chain
    parts = [_unit_parts(obj, i in interval.fractions) for i, obj in enumerate(chain.objects)]
    errors = np.array([interval.pressures.get(i, 0.0) for i in range(len(chain.objects))])
    cells = [
        np.column_stack(load_cells(obj)) if error > 0.0 else np.zeros((0, 3))
        for obj, error in zip(chain.objects, errors, strict=True)
    ]
    return PackedIntervals(
        parts=pack_objects([part for some in parts for part in some], chain.pusher.contact_height),
        first_part=_firsts(parts),
        spans=np.concatenate([interval.fractions.get(i, np.ones((1, 2))) for i in range(len(parts))]),
        cells=np.concatenate(cells),
        first_cell=_firsts(cells),
        errors=errors,
        loads=interval.loads,
        carried=carried_objects(chain).astype(np.bool_),
        facets=contact_facets(chain),
        length=chain.characteristic_length,
    )


def contact_facets(chain: Chain) -> FloatArray:
    """Return the unit facets g (n, 4, 3) of all contacts' wrench cones, g . (f_x, f_y, m / length)."""
    length = chain.characteristic_length
    return np.array([contact_rows(contact, length) for contact in chain.contacts])


def _firsts(groups: Sequence[Sized]) -> IntArray:
    """Return where each group begins in all of them together, and where the last one ends."""
    return np.cumsum([0, *map(len, groups)])


def _unit_masses(interval: IntervalChain) -> InertiaTable:
    """Return all parts with 1 kg each: objects, or feet with the moments that make up for what these lack."""
    found = []
    for i, obj in enumerate(interval.chain.objects):
        whole, spans = inertia_of(replace(obj, mass=1.0)), interval.fractions.get(i)
        if spans is None or not isinstance(obj.support, FeetSupport):
            found.append(whole)
            continue
        feet = transform_points(obj.pose_chain, obj.support.positions)
        middle = spans.mean(axis=1) / spans.mean(axis=1).sum()
        about_center = float(middle @ np.square(feet - middle @ feet).sum(axis=1))
        found += [Inertia(1.0, foot, whole.moment - about_center) for foot in feet]
    return _table(found)


def _table(parts: list[Inertia]) -> InertiaTable:
    return InertiaTable(
        np.array([part.mass for part in parts]),
        np.array([part.center for part in parts]),
        np.array([part.moment for part in parts]),
    )


def _unit_parts(obj: PushedObject, apart: bool) -> list[PushedObject]:
    """Return the object with a unit friction load, or each of its feet with one."""
    if obj.floor_friction > 0.0:
        unit = replace(obj, mass=1.0 / (obj.floor_friction * GRAVITY))
    else:
        unit = replace(obj, mass=1.0 / GRAVITY, floor_friction=1.0)
    if not (apart and isinstance(obj.support, FeetSupport)):
        return [unit]
    return [replace(unit, support=FeetSupport(foot[None], np.ones(1))) for foot in obj.support.positions]
