"""A run as its log has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from pushplan.logging.mcap_file import Channel, Message
from pushplan.plans.execution import Execution, TrialEnd
from pushplan.plans.plan import Improvement, Plan
from pushplan.plans.run import Event, Feedback
from pushplan.scenario.model import Scenario


class LogLine(NamedTuple):
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
        feedback: Of a closed loop: what it measured, noticed and planned on the way; else None.
        trials: Of a plan that was tried in sampled worlds: how each of them ended.
        improvements: Of the plan; seconds are NaN where the log does not say.
        lines: The lines of /log.
        other_scenario: Whether `scenario.json` says other than the scenario's file comes to; it counts then.
        fields: The metadata by name: `pushplan.run`, `pushplan.planning`, `pushplan.result`,
            and `pushplan.progress.0000` and so on for improvements.
        losses: What of the file could not be read, in words; empty for a whole one.
        foreign: Names of attachments and metadata that are not pushplan's, as merged logs have.
        messages: What viewers see, as it stands in the file; empty where it was read without them.
        channels: What the file declares messages to be.
    """

    path: Path
    scenario: Scenario
    plan: Plan | None = None
    execution: Execution | None = None
    feedback: Feedback | None = None
    trials: tuple[TrialEnd, ...] = ()
    improvements: tuple[Improvement, ...] = ()
    lines: tuple[LogLine, ...] = ()
    other_scenario: bool = False
    fields: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    losses: tuple[str, ...] = ()
    foreign: tuple[str, ...] = ()
    messages: tuple[Message, ...] = ()
    channels: frozenset[Channel] = frozenset()

    @property
    def log(self) -> Path:
        """The log, as `plans.run.Run` calls it."""
        return self.path

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened, was noticed and was done in a closed loop."""
        return () if self.feedback is None else self.feedback.events

    @property
    def outcome(self) -> str:
        """How the run ended; `cut off` when the log does not say."""
        return self.fields.get("pushplan.result", {}).get("outcome", "cut off")
