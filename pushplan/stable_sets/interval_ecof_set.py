"""Algorithm 1 for all loads and frictions in given intervals.

A row of contact k is sum_i F_i q_i: linear in the friction load F_i = mu_i m_i g of every object, and, with q_i =
sum_j phi_j q_ij, in the load fractions phi_j of its feet. Its least value over a product of intervals is
therefore taken at one of their vertices, and as the F_i are independent it is

    sum_i min over F_i in {low, high} of F_i min over phi of q_i :

the vertices are never enumerated. Of the fractions, which sum to 1, the least comes from giving the smallest
q_ij as much as allowed; a pressure that may be off by a share takes off what `pressure_error` says. A lower
contact friction only takes away from the friction cone, so that the lowest one suffices.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.mechanics.carried import carried_objects
from pushplan.mechanics.chain import GRAVITY, PushedObject
from pushplan.mechanics.contact_kernel import object_wrenches_of
from pushplan.mechanics.interval_chain import IntervalChain
from pushplan.mechanics.packed import contact_rows, pack_object
from pushplan.mechanics.support import FeetSupport
from pushplan.stable_sets.pressure_error import PressureError
from pushplan.stable_sets.stable_set import StableSet

_MANY = 500
"""Twists from which on it pays to look at them without errors of the pressure first."""


class IntervalEcofSet(StableSet):
    """Twists that are in the set `ecof` for all values in the intervals.

    The margin is the least row divided by an upper bound of |w_k|,

        |sum F_i w_i at the intervals' middles| + sum of half their widths times |w_i|:

    at most the margin for any of the values, and equal to it where all intervals are points. The set is exact but for
    pressures, where it errs on the safe side (see `pressure_error`).

    Raises:
        SupportError: See `EcofSet`.
    """

    name = "ecof"

    def __init__(self, interval: IntervalChain) -> None:
        super().__init__(interval.chain)
        length = self.chain.characteristic_length
        self._interval = interval
        self._carried = carried_objects(self.chain)
        self._rows = np.array([contact_rows(contact, length) for contact in self.chain.contacts])
        self._packed = [
            [
                pack_object(part, self.chain.pusher.contact_height)
                for part in _parts(obj, i in interval.fractions)
            ]
            for i, obj in enumerate(self.chain.objects)
        ]
        self._errors = {
            i: PressureError(self.chain.objects[i], share, length)
            for i, share in interval.pressures.items()
            if share > 0.0
        }

    @property
    def loads_known(self) -> bool:
        """False: the contact forces depend on the values."""
        return False

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return self._margins(twists, self._errors)

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); any number up to `floor` for smaller ones.

        Errors of the pressure only take away, so that they are left out where the margin is too small without.
        """
        if not self._errors or len(twists) < _MANY:
            return np.asarray(self._margins(twists, self._errors).min(axis=1), dtype=np.float64)
        margins = np.asarray(self._margins(twists, {}).min(axis=1), dtype=np.float64)
        near = np.flatnonzero(margins > floor)
        if len(near):
            margins[near] = self._margins(twists[near], self._errors).min(axis=1)
        return margins

    def _margins(self, twists: FloatArray, errors: Mapping[int, PressureError]) -> FloatArray:
        least = np.zeros((len(twists), *self._rows.shape[:2]))
        middle, spread = np.zeros((len(twists), len(self._rows), 3)), np.zeros((len(twists), len(self._rows)))
        for i, (low, high) in enumerate(self._interval.loads):
            behind = self._carried[:, i]
            parts, spans = self._unit_wrenches(i, twists), self._spans(i)
            rows = _least(np.einsum("cjd,kpd->kcjp", self._rows[behind], parts), spans)
            center = np.einsum("kpd,p->kd", parts, spans.mean(axis=1))
            lengths = np.linalg.norm(parts, axis=2) @ (0.5 * (spans[:, 1] - spans[:, 0]))
            if i in errors:
                loss = errors[i].losses(twists, self._rows[behind].reshape(-1, 3))
                rows, lengths = rows - loss.rows.reshape(rows.shape), lengths + loss.size
            least[:, behind] += np.minimum(low * rows, high * rows)
            middle[:, behind] += 0.5 * (low + high) * center[:, None]
            spread[:, behind] += (0.5 * (high - low) * np.linalg.norm(center, axis=1) + high * lengths)[
                :, None
            ]
        size = np.linalg.norm(middle, axis=2) + spread
        moving = size > 0.0
        return np.where(moving, least.min(axis=2) / np.where(moving, size, 1.0), 0.0)

    def _spans(self, i: int) -> FloatArray:
        """Return the intervals (p, 2) of the load fractions of object i."""
        return self._interval.fractions.get(i, np.ones((1, 2)))

    def _unit_wrenches(self, i: int, twists: FloatArray) -> FloatArray:
        """Return the wrenches (k, p, 3) that move each part of object i with a unit friction load."""
        wrenches = np.stack([object_wrenches_of(part, twists) for part in self._packed[i]], axis=1)
        return wrenches / [1.0, 1.0, self.chain.characteristic_length]


def _parts(obj: PushedObject, apart: bool) -> list[PushedObject]:
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
