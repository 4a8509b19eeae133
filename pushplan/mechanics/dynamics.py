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

import numpy as np
from numpy.typing import ArrayLike

from pushplan.arrays import FloatArray, frozen
from pushplan.errors import PushplanError
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contact_kernel import contact_margins_of, wrenches_of
from pushplan.mechanics.inertia import InertiaTable, inertia_table
from pushplan.mechanics.packed import PackedChain, contact_rows, pack_chain
from pushplan.mechanics.packed_areas import pack_areas
from pushplan.mechanics.robust_kernel import PackedAreas, robust_rows_of
from pushplan.mechanics.sphere import checked_twists


@dataclass(frozen=True, eq=False)
class DynamicRows:
    """The contact conditions along one twist: alpha + beta s'' + gamma s'^2 > 0 for every entry.

    Attributes:
        alpha: (n, 4) quasi-static part for the contacts' facets, N; see `packed.contact_rows`.
        beta: (n, 4) per unit of s''.
        gamma: (n, 4) per unit of s'^2.
    """

    alpha: FloatArray
    beta: FloatArray
    gamma: FloatArray

    def __post_init__(self) -> None:
        for name in ("alpha", "beta", "gamma"):
            object.__setattr__(self, name, frozen(getattr(self, name), (None, 4), name))

    def values(self, speed: float, acceleration: float) -> FloatArray:
        """Return the rows (n, 4), N, at s' = `speed` and s'' = `acceleration`."""
        return np.asarray(self.alpha + self.beta * acceleration + self.gamma * speed**2)

    @property
    def steady_speed(self) -> float:
        """Largest s' at s'' = 0 up to which no row is negative; 0 where a row is negative at rest already."""
        if (self.alpha < 0.0).any():
            return 0.0
        falling = self.gamma < 0.0
        return float(np.sqrt(np.min(self.alpha[falling] / -self.gamma[falling], initial=np.inf)))


@dataclass(frozen=True, eq=False)
class ContactDynamics:
    """A chain's contact conditions with inertia, ready to be asked many times.

    Attributes:
        chain: Objects and contacts.
        worst_case: Take every quasi-static row as the least over all pressures with the centres of the loads
            (see the stable set `robust`), so that loads need not be known.

    Raises:
        SupportError: When a load is not known, unless the worst case is asked for.
    """

    chain: Chain
    worst_case: bool = False

    def __post_init__(self) -> None:
        _ = self._areas if self.worst_case else self.packed  # raise where loads are not known or tip

    @cached_property
    def packed(self) -> PackedChain:
        """The chain as arrays; the loads have to be known."""
        return pack_chain(self.chain)

    @cached_property
    def table(self) -> InertiaTable:
        """Masses, centres of mass and moments of inertia."""
        return inertia_table(self.chain)

    @cached_property
    def facets(self) -> FloatArray:
        """(n, 4, 3) unit facets g of the contacts, g . (f_x, f_y, m / length)."""
        length = self.chain.characteristic_length
        return np.array([contact_rows(contact, length) for contact in self.chain.contacts])

    @cached_property
    def _areas(self) -> PackedAreas:
        return pack_areas(self.chain)

    def rows(self, twist: ArrayLike) -> DynamicRows:
        """Return the rows along a constant body twist (3,) per unit of s."""
        xi = checked_twists(np.asarray(twist, dtype=np.float64)[None])
        still = np.zeros_like(xi)
        beta, gamma = self.inertia_rows(still, xi)[0], self.inertia_rows(xi, still)[0]
        return DynamicRows(self.quasi_static_rows(xi)[0], beta, gamma)

    def quasi_static_rows(self, twists: FloatArray) -> FloatArray:
        """Return the facets' values (m, n, 4), N, without inertia, at body twists (m, 3)."""
        if self.worst_case:
            return robust_rows_of(self._areas, np.ascontiguousarray(twists))
        return self._facet_values(wrenches_of(self.packed, twists))

    def inertia_rows(self, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return what inertia adds to the facets' values (m, n, 4), N; see `inertia_wrenches`."""
        return self._facet_values(self.inertia_wrenches(twists, rates))

    def inertia_wrenches(self, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return what inertia adds to the wrench of each contact (m, n, 3), about the chain frame's origin.

        Args:
            twists: (m, 3) body twists V.
            rates: (m, 3) their time derivatives dV/dt.
        """
        mass, center, moment = self.table
        v, omega = twists[:, None, :2], twists[:, None, 2:]
        dv, domega = rates[:, None, :2], rates[:, None, 2:]
        force = mass[:, None] * (dv + domega * _turned(center) + omega * _turned(v) - omega**2 * center[None])
        about = moment * domega[..., 0] + center[:, 0] * force[..., 1] - center[:, 1] * force[..., 0]
        carried = np.concatenate([force, about[..., None]], axis=-1)
        for k in reversed(range(len(self.chain.contacts))):
            pusher = self.chain.contacts[k].pusher
            if pusher >= 0:
                carried[:, pusher] += carried[:, k]
        return carried

    def _facet_values(self, wrenches: FloatArray) -> FloatArray:
        """G . w (m, n, 4) of transmitted wrenches (m, n, 3) for the contacts' unit facets g."""
        scaled = wrenches / np.array([1.0, 1.0, self.chain.characteristic_length])
        return np.asarray(np.einsum("kjc,mkc->mkj", self.facets, scaled), dtype=np.float64)

    def margins(self, twists: ArrayLike, rates: ArrayLike) -> FloatArray:
        """Return the margin (m, n) of each contact while the chain moves and accelerates; see `dynamic_margins`.

        Raises:
            SupportError: When a load is not known.
        """
        v = checked_twists(twists)
        dv = np.ascontiguousarray(rates, dtype=np.float64)
        if dv.shape != v.shape or not np.isfinite(dv).all():
            raise PushplanError(
                f"rates have shape {dv.shape}; they must be finite and like twists: {v.shape}"
            )
        return contact_margins_of(self.packed, wrenches_of(self.packed, v) + self.inertia_wrenches(v, dv))


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


def _turned(vectors: FloatArray) -> FloatArray:
    """J x: vectors (..., 2) turned by a quarter turn counter-clockwise."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)
