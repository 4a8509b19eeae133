"""The force with which the plate pushes all objects, against the floor and inertia, at worst.

The plate transmits what all objects together ask for, F = sum_i f_i + m_i a_i, f_i being what slides object i over
the floor. Where loads or frictions are intervals, f_i is linear in the friction load F_i and in the parts of it, so
that |F|, a convex function of them, is largest at a corner of what they may be. While no two f_i are more than 90 deg
apart, that is the one with all F_i at their largest: d|F| / dF_i = f_i . F / (F_i |F|) >= 0. So a disc bounds F,

    |F - sum_i mid(F_i) w_i| <= sum_i half(F_i) |w_i| + max(F_i) r_i,

w_i being what a unit load asks for and r_i by how much its parts may change that; where all f_i point the same way,
the corner is on its edge. No pressure makes friction larger than the friction load, which bounds |F| as well and is
exact for translations. Where only the centre of a load is known, all of it may rest there, so that no turn, but one
about it, takes less: the sum of the friction loads stands for |F|.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

import pushplan.core.uncertain as uncertain
from pushplan.mechanics.chain import PLATE
from pushplan.mechanics.dynamics import ContactDynamics, MotionConditions, Wrenches
from pushplan.mechanics.sphere import by_direction
from pushplan.util.arrays import FloatArray

DIRECTIONS = 32
"""In which a force is compared with a limit, so that the comparison is linear; a multiple of 4."""

_ANGLES = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
_UNIT = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
_INSCRIBED = float(np.cos(np.pi / DIRECTIONS))
"""Every force of size 1 reaches at least this far in one of the directions: up to 0.5 % of a limit stay unused."""


@dataclass(frozen=True, eq=False)
class PushForce:
    """The largest `|F_xy|` (N) with which the plate pushes a load, over all that its loads and frictions may be.

    Attributes:
        dynamics: Of the load; tells what is known of it.
    """

    dynamics: ContactDynamics

    @cached_property
    def most_friction(self) -> float:
        """Sum of the friction loads, the largest of intervals: no push at constant twist takes more, N."""
        own = self.dynamics
        if own.interval is not None:
            return float(own.interval.loads[:, 1].sum())
        return float(sum(obj.friction_load for obj in own.chain.objects))

    def steady(self, twists: FloatArray) -> FloatArray:
        """Return the force (m,) of pushing slowly at body twists (m, 3) in the chain frame, none of them zero."""
        return np.asarray(np.minimum(_largest(self.against_floor(twists)), self.most_friction))

    def moving(self, twists: FloatArray, rates: FloatArray, known: FloatArray | None = None) -> FloatArray:
        """Return the force (m,) at body twists (m, 3), none of them zero, with their time derivatives (m, 3).

        Args:
            twists: V.
            rates: dV/dt.
            known: (m, n, 3) what the contacts transmit at the twists without inertia, if known.
        """
        own = None if known is None or not self.dynamics.exact else self._on_plate(known)
        floor = self.against_floor(twists) if own is None else own
        inertia = self.against_inertia(twists, rates)
        return np.asarray(np.minimum(_largest(floor + inertia), self.most_friction + _largest(inertia)))

    def against_floor(self, twists: FloatArray) -> FloatArray:
        """Return what floor friction asks for as discs (m, 3): middle x, y and radius, N."""
        own = self.dynamics
        if own.exact:
            return self._on_plate(own.floor_wrenches(twists))
        if own.loads.free.any():
            return np.tile([0.0, 0.0, self.most_friction], (len(twists), 1))
        length = own.chain.characteristic_length
        return by_direction(lambda v: uncertain.forces_of(own.loads, v), twists, length)

    def against_inertia(self, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return likewise what inertia asks for (m, 3)."""
        own = self.dynamics
        if own.interval is not None:
            return own.interval_inertia.forces(twists, rates)
        return self._on_plate(own.mass_wrenches(twists, rates))

    def _on_plate(self, wrenches: FloatArray) -> FloatArray:
        """Return the force (m, 3) of the plate, known, given the wrenches of contacts (m, n, 3)."""
        plate = [k for k, contact in enumerate(self.dynamics.chain.contacts) if contact.pusher == PLATE]
        return np.asarray(wrenches[:, plate].sum(axis=1) * [1.0, 1.0, 0.0])


def _largest(discs: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(discs[:, 0], discs[:, 1]) + discs[:, 2])


@dataclass(frozen=True, eq=False)
class ForceConditions(MotionConditions):
    """That the plate need not push with more than a force; rows are grouped in fours, like those of contacts.

    Attributes:
        force: Of the load.
        limit: N.
    """

    force: PushForce
    limit: float

    def quasi_static(self, twists: FloatArray) -> Wrenches:
        """Return what the floor's friction leaves of the limit."""
        reach = _reach(self.force.against_floor(twists))
        return _rows(_INSCRIBED * self.limit - np.minimum(reach, self.force.most_friction))

    def rows_of_inertia(self, sliding: FloatArray, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return what inertia takes of it."""
        del sliding  # friction is no larger where inertia moves loads
        return _rows(-_reach(self.force.against_inertia(twists, rates)))


def _reach(discs: FloatArray) -> FloatArray:
    """Return how far discs (m, 3) reach in the directions (m, 32), N."""
    return np.asarray(discs[:, :2] @ _UNIT.T + discs[:, 2:])


def _rows(rows: FloatArray) -> Wrenches:
    return Wrenches(rows.reshape(len(rows), -1, 4), np.zeros((len(rows), DIRECTIONS // 4)))
