"""Inertia: the contact conditions of moving chains, and the force with which the plate pushes them, at worst.

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

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import pushplan.core.contacts as contacts
import pushplan.core.sphere as sphere
import pushplan.core.uncertain as uncertain
from pushplan.errors import PushplanError
from pushplan.mechanics.chain import GRAVITY, PLATE, Chain, InertiaTable, inertia_table
from pushplan.mechanics.heights import counts_by_centre, inertia_shifts
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.packed import chain_rows, pack_chain
from pushplan.mechanics.sphere import WORTHWHILE, by_direction, checked_twists
from pushplan.mechanics.uncertain import IntervalInertia, pack_centred, pack_loads
from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class DynamicRows:
    """The contact conditions along one twist: alpha + beta s'' + gamma s'^2 > 0 for every entry, for s'' >= 0.

    Where s'' < 0 it is alpha - beta_down s'' + gamma s'^2; beta_down = -beta where all masses are numbers.

    Attributes:
        alpha: (n, 4) quasi-static part for the contacts' facets, N; see `packed.contact_rows`.
        beta: (n, 4) per unit of s''.
        gamma: (n, 4) per unit of s'^2.
        beta_down: (n, 4) per unit of -s''.
    """

    alpha: FloatArray
    beta: FloatArray
    gamma: FloatArray
    beta_down: FloatArray

    def __post_init__(self) -> None:
        for name in ("alpha", "beta", "gamma", "beta_down"):
            object.__setattr__(self, name, frozen(getattr(self, name), (None, 4), name))

    def values(self, speed: float, acceleration: float) -> FloatArray:
        """Return the rows (n, 4), N, at s' = `speed` and s'' = `acceleration`."""
        beta = self.beta if acceleration >= 0.0 else self.beta_down
        return np.asarray(self.alpha + beta * abs(acceleration) + self.gamma * speed**2)


class Wrenches(NamedTuple):
    """What is known of the wrenches of n contacts at m instants.

    Attributes:
        rows: (m, n, 4) least value g . w of every facet, N.
        size: (m, n) largest |w|, moments divided by the chain's characteristic length, N.
    """

    rows: FloatArray
    size: FloatArray

    @property
    def margins(self) -> FloatArray:
        """(m, n) least sine of the angle between a wrench and a facet; 0 where there is no wrench."""
        some = self.size > 0.0
        return np.where(some, self.rows.min(axis=2) / np.where(some, self.size, 1.0), 0.0)

    def plus(self, other: Wrenches) -> Wrenches:
        """Return what is known of the sums with others."""
        return Wrenches(self.rows + other.rows, self.size + other.size)

    def less(self, lost: FloatArray) -> Wrenches:
        """Return those with rows that are less by up to (m, n, 4), N."""
        return Wrenches(self.rows - lost, self.size + lost.max(axis=2))


class MotionConditions(ABC):
    """Conditions on twists and their rates that are linear in what the floor and what inertia ask for."""

    @abstractmethod
    def quasi_static(self, twists: FloatArray) -> Wrenches:
        """Return what the floor asks for at body twists (m, 3), none of them zero."""

    @abstractmethod
    def rows_of_inertia(self, sliding: FloatArray, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return what inertia adds at twists (m, 3) and their time derivatives, objects sliding with `sliding`."""

    def rows(self, twist: ArrayLike, margin: float = 0.0) -> DynamicRows:
        """Return the rows along a constant body twist (3,) per unit of s.

        Args:
            twist: In the chain frame.
            margin: The rows are positive only where the contacts' margins exceed this: from g . w > margin |w|
                with the size of w at most the sum of the sizes of its three parts, so that they stay linear.
        """
        xi = checked_twists(np.asarray(twist, dtype=np.float64)[None])
        return DynamicRows(*(rows[0] for rows in self.rows_along(xi, margin)))

    def rows_along(self, twists: FloatArray, margin: float = 0.0) -> tuple[FloatArray, ...]:
        """Return the arrays (m, n, 4) of `rows`, in the order of its attributes, along checked twists (m, 3)."""
        still = np.zeros_like(twists)
        motions = ((still, twists), (twists, still), (still, -twists))
        parts = (self.quasi_static(twists), *(self.rows_of_inertia(twists, *motion) for motion in motions))
        return tuple(part.rows - margin * part.size[..., None] for part in parts)


@dataclass(frozen=True, eq=False)
class ContactDynamics(MotionConditions):
    """A chain's contact conditions with inertia, ready to be asked many times.

    Attributes:
        chain: Objects and contacts.
        worst_case: Take every quasi-static row as the least over all pressures with the centres of the loads
            (see the stable set `robust`), so that loads need not be known.
        interval: The chain whose masses, loads and floor frictions are intervals; every row is then the least
            for any of them. None where they are numbers. Where pushes above the floor, or inertia, move loads, any
            pressure with the centres that these allow counts (`mechanics.heights`).

    Raises:
        SupportError: If a load is not known, unless the worst case is asked for.
    """

    chain: Chain
    worst_case: bool = False
    interval: IntervalChain | None = None

    def __post_init__(self) -> None:
        _ = self.packed if self.exact else self.loads  # raise where loads are not known or tip

    @cached_property
    def packed(self) -> contacts.PackedChain:
        """The chain as arrays; the loads have to be known."""
        return pack_chain(self.chain)

    @cached_property
    def table(self) -> InertiaTable:
        """Masses, centres of mass and moments of inertia."""
        return inertia_table(self.chain)

    @cached_property
    def facets(self) -> FloatArray:
        """(n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length)."""
        return chain_rows(self.chain)

    @cached_property
    def loads(self) -> uncertain.PackedLoads:
        """The chain as arrays of what its loads may be."""
        if self.worst_case:
            return pack_centred(self.chain, self.interval)
        return pack_loads(self.chain, self.interval)

    @cached_property
    def interval_inertia(self) -> IntervalInertia:
        """What inertia asks for where masses or loads are intervals."""
        assert self.interval is not None
        return IntervalInertia(self.interval)

    @cached_property
    def exact(self) -> bool:
        """Whether wrenches are known, not only bounds of them."""
        return not self.worst_case and self.interval is None and not counts_by_centre(self.chain)

    @cached_property
    def _inertia_shifts(self) -> FloatArray:
        return inertia_shifts(self.chain, self.interval)

    def rows_of_inertia(self, sliding: FloatArray, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return what inertia adds, loads that it moves included, where objects slide with twists (m, 3)."""
        if self.exact:
            return self._exactly(self.inertia_wrenches(twists, rates, sliding))
        return self.inertia(twists, rates).less(self._lost(sliding, twists, rates))

    def _lost(self, sliding: FloatArray, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return what loads that inertia moves take from the rows (m, n, 4) of objects that slide with twists, N."""
        if not self._inertia_shifts.any():
            return np.zeros((1, 1, 4))
        forces = contacts.inertia_per_object(self.table, twists, rates)[..., :2]
        moved = (np.hypot(forces[..., 0], forces[..., 1]) / self.table.mass) @ self._inertia_shifts.T
        return np.asarray(np.einsum("mkji,mi->mkj", self._solved(sliding)[2], moved), dtype=np.float64)

    def _solved(self, twists: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return least rows, sizes and slopes; what is asked for the same twists again, as timing does, is kept."""
        for asked, found in self._last:
            if np.array_equal(asked, twists):
                return found
        owner, first = sphere.directions(twists, self.chain.characteristic_length)
        rows, size, slopes = uncertain.sloped_rows_of(self.loads, twists[first])
        found = rows[owner], size[owner], slopes[owner]
        self._last[:] = [(twists.copy(), found)]
        return found

    @cached_property
    def _last(self) -> list[tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]]:
        return []

    def quasi_static(self, twists: FloatArray) -> Wrenches:
        """Return what the contacts transmit without inertia at body twists (m, 3), none of them zero."""
        if not self.exact and self._inertia_shifts.any():
            return Wrenches(*self._solved(twists)[:2])
        owner, first = sphere.directions(twists, self.chain.characteristic_length)
        if len(first) > WORTHWHILE * len(twists):
            return self._quasi_static(twists)
        return Wrenches(*(values[owner] for values in self._quasi_static(twists[first])))

    def _quasi_static(self, twists: FloatArray) -> Wrenches:
        if self.exact:
            return self._exactly(contacts.wrenches_of(self.packed, twists))
        return Wrenches(*uncertain.rows_of(self.loads, twists))

    def floor_wrenches(self, twists: FloatArray) -> FloatArray:
        """Return what the contacts transmit without inertia (m, n, 3) at twists (m, 3) where loads are known."""
        length = self.chain.characteristic_length
        return by_direction(lambda v: contacts.wrenches_of(self.packed, v), twists, length)

    def inertia(self, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return what the masses add to the contacts' wrenches; see `inertia_wrenches`."""
        if self.interval is None:
            return self._exactly(self.mass_wrenches(twists, rates))
        return Wrenches(*self.interval_inertia.rows(twists, rates))

    def inertia_wrenches(
        self, twists: FloatArray, rates: FloatArray, sliding: FloatArray | None = None
    ) -> FloatArray:
        """Return what inertia adds to the wrench of each contact (m, n, 3), about the chain frame's origin.

        That is what moves the masses, and what loads change that it moves on the floor; they must be known for that.

        Args:
            twists: (m, 3) body twists V.
            rates: (m, 3) their time derivatives dV/dt.
            sliding: (m, 3) twists with which the objects slide over the floor, if not V.
        """
        wrenches = self.mass_wrenches(twists, rates)
        if not self._arms.any():
            return wrenches
        forces = contacts.inertia_per_object(self.table, twists, rates)[..., :2]
        moves = forces * (self._arms / (GRAVITY * self.table.mass))[:, None]
        moved = contacts.moved_wrenches_of(self.packed, twists if sliding is None else sliding, moves)
        return wrenches + self._with_carried(moved)

    @cached_property
    def _arms(self) -> FloatArray:
        """(n,) by how much objects are pushed above their centre of mass, m; 0 where its height is not stated."""
        height = self.chain.contact_height
        objects = self.chain.objects
        return np.array([0.0 if o.center_height is None else height - o.center_height for o in objects])

    def mass_wrenches(self, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return what moves the masses alone (m, n, 3); see `inertia_wrenches`."""
        return self._with_carried(contacts.inertia_per_object(self.table, twists, rates))

    def _with_carried(self, wrenches: FloatArray) -> FloatArray:
        """Add to what each object has (m, n, 3), in place, that of all objects that its contact carries."""
        for k, contact in reversed([*enumerate(self.chain.contacts)]):
            if contact.pusher != PLATE:
                wrenches[:, contact.pusher] += wrenches[:, k]
        return wrenches

    def _exactly(self, wrenches: FloatArray) -> Wrenches:
        """Facet values G . w of transmitted wrenches (m, n, 3), and their sizes."""
        return Wrenches(*contacts.facet_rows(self.facets, wrenches, self.chain.characteristic_length))

    def margins(self, twists: ArrayLike, rates: ArrayLike, floor: FloatArray | None = None) -> FloatArray:
        """Return the margin (m, n) of each contact while the chain moves and accelerates; see `dynamic_margins`.

        Where loads are not known or intervals, it is a lower bound of the margin for all that they may be.

        Args:
            twists: (m, 3) body twists.
            rates: (m, 3) their time derivatives.
            floor: (m, n, 3) what the contacts transmit at the twists without inertia (`contact_state`), if known.
        """
        v = checked_twists(twists)
        dv = np.ascontiguousarray(rates, dtype=np.float64)
        if dv.shape != v.shape or not np.isfinite(dv).all():
            raise PushplanError(f"rates have shape {dv.shape}; they must be finite and like twists: {v.shape}")
        if self.exact:
            wrenches = self.floor_wrenches(v) if floor is None else floor
            return contacts.contact_margins_of(self.packed, wrenches + self.inertia_wrenches(v, dv))
        return self.quasi_static(v).plus(self.rows_of_inertia(v, v, dv)).margins


def dynamic_rows(chain: Chain, twist: ArrayLike) -> DynamicRows:
    """Return the contact conditions of `chain` along a constant body twist (3,), inertia included.

    Args:
        chain: The loads must be known.
        twist: In the chain frame, per unit of the path parameter s; its size is the unit of s.

    Raises:
        PushplanError: On a twist that is zero, not finite or not (3,).
        SupportError: If a load is not known.
    """
    return ContactDynamics(chain).rows(twist)


def dynamic_margins(chain: Chain, twists: ArrayLike, rates: ArrayLike) -> FloatArray:
    """Return the margin (m, n) of each contact of a chain in motion; > 0 exactly where the contact holds.

    The sine of the angle between the contact's wrench, inertia included, and the nearest facet of its cone: at
    rates and speeds towards zero the margin of the quasi-static sets.

    Args:
        chain: The loads must be known.
        twists: (m, 3) body twists in the chain frame, m/s and rad/s; none zero.
        rates: (m, 3) their time derivatives, m/s^2 and rad/s^2.

    Raises:
        PushplanError: On twists that are zero, not finite or not (m, 3), or rates unlike them.
        SupportError: If a load is not known.
    """
    return ContactDynamics(chain).margins(twists, rates)


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
