"""Stable sets for planning pushes and for the margins of executions, and the contact conditions with inertia."""

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
    """Return the stable set for the margins of an execution: `ecof` (exact) for known loads, else the planned set.

    Args:
        scenario: Push problem.
        planned: Name of the stable set that limited the plan.
    """
    known = scenario.interval is None and scenario.chain.loads_known
    return scenario.stable_set("ecof" if known else planned)


def planning_set(scenario: Scenario, name: str | None = None) -> StableSet:
    """Return the set for planning: the set `name`, limited to twists that `judging_set` accepts and the force allows.

    Only `cof` can exceed its judging set: it assumes a friction point that does not move with the COR. Every search,
    check and closed loop uses this set, so a load that is too heavy is one that no contact can push.

    Raises:
        PushplanError: As in `Scenario.stable_set`.
        EmptyStableSetError: If all of its pushes need more force than `robot.limits.force`.
    """
    stable = scenario.stable_set(name)
    if stable.name == "cof":
        stable = IntersectionSet(stable, judging_set(scenario, stable.name))
    limits = scenario.chain.pusher.limits
    if math.isinf(limits.force):
        return stable
    return within_force(stable, push_force(scenario, stable.name), limits)


def push_force(scenario: Scenario, set_name: str) -> PushForce:
    """Return the required pushing force for all loads and frictions of a stable set; see `contact_dynamics`."""
    return PushForce(contact_dynamics(scenario, set_name))


def contact_dynamics(scenario: Scenario, set_name: str) -> ContactDynamics:
    """Return the contact conditions with inertia, for all loads and frictions of a stable set.

    They cover every value of the scenario's intervals, and every pressure if the set does. For a set of the user's
    own, they cover every pressure only if a load is unknown, as its `judging_set` does.
    """
    own = set_name not in STABLE_SETS
    all_pressures = not scenario.chain.loads_known if own else set_name not in KNOWN_LOAD_SETS
    return _dynamics(scenario.chain, all_pressures, scenario.interval)


_dynamics = lru_cache(maxsize=8)(ContactDynamics)
"""Cached, because timing and execution of all plans of a chain need it."""
