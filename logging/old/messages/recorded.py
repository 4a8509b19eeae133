"""A run as its log has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pushplan.plans.events import Feedback
from pushplan.plans.execution import Execution
from pushplan.plans.path import PushPath
from pushplan.plans.result import PlanResult, ProgressPoint
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True)
class LogLine:
    """A line of /log: simulated time (s), level (`debug` to `fatal`), text."""

    time: float
    level: str
    text: str


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """Everything that a run left in its log, as the objects that the run had.

    Attributes:
        path: The log.
        scenario: What was asked.
        plan: What was planned; None when the log ends before.
        execution: What the simulator made of it; None when nothing was executed or the log ends before. Where the
            log ends in the middle, its samples so far, and NaN for the goal error.
        lines: The lines of /log.
        words: The metadata by name: `pushplan.run`, `pushplan.planning`, `pushplan.result`,
            and `pushplan.progress.0000` and so on for improvements that were logged when found.
        progress: The improvements of the best path; seconds are NaN where the log does not say.
        feedback: Of a closed loop: what it measured, noticed and planned on the way; else None.
        losses: What of the file could not be read, in words; empty for a whole one.
        number: Of the run in its log, from 0.
        began: Time of the log at which it begins, ns; its own times begin at 0.
    """

    path: Path
    scenario: Scenario
    plan: PlanResult | None
    execution: Execution | None
    lines: tuple[LogLine, ...]
    words: Mapping[str, Mapping[str, str]]
    losses: tuple[str, ...]
    progress: tuple[ProgressPoint, ...] = ()
    feedback: Feedback | None = None
    number: int = 0
    began: int = 0

    @property
    def trajectory(self) -> Trajectory | None:
        """The timed path, if there is one."""
        return None if self.plan is None else self.plan.trajectory

    @property
    def margins(self) -> FloatArray | None:
        """(m, n) margin of each contact during the execution, if there was one."""
        return None if self.execution is None else self.execution.margins

    @property
    def best_path(self) -> PushPath | None:
        """The best path that the log holds: the plan's, or of a run that was cut off the last one found."""
        if self.plan is not None:
            return self.plan.path
        return self.progress[-1].path if self.progress else None

    @property
    def outcome(self) -> str:
        """How the run ended; `cut off` when the log does not say."""
        return self.words.get("pushplan.result", {}).get("outcome", "cut off")
