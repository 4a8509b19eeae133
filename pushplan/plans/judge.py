"""Who judges pushes: the set to plan in, the set whose margins decide an execution, and the same with inertia."""

from __future__ import annotations

import math
from functools import lru_cache

from pushplan.mechanics.dynamics import ContactDynamics, PushForce
from pushplan.scenario.model import Scenario
from pushplan.sets.force_limited_set import within_force
from pushplan.sets.known_load_sets import IntersectionSet
from pushplan.sets.stable_set import StableSet
from pushplan.util.names import KNOWN_LOAD_SETS, STABLE_SETS


def judging_set(scenario: Scenario, planned: str) -> StableSet:
    """Return the set that judges an execution: the exact one where loads are known numbers, else the planned one.

    Args:
        scenario: A push problem.
        planned: Name of the set that was planned in.
    """
    known = scenario.interval is None and scenario.chain.loads_known
    return scenario.stable_set("ecof" if known else planned)


def planning_set(scenario: Scenario, name: str | None = None) -> StableSet:
    """Return the set to plan in: the one called `name`, cut down to what the judge of the execution accepts.

    Only `cof` may reach beyond its judge: it takes friction to act at a point that does not move with the COR. Every
    search, check and closed loop asks here for what it may do, so that a load that is too heavy together with others
    is just one that no contact can push.

    Raises:
        PushplanError: See `Scenario.stable_set`.
        EmptyStableSetError: When all of its pushes take more force than `robot.limits.force`.
    """
    stable = scenario.stable_set(name)
    if stable.name == "cof":
        stable = IntersectionSet(stable, judging_set(scenario, stable.name))
    limits = scenario.chain.pusher.limits
    if math.isinf(limits.force):
        return stable
    return within_force(stable, push_force(scenario, stable.name), limits)


def push_force(scenario: Scenario, set_name: str) -> PushForce:
    """Return the force that pushing takes, for all that a stable set holds for; see `contact_dynamics`."""
    return PushForce(contact_dynamics(scenario, set_name))


def contact_dynamics(scenario: Scenario, set_name: str) -> ContactDynamics:
    """Return the contact conditions with inertia, for all that a stable set holds for.

    That is every value of the scenario's intervals, and every pressure where the set is for that. A set of the user's
    own is for the loads that are known, as its executions are judged.
    """
    own = set_name not in STABLE_SETS
    all_pressures = not scenario.chain.loads_known if own else set_name not in KNOWN_LOAD_SETS
    return _dynamics(scenario.chain, all_pressures, scenario.interval)


_dynamics = lru_cache(maxsize=8)(ContactDynamics)
"""What timing and execution of the plans of a chain all ask for."""
