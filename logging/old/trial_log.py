"""The log of one trial: the scenario, the plan, and where every body really went."""

from __future__ import annotations

from pathlib import Path

from pushplan.logging.old.writer import RunLogWriter
from pushplan.plans.judge import judging_set
from pushplan.plans.result import PlanResult
from pushplan.sim.slip.executed import executed
from pushplan.sim.trials.result import Trials


def write_trial(trials: Trials, sample: int, plan: PlanResult, path: Path | str) -> None:
    """Simulate a sample again and write its log; viewers show the objects where contacts slipped.

    Raises:
        OutputError: When the file cannot be written.
    """
    report = trials.report(sample)
    settings = {"planner": plan.planner, "set": plan.stable_set, "seed": plan.seed}
    words = {**settings, "trial_seed": trials.seed, "trial_sample": sample}
    with RunLogWriter.create(path, trials.scenario, words) as log:
        log.plan(plan)
        judge = judging_set(trials.scenario, plan.stable_set)
        error = trials.goal_errors[sample]
        log.execution(executed(report.t, report.poses, report.object_poses, report.wrenches, judge, error))
        loss = report.loss
        if loss is not None:
            name, mode = trials.scenario.chain.contact_name(loss.contact), loss.mode.name.lower()
            log.log("warning", f"{name} was the first contact to move, at {loss.time:.2f} s ({mode})")
        if report.jammed_at is not None:
            log.log("warning", f"jammed at {report.jammed_at:.2f} s: no motion satisfies all contacts")
        log.finish("arrived" if report.arrived(trials.scenario.goal) else "missed")
