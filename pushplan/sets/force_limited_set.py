"""Stable pushes within the robot's force limit."""

from __future__ import annotations

import numpy as np

from pushplan.errors import EmptyStableSetError
from pushplan.mechanics.chain import Limits
from pushplan.mechanics.dynamics import PushForce
from pushplan.mechanics.sphere import twists_at
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

SPEEDING_UP = 1.05
"""Smallest ratio of the force limit and the force of sliding, for smaller values of `breakaway`. At a floor friction
of 0.3 it leaves an acceleration of 0.15 m/s^2."""

STEEPNESS = 1000.0
"""Slope of the margin over the used share of the force limit: a margin of 0.05 leaves 0.05 per mille of the force
unused. The margin must be continuous for root finding."""

_MERIDIANS, _LATITUDES, _ROUNDS = 256, 17, 4


def too_heavy_ahead(stable: StableSet) -> str:
    """Return a sentence if the push straight ahead takes too much force; empty otherwise."""
    return stable.too_heavy(np.array([[1.0, 0.0, 0.0]])) if isinstance(stable, ForceLimitedSet) else ""


class ForceLimitedSet(StableSet):
    """The twists of a set for which the robot has enough force, also from rest, because a push can stop anywhere.

    A margin is that of the inner set if the force suffices, and negative otherwise. The contact margins are always
    those of the inner set.

    Args:
        inside: Inner set.
        force: Force that pushing the load takes.
        limits: Limits with the robot's force and the ratio of friction at rest and in motion.
    """

    def __init__(self, inside: StableSet, force: PushForce, limits: Limits) -> None:
        super().__init__(inside.chain)
        self.name, self.inside, self._force = inside.name, inside, force
        self._limits = limits
        self._most = limits.force / begin_factor(limits)

    @property
    def loads_known(self) -> bool:
        """Whether the load distribution under every object is known, and with it the contact forces."""
        return self.inside.loads_known

    def contact_margin_values(self, twists: FloatArray) -> FloatArray:
        """Return the margin (k, n) of each contact at checked twists (k, 3)."""
        return self.inside.contact_margin_values(twists)

    def too_heavy(self, twists: FloatArray) -> str:
        """Return a sentence if all twists (k, 3) take too much force; empty otherwise."""
        least = float(self._force.steady(twists).min())
        return "" if least <= self._most else _sentence(self._force, least, self._limits)

    @property
    def left_out(self) -> str:
        """Sentence with the share of the set that takes too much force."""
        all_pushes, possible = (one.area() for one in (self.inside, self))
        return (
            f"{100.0 * (1.0 - possible / all_pushes):.0f} % of the stable pushes, the straightest ones, take more "
            f"force than robot.limits.force, {self._limits.force:.4g} N: up to "
            f"{self._force.most_friction * begin_factor(self._limits):.4g} N"
        )

    def margin_values(self, twists: FloatArray, floor: float = -2.0) -> FloatArray:
        """Return the margins (k,) of checked twists (k, 3); see `StableSet` for `floor`."""
        margins = self.inside.margin_values(twists, floor)
        exact = margins > floor
        spare = STEEPNESS * (1.0 - self._force.steady(twists[exact]) / self._most)
        margins[exact] = np.minimum(margins[exact], np.maximum(spare, -1.0))
        return margins


def begin_factor(limits: Limits) -> float:
    """Return the ratio of the required force of a push and the force of sliding."""
    return max(limits.breakaway, SPEEDING_UP)


def within_force(stable: StableSet, force: PushForce, limits: Limits) -> StableSet:
    """Return the part of a set within the robot's force limit; the set itself if that is all of it.

    Raises:
        EmptyStableSetError: If this part is empty.
    """
    if force.most_friction * begin_factor(limits) <= limits.force:
        return stable
    least = least_force(stable, force)
    if least is not None and least * begin_factor(limits) > limits.force:
        raise EmptyStableSetError(_sentence(force, least, limits))
    return ForceLimitedSet(stable, force, limits)


def least_force(stable: StableSet, force: PushForce) -> float | None:
    """Return the smallest force with which a stable push slides the load, N; None if the set is empty.

    The search evaluates meridians of the twist sphere, then refines around the minimum. Friction changes smoothly
    with the twist, and the minimum is usually on the boundary of the set, where the stable intervals end.
    """
    meridians, length = stable.meridians(0.0, _MERIDIANS), stable.chain.characteristic_length
    if not len(meridians):
        return None
    share = np.linspace(0.0, 1.0, _LATITUDES)
    latitudes = meridians.lower[:, None] + share * (meridians.upper - meridians.lower)[:, None]
    longitudes = np.broadcast_to(meridians.longitude[:, None], latitudes.shape)
    forces = force.steady(twists_at(longitudes, latitudes, length).reshape(-1, 3))
    best = int(np.argmin(forces))
    least, longitude, latitude = float(forces[best]), longitudes.flat[best], latitudes.flat[best]
    reach = 2.0 * np.pi / _MERIDIANS
    for _ in range(_ROUNDS):
        around = reach * np.linspace(-1.0, 1.0, _LATITUDES)
        longitudes, latitudes = (grid.ravel() for grid in np.meshgrid(longitude + around, latitude + around))
        twists = twists_at(longitudes, latitudes, length)
        forces = np.where(stable.margin_values(twists) > 0.0, force.steady(twists), np.inf)
        best = int(np.argmin(forces))
        if forces[best] < least:
            least, longitude, latitude = float(forces[best]), longitudes[best], latitudes[best]
        reach *= 2.0 / (_LATITUDES - 1)
    return least


def _sentence(force: PushForce, least: float, limits: Limits) -> str:
    names = [f"'{obj.name}'" for obj in force.dynamics.chain.objects]
    who = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
    why = "to break away" if limits.breakaway >= SPEEDING_UP else "to speed up"
    bound = "" if force.dynamics.exact else " for the worst of the specified loads and frictions"
    return (
        f"pushing {who} takes at least {least * begin_factor(limits):.4g} N{bound}: {least:.4g} N to slide, "
        f"{begin_factor(limits):.3g} times as much {why}; robot.limits.force is {limits.force:.4g} N"
    )
