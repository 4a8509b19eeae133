"""What limits a motion: the pusher's limits and, with inertia, the contacts that have to hold."""

from __future__ import annotations

from typing import NamedTuple

from pushplan.mechanics.chain import Limits
from pushplan.mechanics.dynamics.contact_dynamics import ContactDynamics
from pushplan.plans.judge import contact_dynamics
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet

INERTIA_SHARE = 0.5
"""Share of the margin asked for that contacts keep with inertia."""


class Bounds(NamedTuple):
    """What limits a motion.

    Attributes:
        limits: Of the pusher.
        contacts: The chain whose contacts must hold; None leaves inertia out.
        margin: Every contact keeps more than this with inertia.
        pace: Share of an arc's top speed with which it is passed at most.
    """

    limits: Limits
    contacts: ContactDynamics | None = None
    margin: float = 0.0
    pace: float = 1.0


def motion_bounds(scenario: Scenario, stable: StableSet) -> Bounds:
    """Return what limits the motion of a scenario: the pusher and, unless inertia is left out, the contacts."""
    limits = scenario.chain.pusher.limits
    if limits.contact != "dynamic":
        return Bounds(limits)
    return Bounds(
        limits, contact_dynamics(scenario, stable.name), margin_with_inertia(scenario.required_margin)
    )


def margin_with_inertia(margin: float) -> float:
    """Return the margin that contacts keep with inertia where one without it is asked for: half of it."""
    return INERTIA_SHARE * margin
