"""What /log says of a plan and an execution; no wall-clock times, which would differ from run to run."""

from __future__ import annotations

import math

from pushplan.plans.execution import Execution
from pushplan.plans.result import PlanResult


def plan_sentence(plan: PlanResult) -> str:
    """Return the outcome of planning in a sentence."""
    who = f"{plan.planner} within the stable set {plan.stable_set}, seed {plan.seed}"
    if plan.path is None:
        return f"{who}: no plan: {'; '.join(plan.why_not)}"
    took = "" if plan.trajectory is None else f", {plan.trajectory.duration:.2f} s"
    lowered = f"; {plan.lowered}" if plan.lowered else ""
    if plan.segments:
        pushes = sum(segment.pushes for segment in plan.segments)
        driven = f"{plan.way_pushed:.4f} m pushed of {plan.path.cost:.4f} m driven"
        return f"{who}: {pushes} push{'es' if pushes > 1 else ''}, {driven}{took}{lowered}"
    return f"{who}: a path of {len(plan.path.lengths)} arcs, cost {plan.path.cost:.4f} m{took}{lowered}"


def execution_sentence(execution: Execution) -> str:
    """Return the outcome of an execution in a sentence."""
    if execution.loss is not None:
        loss = execution.loss
        return f"contact {loss.contact} is lost at {loss.time:.3f} s (margin {loss.margin:.3g})"
    position, angle = execution.goal_error
    if math.isnan(position):
        return f"the record of the execution breaks off behind sample {len(execution.t)}"
    return f"executed; the goal is missed by {1e3 * position:.3g} mm and {math.degrees(angle):.3g} deg"
