"""Verifies a run log: the recorded plan is executed again, and everything that viewers see is made again."""

from __future__ import annotations

from pathlib import Path

from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.verify import VerifyReport, verify
from pushplan.plans.run import Execution
from pushplan.sim.kinematic import execute


def verify_log(path: Path | str) -> VerifyReport:
    """Read a log, once, and compare all that is in it with what its plan leads to.

    Raises:
        RunLogError: When the log cannot be read.
        PushplanError: When the recorded plan cannot be executed at all.
    """
    return verify(load_run(path, messages=True), execute_again)


def execute_again(run: RecordedRun) -> Execution | None:
    """Execute a recorded plan again; None where objects slipped or were watched, in a world that no log holds."""
    execution, plan = run.execution, run.plan
    slipped = execution is not None and (execution.wrenches is not None or run.feedback is not None)
    if plan is None or plan.trajectory is None or slipped:
        return None
    return execute(run.scenario, plan.segments, plan.stable_set)
