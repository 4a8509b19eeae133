"""Beyond quasi-static pushing: what the objects' inertia adds to the contact conditions [C1]-[C4].

A chain that moves rigidly with body twist V = (v, omega) and twist rate dV/dt, both in the chain frame, has at
a point x the acceleration

    a(x) = dv/dt + domega/dt J x + omega J (v + omega J x).

By Newton and Euler, contact k transmits w_k = -(friction wrenches) + (m a(c), I domega/dt + c x m a(c)), summed
over the objects that it carries. Along a constant twist xi with parameter s, V = s' xi, so that each of the
4 n facets g . w_k > 0 reads alpha + beta s'' + gamma s'^2 > 0, alpha being the quasi-static one.

The floor's load is taken as in the quasi-static model: inertia forces do not shift it further. That is exact
for centres of mass as high above the floor as the contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contacts.contact_kernel import contact_margins_of, facet_rows, wrenches_of
from pushplan.mechanics.directions import WORTHWHILE, by_direction, directions
from pushplan.mechanics.friction.packed import PackedChain, pack_chain
from pushplan.mechanics.inertia import (
    InertiaTable,
    inertia_per_object,
    inertia_table,
    sum_over_carried,
)
from pushplan.mechanics.intervals import IntervalChain
from pushplan.mechanics.sphere import checked_twists
from pushplan.mechanics.uncertain import IntervalInertia, contact_facets, pack_centred, pack_intervals
from pushplan.mechanics.uncertain_kernel import PackedLoads, rows_of
from pushplan.util.arrays import FloatArray, IntArray, frozen


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

    @property
    def steady_speed(self) -> float:
        """Largest s' at s'' = 0 up to which no row is negative; 0 where a row is negative at rest already."""
        if (self.alpha < 0.0).any():
            return 0.0
        falling = self.gamma < 0.0
        return float(np.sqrt(np.min(self.alpha[falling] / -self.gamma[falling], initial=np.inf)))


class Wrenches(NamedTuple):
    """What is known of the wrenches of n contacts at m instants.

    Attributes:
        rows: (m, n, 4) least value g . w of every facet, N.
        size: (m, n) largest |w|, moments divided by the chain's characteristic length, N.
    """

    rows: FloatArray
    size: FloatArray


@dataclass(frozen=True, eq=False)
class ContactDynamics:
    """A chain's contact conditions with inertia, ready to be asked many times.

    Attributes:
        chain: Objects and contacts.
        worst_case: Take every quasi-static row as the least over all pressures with the centres of the loads
            (see the stable set `robust`), so that loads need not be known.
        interval: The chain whose masses, loads and floor frictions are intervals; every row is then the least
            for any of them. None where they are numbers.

    Raises:
        SupportError: When a load is not known, unless the worst case is asked for.
    """

    chain: Chain
    worst_case: bool = False
    interval: IntervalChain | None = None

    def __post_init__(self) -> None:
        _ = self.packed if self._exact else self._uncertain  # raise where loads are not known or tip

    @cached_property
    def packed(self) -> PackedChain:
        """The chain as arrays; the loads have to be known."""
        return pack_chain(self.chain)

    @cached_property
    def table(self) -> InertiaTable:
        """Masses, centres of mass and moments of inertia."""
        return inertia_table(self.chain)

    @cached_property
    def _pushers(self) -> IntArray:
        """(n,) the object that pushes each one, -1 for the plate."""
        return np.array([contact.pusher for contact in self.chain.contacts], dtype=np.int64)

    @cached_property
    def facets(self) -> FloatArray:
        """(n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length)."""
        return contact_facets(self.chain)

    @cached_property
    def _uncertain(self) -> PackedLoads:
        """The chain as arrays of what its loads may be."""
        if self.worst_case or self.interval is None:
            return pack_centred(self.chain, self.interval)
        return pack_intervals(self.interval)

    @cached_property
    def _interval_inertia(self) -> IntervalInertia:
        assert self.interval is not None
        return IntervalInertia(self.interval)

    @cached_property
    def _exact(self) -> bool:
        """Whether wrenches are known, not only bounds of them."""
        return not self.worst_case and self.interval is None

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
        parts = (
            self.quasi_static(twists),
            self.inertia(still, twists),
            self.inertia(twists, still),
            self.inertia(still, -twists),
        )
        return tuple(part.rows - margin * part.size[..., None] for part in parts)

    def quasi_static(self, twists: FloatArray) -> Wrenches:
        """Return what the contacts transmit without inertia at body twists (m, 3), none of them zero."""
        owner, first = directions(twists, self.chain.characteristic_length)
        if len(first) > WORTHWHILE * len(twists):
            return self._quasi_static(twists)
        return Wrenches(*(values[owner] for values in self._quasi_static(twists[first])))

    def _quasi_static(self, twists: FloatArray) -> Wrenches:
        if self._exact:
            return self._exactly(wrenches_of(self.packed, twists))
        return Wrenches(*rows_of(self._uncertain, np.ascontiguousarray(twists)))

    def floor_wrenches(self, twists: FloatArray) -> FloatArray:
        """Return what the contacts transmit without inertia (m, n, 3) at twists (m, 3) where loads are known."""
        length = self.chain.characteristic_length
        return by_direction(lambda v: wrenches_of(self.packed, v), twists, length)

    def inertia(self, twists: FloatArray, rates: FloatArray) -> Wrenches:
        """Return what inertia adds to the contacts' wrenches; see `inertia_wrenches`."""
        if self.interval is None:
            return self._exactly(self.inertia_wrenches(twists, rates))
        return Wrenches(*self._interval_inertia.rows(twists, rates))

    def inertia_wrenches(self, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return what inertia adds to the wrench of each contact (m, n, 3), about the chain frame's origin.

        Args:
            twists: (m, 3) body twists V.
            rates: (m, 3) their time derivatives dV/dt.
        """
        wrenches = inertia_per_object(self.table, twists, rates)
        sum_over_carried(wrenches, self._pushers)
        return wrenches

    def _exactly(self, wrenches: FloatArray) -> Wrenches:
        """Facet values G . w of transmitted wrenches (m, n, 3), and their sizes."""
        return Wrenches(*facet_rows(self.facets, wrenches, self.chain.characteristic_length))

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
            raise PushplanError(
                f"rates have shape {dv.shape}; they must be finite and like twists: {v.shape}"
            )
        if self._exact:
            wrenches = self.floor_wrenches(v) if floor is None else floor
            return contact_margins_of(self.packed, wrenches + self.inertia_wrenches(v, dv))
        static, inertia = self.quasi_static(v), self.inertia(v, dv)
        size = static.size + inertia.size
        least = (static.rows + inertia.rows).min(axis=2)
        return np.where(size > 0.0, least / np.where(size > 0.0, size, 1.0), 0.0)


def dynamic_rows(chain: Chain, twist: ArrayLike) -> DynamicRows:
    """Return the contact conditions of `chain` along a constant body twist (3,), inertia included.

    Args:
        chain: The loads must be known.
        twist: In the chain frame, per unit of the path parameter s; its size is the unit of s.

    Raises:
        PushplanError: On a twist that is zero, not finite or not (3,).
        SupportError: When a load is not known.
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
        SupportError: When a load is not known.
    """
    return ContactDynamics(chain).margins(twists, rates)
