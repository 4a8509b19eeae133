"""Inertia: the contact conditions of moving chains, and the largest force with which the plate pushes them.

The plate transmits the force F = sum_i f_i + m_i a_i, where f_i is the force that slides object i over the floor. If
loads or frictions are intervals, f_i is linear in the friction load F_i and in its distribution. |F| is convex in
them, so it is largest at a corner of their region. If no two f_i are more than 90 deg apart, this is the corner with
all F_i at their largest: d|F| / dF_i = f_i . F / (F_i |F|) >= 0. Therefore a disc bounds F:

    |F - sum_i mid(F_i) w_i| <= sum_i half(F_i) |w_i| + max(F_i) r_i

w_i is the force for a unit load, and r_i the largest change of it by the load distribution. If all f_i are parallel,
the corner is on the edge of the disc. Friction never exceeds the friction load, which is another bound of |F|, exact
for translations. If only the centre of a load is known, all of it can rest there. Only a rotation about this centre
takes less force, so the sum of the friction loads is used as |F|.
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

    For s'' < 0 they are alpha - beta_down s'' + gamma s'^2 > 0; beta_down = -beta if all masses are plain numbers.

    Attributes:
        alpha: Quasi-static part (n, 4) for the contacts' facets, N; see `packed.contact_rows`.
        beta: Part (n, 4) per unit of s''.
        gamma: Part (n, 4) per unit of s'^2.
        beta_down: Part (n, 4) per unit of -s''.
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
    """Bounds of the wrenches of n contacts at m instants.

    Attributes:
        rows: Smallest value (m, n, 4) of g . w for every facet, N.
        size: Largest |w| (m, n), with moments divided by the chain's characteristic length, N.
    """

    rows: FloatArray
    size: FloatArray

    @property
    def margins(self) -> FloatArray:
        """Smallest sine (m, n) of the angle between a wrench and a facet; 0 if there is no wrench."""
        some = self.size > 0.0
        return np.where(some, self.rows.min(axis=2) / np.where(some, self.size, 1.0), 0.0)

    def plus(self, other: Wrenches) -> Wrenches:
        """Return bounds of the sums with other wrenches."""
        return Wrenches(self.rows + other.rows, self.size + other.size)

    def less(self, lost: FloatArray) -> Wrenches:
        """Return bounds whose rows are reduced by `lost` (m, n, 4), N."""
        return Wrenches(self.rows - lost, self.size + lost.max(axis=2))


class MotionConditions(ABC):
    """Conditions on twists and their rates that are linear in the wrenches of floor friction and inertia."""

    @abstractmethod
    def quasi_static(self, twists: FloatArray) -> Wrenches:
        """Return the wrenches of floor friction at nonzero body twists (m, 3)."""

    @abstractmethod
    def rows_of_inertia(self, sliding: FloatArray, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return the wrenches of inertia at twists (m, 3) with rates (m, 3); objects slide with `sliding` (m, 3)."""

    def rows(self, twist: ArrayLike, margin: float = 0.0) -> DynamicRows:
        """Return the rows along a constant body twist (3,) per unit of s.

        Args:
            twist: Body twist in the chain frame.
            margin: Required margin of the contacts. Its condition is g . w > margin |w|. To keep the rows linear,
                |w| is replaced by the sum of the sizes of its three parts, which is an upper bound.
        """
        xi = checked_twists(np.asarray(twist, dtype=np.float64)[None])
        return DynamicRows(*(rows[0] for rows in self.rows_along(xi, margin)))

    def rows_along(self, twists: FloatArray, margin: float = 0.0) -> tuple[FloatArray, ...]:
        """Return the arrays (m, n, 4) of `DynamicRows`, in its order, along checked twists (m, 3)."""
        still = np.zeros_like(twists)
        motions = ((still, twists), (twists, still), (still, -twists))
        parts = (self.quasi_static(twists), *(self.rows_of_inertia(twists, *motion) for motion in motions))
        return tuple(part.rows - margin * part.size[..., None] for part in parts)


@dataclass(frozen=True, eq=False)
class ContactDynamics(MotionConditions):
    """A chain's contact conditions with inertia, prepared for many evaluations.

    Attributes:
        chain: Objects and contacts.
        worst_case: Whether every quasi-static row is the smallest over all pressures with the centres of the loads
            (see the stable set `robust`), so that loads need not be known.
        interval: Chain with intervals of masses, loads and floor frictions; every row is then the smallest for all
            their values. None for plain numbers. If pushes above the floor or inertia shift loads, every pressure
            with the possible centres is covered (`mechanics.heights`).

    Raises:
        SupportError: If a load is not known and `worst_case` is False.
    """

    chain: Chain
    worst_case: bool = False
    interval: IntervalChain | None = None

    def __post_init__(self) -> None:
        _ = self.packed if self.exact else self.loads  # raises if loads are not known or can tip

    @cached_property
    def packed(self) -> contacts.PackedChain:
        """The chain as arrays; the loads must be known."""
        return pack_chain(self.chain)

    @cached_property
    def table(self) -> InertiaTable:
        """Masses, centres of mass and moments of inertia."""
        return inertia_table(self.chain)

    @cached_property
    def facets(self) -> FloatArray:
        """Unit facets g (n, 4, 3) of the contacts, with rows g . (f_x, f_y, m / length)."""
        return chain_rows(self.chain)

    @cached_property
    def loads(self) -> uncertain.PackedLoads:
        """The chain with its possible loads as arrays."""
        if self.worst_case:
            return pack_centred(self.chain, self.interval)
        return pack_loads(self.chain, self.interval)

    @cached_property
    def interval_inertia(self) -> IntervalInertia:
        """The wrenches of inertia for intervals of masses or loads."""
        assert self.interval is not None
        return IntervalInertia(self.interval)

    @cached_property
    def exact(self) -> bool:
        """Whether the wrenches themselves are known, and not only bounds of them."""
        return not self.worst_case and self.interval is None and not counts_by_centre(self.chain)

    @cached_property
    def _inertia_shifts(self) -> FloatArray:
        return inertia_shifts(self.chain, self.interval)

    def rows_of_inertia(self, sliding: FloatArray, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return the wrenches of inertia, including its shifts of loads; objects slide with `sliding` (m, 3)."""
        if self.exact:
            return self._exactly(self.inertia_wrenches(twists, rates, sliding))
        return self.inertia(twists, rates).less(self._lost(sliding, twists, rates))

    def _lost(self, sliding: FloatArray, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the reduction of the rows (m, n, 4) by loads that inertia shifts, N."""
        if not self._inertia_shifts.any():
            return np.zeros((1, 1, 4))
        forces = contacts.inertia_per_object(self.table, twists, rates)[..., :2]
        moved = (np.hypot(forces[..., 0], forces[..., 1]) / self.table.mass) @ self._inertia_shifts.T
        return np.asarray(np.einsum("mkji,mi->mkj", self._solved(sliding)[2], moved), dtype=np.float64)

    def _solved(self, twists: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return smallest rows, sizes and slopes; the last result is kept, because timing repeats twists."""
        for known, found in self._last:
            if np.array_equal(known, twists):
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
        """Return the wrenches without inertia at nonzero body twists (m, 3)."""
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
        """Return the wrenches (m, n, 3) without inertia at twists (m, 3), for known loads."""
        length = self.chain.characteristic_length
        return by_direction(lambda v: contacts.wrenches_of(self.packed, v), twists, length)

    def inertia(self, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return the wrenches that accelerate the masses; see `inertia_wrenches`."""
        if self.interval is None:
            return self._exactly(self.mass_wrenches(twists, rates))
        return Wrenches(*self.interval_inertia.rows(twists, rates))

    def inertia_wrenches(
        self, twists: FloatArray, rates: FloatArray, sliding: FloatArray | None = None
    ) -> FloatArray:
        """Return the contribution of inertia to each contact's wrench (m, n, 3), about the chain frame's origin.

        It consists of the wrenches that accelerate the masses, and the change of friction by loads that inertia
        shifts. For the latter the loads must be known.

        Args:
            twists: Body twists V (m, 3).
            rates: Time derivatives dV/dt (m, 3).
            sliding: Twists (m, 3) with which the objects slide over the floor; None for V.
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
        """Heights of the push above the centres of mass (n,), m; 0 for centres of unknown height."""
        height = self.chain.contact_height
        objects = self.chain.objects
        return np.array([0.0 if o.center_height is None else height - o.center_height for o in objects])

    def mass_wrenches(self, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the wrenches (m, n, 3) that accelerate the masses, without load shifts; see `inertia_wrenches`."""
        return self._with_carried(contacts.inertia_per_object(self.table, twists, rates))

    def _with_carried(self, wrenches: FloatArray) -> FloatArray:
        """Add to each object's wrench (m, n, 3), in place, the wrenches of all objects that its contact carries."""
        for k, contact in reversed([*enumerate(self.chain.contacts)]):
            if contact.pusher != PLATE:
                wrenches[:, contact.pusher] += wrenches[:, k]
        return wrenches

    def _exactly(self, wrenches: FloatArray) -> Wrenches:
        """Return the facet values G . w of wrenches (m, n, 3), and their sizes."""
        return Wrenches(*contacts.facet_rows(self.facets, wrenches, self.chain.characteristic_length))

    def margins(self, twists: ArrayLike, rates: ArrayLike, floor: FloatArray | None = None) -> FloatArray:
        """Return the margin (m, n) of each contact while the chain moves and accelerates; see `dynamic_margins`.

        For unknown loads and intervals, it is a lower bound of the margin for all possible values.

        Args:
            twists: Body twists (m, 3).
            rates: Time derivatives (m, 3) of the twists.
            floor: Wrenches (m, n, 3) of the contacts without inertia (`contact_state`); None to compute them.
        """
        v = checked_twists(twists)
        dv = np.ascontiguousarray(rates, dtype=np.float64)
        if dv.shape != v.shape or not np.isfinite(dv).all():
            raise PushplanError(f"rates have shape {dv.shape}; they must be finite and have the shape {v.shape}")
        if self.exact:
            wrenches = self.floor_wrenches(v) if floor is None else floor
            return contacts.contact_margins_of(self.packed, wrenches + self.inertia_wrenches(v, dv))
        return self.quasi_static(v).plus(self.rows_of_inertia(v, v, dv)).margins


def dynamic_rows(chain: Chain, twist: ArrayLike) -> DynamicRows:
    """Return the contact conditions of `chain` along a constant body twist (3,), inertia included.

    Args:
        chain: Chain with known loads.
        twist: Body twist in the chain frame per unit of the path parameter s; its size defines the unit of s.

    Raises:
        PushplanError: If the twist is zero, not finite or not (3,).
        SupportError: If a load is not known.
    """
    return ContactDynamics(chain).rows(twist)


def dynamic_margins(chain: Chain, twists: ArrayLike, rates: ArrayLike) -> FloatArray:
    """Return the margin (m, n) of each contact of a chain in motion; the contact holds if and only if it is > 0.

    The margin is the sine of the angle between the contact's wrench, including inertia, and the nearest facet of its
    cone. For small speeds and rates it approaches the margin of the quasi-static sets.

    Args:
        chain: Chain with known loads.
        twists: Nonzero body twists (m, 3) in the chain frame, m/s and rad/s.
        rates: Time derivatives (m, 3) of the twists, m/s^2 and rad/s^2.

    Raises:
        PushplanError: If twists are zero, not finite or not (m, 3), or rates have another shape.
        SupportError: If a load is not known.
    """
    return ContactDynamics(chain).margins(twists, rates)


DIRECTIONS = 32
"""Number of directions in which a force is compared with a limit, to keep the conditions linear; a multiple of 4."""

_ANGLES = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
_UNIT = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
_INSCRIBED = float(np.cos(np.pi / DIRECTIONS))
"""Smallest value of a unit force's largest component along these directions: up to 0.5 % of a limit stay unused."""


@dataclass(frozen=True, eq=False)
class PushForce:
    """The largest force `|F_xy|` (N) of the plate on a load, over all possible loads and frictions.

    Attributes:
        dynamics: Dynamics of the load.
    """

    dynamics: ContactDynamics

    @cached_property
    def most_friction(self) -> float:
        """Sum of the largest friction loads, N: an upper bound of the force at a constant twist."""
        own = self.dynamics
        if own.interval is not None:
            return float(own.interval.loads[:, 1].sum())
        return float(sum(obj.friction_load for obj in own.chain.objects))

    def steady(self, twists: FloatArray) -> FloatArray:
        """Return the force (m,) of slow pushes with nonzero body twists (m, 3) in the chain frame, N."""
        return np.asarray(np.minimum(_largest(self.against_floor(twists)), self.most_friction))

    def moving(self, twists: FloatArray, rates: FloatArray, known: FloatArray | None = None) -> FloatArray:
        """Return the force (m,) of pushes with inertia, N.

        Args:
            twists: Nonzero body twists V (m, 3).
            rates: Time derivatives dV/dt (m, 3).
            known: Wrenches (m, n, 3) of the contacts without inertia; None to compute them.
        """
        own = None if known is None or not self.dynamics.exact else self._on_plate(known)
        floor = self.against_floor(twists) if own is None else own
        inertia = self.against_inertia(twists, rates)
        return np.asarray(np.minimum(_largest(floor + inertia), self.most_friction + _largest(inertia)))

    def against_floor(self, twists: FloatArray) -> FloatArray:
        """Return the forces against floor friction as discs (m, 3): centre x, y and radius, N."""
        own = self.dynamics
        if own.exact:
            return self._on_plate(own.floor_wrenches(twists))
        if own.loads.free.any():
            return np.tile([0.0, 0.0, self.most_friction], (len(twists), 1))
        length = own.chain.characteristic_length
        return by_direction(lambda v: uncertain.forces_of(own.loads, v), twists, length)

    def against_inertia(self, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the forces against inertia as discs (m, 3): centre x, y and radius, N."""
        own = self.dynamics
        if own.interval is not None:
            return own.interval_inertia.forces(twists, rates)
        return self._on_plate(own.mass_wrenches(twists, rates))

    def _on_plate(self, wrenches: FloatArray) -> FloatArray:
        """Return the plate's force from the contacts' wrenches (m, n, 3), as discs (m, 3) of radius 0, N."""
        plate = [k for k, contact in enumerate(self.dynamics.chain.contacts) if contact.pusher == PLATE]
        return np.asarray(wrenches[:, plate].sum(axis=1) * [1.0, 1.0, 0.0])


def _largest(discs: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(discs[:, 0], discs[:, 1]) + discs[:, 2])


@dataclass(frozen=True, eq=False)
class ForceConditions(MotionConditions):
    """Condition that the plate's force does not exceed a limit; rows come in groups of four, like those of contacts.

    Attributes:
        force: Force that the load takes.
        limit: Largest force of the plate, N.
    """

    force: PushForce
    limit: float

    def quasi_static(self, twists: FloatArray) -> Wrenches:
        """Return the part of the limit that floor friction does not use."""
        reach = _reach(self.force.against_floor(twists))
        return _rows(_INSCRIBED * self.limit - np.minimum(reach, self.force.most_friction))

    def rows_of_inertia(self, sliding: FloatArray, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return the part of the limit that inertia uses, as negative rows."""
        del sliding  # loads that inertia shifts do not increase friction
        return _rows(-_reach(self.force.against_inertia(twists, rates)))


def _reach(discs: FloatArray) -> FloatArray:
    """Return the extent of discs (m, 3) in the 32 directions (m, 32), N."""
    return np.asarray(discs[:, :2] @ _UNIT.T + discs[:, 2:])


def _rows(rows: FloatArray) -> Wrenches:
    return Wrenches(rows.reshape(len(rows), -1, 4), np.zeros((len(rows), DIRECTIONS // 4)))
