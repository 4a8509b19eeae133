"""Verifies a run log: the recorded plan is executed again, and everything that viewers see is made again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pushplan.closed_loop import CONTROL, check_closed_loop
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.verify import VerifyReport, verify
from pushplan.plans.execution import Execution
from pushplan.sim.kinematic import execute
from pushplan.trial import TRIAL, check_trials, executed_again

OTHERS = "how the Monte Carlo samples ended (in a simulator that is not pushplan's)"


def verify_log(path: Path | str) -> VerifyReport:
    """Read a log, once, and compare all that is in it with what its plan leads to.

    Raises:
        RunLogError: When the log cannot be read.
        PushplanError: When the recorded plan cannot be executed at all.
    """
    return verify_run(load_run(path, messages=True))


def verify_run(run: RecordedRun) -> VerifyReport:
    """Compare a run that was read with its messages with what its plan, or what its measurements, lead to.

    Raises:
        PushplanError: When the recorded plan cannot be executed at all.
    """
    report = verify(run, execute_again)
    if run.feedback is not None and CONTROL in run.fields and run.execution is not None and run.plan is not None:
        return replace(report, checks=(*check_closed_loop(run), *report.checks))
    if TRIAL in run.fields:
        checks = check_trials(run)
        unknown = (OTHERS,) if run.trials and not checks else ()
        told = (*report.not_compared, *unknown)
        return replace(report, checks=(*checks, *report.checks), not_compared=told)
    return report


def execute_again(run: RecordedRun) -> Execution | None:
    """Execute a recorded plan again; None where objects slipped or were watched, in a world that no log holds."""
    execution, plan = run.execution, run.plan
    if TRIAL in run.fields and execution is not None:
        return executed_again(run)
    slipped = execution is not None and (execution.wrenches is not None or run.feedback is not None)
    if plan is None or plan.trajectory is None or slipped:
        return None
    return execute(run.scenario, plan.segments, plan.stable_set)
