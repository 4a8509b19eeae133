"""A recorded run: the contents of a log."""

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
    """Contents of a log as the original objects of the run.

    Attributes:
        path: Path of the log.
        scenario: Scenario of the run.
        plan: Plan; None if the log ends before it.
        execution: Execution of the plan; None if nothing was executed or the log ends before it. If the log ends
            during it, the samples so far, with a goal error of NaN.
        feedback: Measurements, events and replans of a closed loop; else None.
        trials: Outcomes of the Monte Carlo samples of trials.
        improvements: Improvements of the plan; their seconds are NaN if the log does not have them.
        lines: Lines of /log.
        other_scenario: Whether `scenario.json` differs from the resolved scenario file; it then takes precedence.
        fields: Metadata by name: `pushplan.run`, `pushplan.planning`, `pushplan.result`,
            and `pushplan.progress.0000` and so on for improvements.
        losses: Descriptions of the parts that could not be read; empty for a whole file.
        foreign: Names of attachments and metadata of other programs, as in merged logs.
        messages: Messages for viewers from the file; empty if it was read without them.
        channels: Declarations of the messages in the file.
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
        """Path of the log, by the same name as in `plans.run.Run`."""
        return self.path

    @property
    def events(self) -> tuple[Event, ...]:
        """Events of a closed loop."""
        return () if self.feedback is None else self.feedback.events

    @property
    def outcome(self) -> str:
        """Outcome of the run; `cut off` if the log has none."""
        return self.fields.get("pushplan.result", {}).get("outcome", "cut off")
