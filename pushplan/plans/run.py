"""What a run log holds: a plan, its execution and what a closed loop did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pushplan.plans.events import Event, Feedback
from pushplan.plans.execution import Execution
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Segment
from pushplan.scenario.model import Scenario


def segments_of(plan: Plan | None, feedback: Feedback | None) -> tuple[Segment, ...]:
    """Return what `Execution.segment` counts: the segments of a plan, and of plans for the rest that a loop made.

    Another path of a push that was begun is still that push.
    """
    replans = () if feedback is None else feedback.replans
    plans = [] if plan is None else [plan]
    plans += [r.result for r in replans if r.solved and r.result is not None and r.result.path is None]
    return tuple(segment for one in plans for segment in one.segments)


@dataclass(frozen=True, eq=False)
class Run:
    """A plan, its execution and the log of both.

    Attributes:
        scenario: What was asked.
        plan: What was planned.
        execution: What the simulator made of it; None when there was nothing to execute.
        log: The log file; None when there is none, or it could not be written to its end.
        seconds: Wall-clock time by phase: `preparing`, `search`, `timing`, `execution`, `validation`, `logging`; s.
        feedback: What a closed loop measured, noticed and did; None for a plan that was executed as it was.
    """

    scenario: Scenario
    plan: Plan
    execution: Execution | None
    log: Path | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    feedback: Feedback | None = None

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened, was noticed and was done in a closed loop."""
        return () if self.feedback is None else self.feedback.events
