"""Who judges an execution: the exact set where loads are known, with inertia unless the scenario leaves it out."""

from __future__ import annotations

from pushplan.plans.execution import Execution
from pushplan.plans.judge import contact_dynamics, judging_set
from pushplan.plans.result import PlanResult
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sim.rigid import simulate_rigid


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
