"""Who judges an execution: the exact set where loads are known, with inertia unless the scenario leaves it out."""

from __future__ import annotations

from pushplan.planners.timing.bounds import contact_dynamics
from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sets.intersection_set import IntersectionSet
from pushplan.sets.stable_set import StableSet
from pushplan.sim.kinematic import simulate_rigid
from pushplan.util.names import KNOWN_LOAD_SETS


def execute(scenario: Scenario, result: PlanResult) -> Execution | None:
    """Return what the kinematic simulator makes of a plan, executed anew; None where there is no trajectory."""
    if result.trajectory is None:
        return None
    return execute_trajectory(scenario, result.stable_set, result.trajectory)


def execute_trajectory(scenario: Scenario, planned: str, trajectory: Trajectory) -> Execution:
    """Return what the kinematic simulator makes of a trajectory planned in the set `planned`."""
    judge = judging_set(scenario, planned)
    dynamic = scenario.chain.pusher.limits.contact == "dynamic"
    contacts = contact_dynamics(scenario, judge.name)
    return simulate_rigid(trajectory, judge, scenario.goal.pose_chain, contacts, inertia_decides=dynamic)


def judging_set(scenario: Scenario, planned: str) -> StableSet:
    """Return the set that judges an execution: the exact one where loads are known numbers, else the planned one."""
    known = scenario.interval is None and scenario.chain.loads_known
    return scenario.stable_set("ecof" if known else planned)


def planning_set(scenario: Scenario, name: str | None = None) -> StableSet:
    """Return the set to plan in: the one called `name`, cut down to what the judge of the execution accepts.

    Only `cof` may reach beyond its judge: it takes friction to act at a point that does not move with the COR.

    Raises:
        PushplanError: See `Scenario.stable_set`.
    """
    stable = scenario.stable_set(name)
    if stable.name != "cof":
        return stable
    assert stable.name in KNOWN_LOAD_SETS
    return IntersectionSet(stable, judging_set(scenario, stable.name))
