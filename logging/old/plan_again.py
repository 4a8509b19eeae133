"""The plan of a log made anew: everything in it that follows from the scenario, the settings and the path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pushplan.logging.old.messages import metadata
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.several_again import segments_again
from pushplan.planners.infeasible.bounds import lower_bound
from pushplan.planners.problem.controls import margins_to_try
from pushplan.planners.problem.problem import Posing
from pushplan.planners.trajectories import make_trajectory
from pushplan.plans.judge import planning_set
from pushplan.plans.result import PlanResult
from pushplan.scenario.model import Scenario
from pushplan.sim.robustness import robustness_of
from pushplan.util.names import AUTO, COSTS


def plan_again(run: RecordedRun) -> PlanResult:
    """Return the plan of `run` with everything in it that follows from the scenario, the settings and the path.

    Raises:
        PushplanError: When the path cannot be driven.
    """
    plan, words = run.plan, run.words.get(metadata.RUN, {})
    assert plan is not None
    settled = replace(
        plan,
        solved=plan.path is not None,
        reason="" if plan.path is not None else plan.reason,
        objective_cost=None,
    )
    if plan.path is None or plan.trajectory is None:
        return settled
    scenario = as_told(run.scenario, words)
    if plan.segments:
        return segments_again(scenario, replace(settled, diagnosis=()), plan.trajectory)
    stable = planning_set(scenario, settled.stable_set)
    margins = margins_to_try(scenario, stable)
    margin = plan.margin if plan.margin in margins else margins[0]  # a lower one only the search can tell
    if plan.margin is not None:
        settled = replace(settled, margin_asked=margins[0], margin=margin, objective=scenario.planner.cost)
    scenario = scenario.with_margin(margin)
    segments = Posing().controls(scenario, stable).segments
    trajectory = plan.trajectory
    if not timed_by_other_rules(scenario, plan):
        trajectory = make_trajectory(scenario, plan.path, stable, trajectory.rate)
    return replace(
        settled,
        trajectory=trajectory,
        robustness=None if plan.robustness is None else robustness_of(scenario.chain, trajectory),
        min_margin=float(stable.margin(plan.path.twists).min()) if len(plan.path.twists) else None,
        lower_bound=None if plan.lower_bound is None else lower_bound(scenario, segments, plan.path.cost),
        diagnosis=(),
        approximate_path=None,
        approximate_error=None,
    )


def timed_by_other_rules(scenario: Scenario, plan: PlanResult) -> bool:
    """Tell whether an older version timed a plan with inertia: contacts kept no margin then."""
    return plan.margin is None and scenario.chain.pusher.limits.contact == "dynamic"


def as_told(scenario: Scenario, words: Mapping[str, str]) -> Scenario:
    """Return the scenario with the cost and the margin that the run was told."""
    cost, margin = words.get("cost"), words.get("margin")
    if cost in COSTS:
        scenario = replace(scenario, planner=replace(scenario.planner, cost=cost))
    if margin is not None and margin != AUTO:
        return scenario.with_margin(float(margin))
    return scenario
