"""Contents of a run log: a plan, its execution, and the events and replans of a closed loop."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pushplan.plans.execution import Execution, TrialEnd
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Segment
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray, frozen

KINDS = {
    "disturbance": "an object was displaced in the simulated world",
    "plan": "the first executed plan",
    "deviation": "an object deviates from its planned pose",
    "re-localisation": "the plate stands still and averages the measurements",
    "replan": "the loop has planned again",
    "close": "a short push to close contacts begins",
    "drive": "the plate drives to an object",
    "touch": "the contact with an object corrects the pose of the plate",
    "pushed": "a push of a multi-push plan has ended",
    "moved": "an object that is not pushed has moved",
    "room": "the obstacles have changed; the plan follows",
    "dropped": "a measurement was rejected: not finite, out of range, or with an invalid time",
    "jump": "the measured pose of the plate jumped",
    "sensor": "an error of a sensor or of the odometry was found",
    "grip": "an object has slid repeatedly; plans now assume the lowest friction",
    "stall": "the plate is driven on, but the pushed objects stand still",
    "unseen": "no measurement has arrived for a while",
    "arrived": "the object is within the tolerances as measured; the text states the camera error that is possible",
    "gave up": "the loop has ended without reaching the goal, with the reason",
}
"""Kinds of events and their meanings."""

LINES = 20
"""Largest number of events that a text shows."""
NUMBER = re.compile(r"[-\d.]+")

WARNINGS = ("deviation", "stall", "moved", "dropped", "unseen", "gave up")
"""Kinds of events that are warnings."""


@dataclass(frozen=True)
class Event:
    """An event of a closed loop.

    Attributes:
        time: Time, s.
        kind: Kind, one of `KINDS`.
        text: Sentence for the user, with the numbers.
    """

    time: float
    kind: str
    text: str


def collapsed(events: Sequence[Event], most: int = LINES) -> list[Event]:
    """Return events, merged with a count if there are more than `most`.

    Events whose texts differ only in numbers are merged first, then all events of one kind.
    """
    merged = list(events)
    for longest in (1000, 0):
        if len(merged) <= most:
            break
        groups: dict[tuple[str, str], list[Event]] = {}
        for event in events:
            groups.setdefault((event.kind, NUMBER.sub("", event.text)[:longest]), []).append(event)
        merged = [
            one if not more else replace(one, text=f"{one.text} ({len(more) + 1} times until {more[-1].time:.2f} s)")
            for one, *more in groups.values()
        ]
    return merged


@dataclass(frozen=True, eq=False)
class Replan:
    """An attempt to plan again during the run.

    Attributes:
        time: Time of the attempt, s.
        result: The plan; None if start or chain are invalid for planning.
        reason: Reason why there is no plan; empty if there is one.
        seconds: CPU time, s; NaN if read from a log.
        rest: Whether it plans all remaining pushes, not only the current one.
    """

    time: float
    result: Plan | None
    reason: str
    seconds: float
    rest: bool = False

    @property
    def solved(self) -> bool:
        """Whether there is a plan."""
        return self.result is not None and self.result.solved


@dataclass(frozen=True, eq=False)
class Measured:
    """Measured poses of the objects.

    Attributes:
        t: (k,) times of the measurements, s.
        poses: (k, n, 3) measured poses of the objects in the world, with noise.
    """

    t: FloatArray
    poses: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", frozen(self.t, (None,), "times of measurements"))
        object.__setattr__(self, "poses", frozen(self.poses, (len(self.t), None, 3), "measured poses"))


@dataclass(frozen=True, eq=False)
class Feedback:
    """Measurements, events and replans of a closed loop.

    Attributes:
        measured: All measurements.
        events: All events.
        replans: All attempts to plan after the first plan.
    """

    measured: Measured
    events: tuple[Event, ...]
    replans: tuple[Replan, ...]


def segments_of(plan: Plan | None, feedback: Feedback | None) -> tuple[Segment, ...]:
    """Return the segments that `Execution.segment` indexes: those of the plan, then of all replans for the rest.

    A replan of the current push adds none: it is still the same push.
    """
    replans = () if feedback is None else feedback.replans
    plans = [] if plan is None else [plan]
    plans += [r.result for r in replans if r.rest and r.solved and r.result is not None]
    return tuple(segment for one in plans for segment in one.segments)


@dataclass(frozen=True, eq=False)
class Run:
    """A plan, its execution and the log of both.

    Attributes:
        scenario: Scenario that was planned.
        plan: The plan.
        execution: Simulated execution; None if there was nothing to execute.
        log: Log file; None without one, or if it is incomplete.
        seconds: Wall-clock time by phase, s: `preparing`, `search`, `timing`, `execution`, `validation`, `logging`.
        feedback: Measurements, events and replans of a closed loop; None for an open-loop execution.
        trials: Outcome of each Monte Carlo sample of the plan, if it was tried.
    """

    scenario: Scenario
    plan: Plan
    execution: Execution | None
    log: Path | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    feedback: Feedback | None = None
    trials: tuple[TrialEnd, ...] = ()

    def __repr__(self) -> str:
        """Return one line."""
        return f"<Run: {self.plan!r}, log {self.log}>"

    @property
    def events(self) -> tuple[Event, ...]:
        """Events of a closed loop; empty for an open-loop execution."""
        return () if self.feedback is None else self.feedback.events
