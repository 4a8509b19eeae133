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

from dataclasses import replace

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import GRAVITY, Chain, PushedObject
from pushplan.mechanics.contacts.carried import carried_objects
from pushplan.mechanics.contacts.contact_kernel import object_wrenches_of
from pushplan.mechanics.friction.packed import contact_rows, pack_object
from pushplan.mechanics.inertia import Inertia, InertiaTable, inertia_of, inertia_per_object
from pushplan.mechanics.support import FeetSupport
from pushplan.mechanics.worst_case.interval_chain import IntervalChain
from pushplan.mechanics.worst_case.pressure_error import Loss, PressureError


class _Sums:
    """Adds up the least rows (m, n, 4) of all contacts and a bound (m, n) of their wrenches, object by object."""

    def __init__(self, interval: IntervalChain, count: int) -> None:
        chain = interval.chain
        self._carried = carried_objects(chain)
        self._facets = contact_facets(chain)
        n = len(chain.contacts)
        self._least = np.zeros((count, n, 4))
        self._middle, self._spread = np.zeros((count, n, 3)), np.zeros((count, n))

    def facets_behind(self, i: int) -> FloatArray:
        """Return the facets (j, 3) of the contacts that carry object i."""
        return self._facets[self._carried[:, i]].reshape(-1, 3)

    def add(self, i: int, parts: FloatArray, spans: FloatArray, span: FloatArray, loss: Loss | None) -> None:
        """Add what object i does: a factor in `span` (2,) times parts (m, p, 3) by shares in `spans` (p, 2).

        Less what its pressure, which may be off, can take from it.
        """
        low, high = span
        behind = self._carried[:, i]
        rows = _least(np.einsum("cjd,kpd->kcjp", self._facets[behind], parts), spans)
        center = np.einsum("kpd,p->kd", parts, spans.mean(axis=1))
        lengths = np.linalg.norm(parts, axis=2) @ (0.5 * (spans[:, 1] - spans[:, 0]))
        if loss is not None:
            rows, lengths = rows - loss.rows.reshape(rows.shape), lengths + loss.size
        self._least[:, behind] += np.minimum(low * rows, high * rows)
        self._middle[:, behind] += 0.5 * (low + high) * center[:, None]
        spread = 0.5 * (high - low) * np.linalg.norm(center, axis=1) + high * lengths
        self._spread[:, behind] += spread[:, None]

    def result(self) -> tuple[FloatArray, FloatArray]:
        """Return the least rows, and |sum at the intervals' middles| plus what the rest can add to it."""
        return self._least, np.asarray(np.linalg.norm(self._middle, axis=2) + self._spread)


class IntervalRows:
    """The quasi-static rows of a chain with intervals, ready to be asked many times.

    Raises:
        SupportError: See `packed.pack_object`.
    """

    def __init__(self, interval: IntervalChain) -> None:
        self._interval = interval
        height = interval.chain.pusher.contact_height
        self._packed = [
            [pack_object(part, height) for part in _unit_parts(obj, i in interval.fractions)]
            for i, obj in enumerate(interval.chain.objects)
        ]
        length = interval.chain.characteristic_length
        self._errors = {
            i: PressureError(interval.chain.objects[i], share, length)
            for i, share in interval.pressures.items()
            if share > 0.0
        }

    @property
    def has_pressures(self) -> bool:
        """Whether a pressure may be off."""
        return bool(self._errors)

    def least(self, twists: FloatArray, pressures: bool = True) -> tuple[FloatArray, FloatArray]:
        """Return the least rows (m, n, 4) and the largest wrenches (m, n), N, at body twists (m, 3).

        Args:
            twists: In the chain frame, none of them 0.
            pressures: Whether errors of the pressures count.
        """
        sums = _Sums(self._interval, len(twists))
        errors = self._errors if pressures else {}
        for i, span in enumerate(self._interval.loads):
            wrenches = np.stack([object_wrenches_of(part, twists) for part in self._packed[i]], axis=1)
            parts = wrenches / [1.0, 1.0, self._interval.chain.characteristic_length]
            loss = errors[i].losses(twists, sums.facets_behind(i)) if i in errors else None
            sums.add(i, parts, _spans(self._interval, i), span, loss)
        return sums.result()

    def inertia(self, twists: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least that inertia adds to the rows (m, n, 4), and its largest wrenches (m, n), N.

        Where loads are uncertain, the mass of an object is taken to lie where its load is: on feet as masses on
        these, with what they lack of its moment of inertia (or have too much) added at the intervals' middles.

        Args:
            twists: (m, 3) body twists in the chain frame.
            rates: (m, 3) their time derivatives.
        """
        interval = self._interval
        sums = _Sums(interval, len(twists))
        for i, obj in enumerate(interval.chain.objects):
            masses = _unit_masses(obj, interval.fractions.get(i))
            wrenches = inertia_per_object(masses, twists, rates)
            parts = wrenches / [1.0, 1.0, interval.chain.characteristic_length]
            errors = self._errors.get(i)
            loss = None if errors is None else errors.inertia_losses(twists, rates, sums.facets_behind(i))
            sums.add(i, parts, _spans(interval, i), interval.mass[i], loss)
        return sums.result()


def contact_facets(chain: Chain) -> FloatArray:
    """Return the unit facets g (n, 4, 3) of all contacts' wrench cones, g . (f_x, f_y, m / length)."""
    length = chain.characteristic_length
    return np.array([contact_rows(contact, length) for contact in chain.contacts])


def _spans(interval: IntervalChain, i: int) -> FloatArray:
    """Return the intervals (p, 2) of the load fractions of object i."""
    return interval.fractions.get(i, np.ones((1, 2)))


def _unit_masses(obj: PushedObject, spans: FloatArray | None) -> InertiaTable:
    """Return an object of 1 kg, or 1 kg on each of its feet (p,), with the moments that make up for it."""
    whole = inertia_of(replace(obj, mass=1.0))
    if spans is None or not isinstance(obj.support, FeetSupport):
        return _table([whole])
    feet = transform_points(obj.pose_chain, obj.support.positions)
    middle = spans.mean(axis=1) / spans.mean(axis=1).sum()
    about_center = float(middle @ np.square(feet - middle @ feet).sum(axis=1))
    return _table([Inertia(1.0, foot, whole.moment - about_center) for foot in feet])


def _table(parts: list[Inertia]) -> InertiaTable:
    return InertiaTable(*(np.array(column) for column in zip(*parts, strict=True)))


def _unit_parts(obj: PushedObject, apart: bool) -> list[PushedObject]:
    """Return the object with a unit friction load, or each of its feet with one."""
    if obj.floor_friction > 0.0:
        unit = replace(obj, mass=1.0 / (obj.floor_friction * GRAVITY))
    else:
        unit = replace(obj, mass=1.0 / GRAVITY, floor_friction=1.0)
    if not (apart and isinstance(obj.support, FeetSupport)):
        return [unit]
    return [replace(unit, support=FeetSupport(foot[None], np.ones(1))) for foot in obj.support.positions]


def _least(values: FloatArray, spans: FloatArray) -> FloatArray:
    """Return the least of sum_p phi_p values (..., p) over fractions in their intervals (p, 2) that sum to 1."""
    if len(spans) == 1:
        return np.asarray(values[..., 0], dtype=np.float64)
    order = np.argsort(values, axis=-1)
    ranked = np.take_along_axis(values, order, axis=-1)
    room = (spans[:, 1] - spans[:, 0])[order]
    left = 1.0 - spans[:, 0].sum() - (np.cumsum(room, axis=-1) - room)
    return np.asarray(
        values @ spans[:, 0] + (ranked * np.clip(left, 0.0, room)).sum(axis=-1), dtype=np.float64
    )
