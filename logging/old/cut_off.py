"""The best path of a run that was cut off before its plan, timed and executed as the run would have done."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pushplan.errors import PushplanError
from pushplan.logging.old.messages import metadata
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.plan_again import as_told
from pushplan.planners.infeasible.bounds import lower_bound
from pushplan.planners.problem.controls import margins_to_try
from pushplan.planners.problem.problem import Posing
from pushplan.planners.trajectories import make_trajectory
from pushplan.plans.judge import planning_set
from pushplan.plans.result import PlanResult
from pushplan.sim.judging import execute_trajectory
from pushplan.sim.robustness import robustness_of


def with_best_path(run: RecordedRun) -> RecordedRun:
    """Return a run with the plan that its best path leads to, and its execution, where the log ends before them.

    A log that has its plan, or no path, or a path that cannot be driven, is returned as it is.
    """
    if run.plan is not None or run.best_path is None:
        return run
    try:
        plan = _plan(run)
    except PushplanError:
        return run
    return replace(run, plan=plan, execution=plan.execution)


def _plan(run: RecordedRun) -> PlanResult:
    path, words = run.best_path, run.words.get(metadata.RUN, {})
    assert path is not None
    scenario = as_told(run.scenario, words)
    stable = planning_set(scenario, words.get("set", scenario.stability.set))
    margins = margins_to_try(scenario, stable)
    least = float(stable.margin(path.twists).min(initial=math.inf))
    margin = next(
        (tried for tried in margins if least >= tried), margins[-1]
    )  # which one, the log does not say
    scenario = scenario.with_margin(margin)
    trajectory = make_trajectory(scenario, path, stable)
    execution = execute_trajectory(scenario, stable.name, trajectory)
    last = run.progress[-1]
    return PlanResult(
        solved=True,
        reason="",
        planner=words.get("planner", scenario.planner.name),
        stable_set=stable.name,
        seed=int(words.get("seed", scenario.planner.seed)),
        path=path,
        trajectory=trajectory,
        first_solution_s=run.progress[0].seconds,
        planning_s=last.seconds,
        progress=run.progress,
        extensions=0,  # the log does not say
        min_margin=least,
        tree=np.zeros((0, 2, 3)),
        lower_bound=lower_bound(scenario, Posing().controls(scenario, stable).segments, path.cost),
        objective=scenario.planner.cost,
        margin_asked=margins[0],
        margin=margin,
        execution=execution,
        robustness=robustness_of(scenario.chain, trajectory),
    )
