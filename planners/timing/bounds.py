"""What limits a motion: the pusher's limits and, with inertia, the contacts that have to hold."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from pushplan.mechanics.chain import Chain, Limits
from pushplan.mechanics.dynamics.contact_dynamics import ContactDynamics
from pushplan.mechanics.worst_case.interval_chain import IntervalChain
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.names import KNOWN_LOAD_SETS, STABLE_SETS

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


def contact_dynamics(scenario: Scenario, set_name: str) -> ContactDynamics:
    """Return the contact conditions with inertia, for all that a stable set holds for.

    That is every value of the scenario's intervals, and every pressure where the set is for that. A set of the user's
    own is for the loads that are known, as its executions are judged (`sim.judging`).
    """
    own = set_name not in STABLE_SETS
    all_pressures = not scenario.chain.loads_known if own else set_name not in KNOWN_LOAD_SETS
    return _dynamics(scenario.chain, all_pressures, scenario.interval)


@lru_cache(maxsize=8)
def _dynamics(chain: Chain, worst_case: bool, interval: IntervalChain | None) -> ContactDynamics:
    """What timing and execution of the plans of a chain all ask for."""
    return ContactDynamics(chain, worst_case, interval)
