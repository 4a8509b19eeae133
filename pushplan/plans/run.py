"""What a run log holds: a plan, its execution and what a closed loop did."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pushplan.plans.execution import Execution
from pushplan.plans.plan import Plan
from pushplan.plans.segment import Segment
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray, frozen

KINDS = {
    "disturbance": "an object was displaced in the simulated world",
    "plan": "the plan that is executed first",
    "deviation": "an object is away from its pose in the plan",
    "re-localisation": "the plate stands still, and what was measured since is averaged",
    "replan": "a plan was made on the way",
    "close": "a short push begins that closes contacts",
    "drive": "the plate drives to an object",
    "touch": "an object that was driven up to tells where the plate is",
    "pushed": "a push of several is over",
    "moved": "an object that is not pushed stands elsewhere than before",
    "room": "what stands in the room has changed, and with it the way to go",
    "dropped": "what came in cannot be: no numbers, absurd ones, or a time that is none",
    "jump": "the measured pose of the plate jumped",
    "sensor": "what was found to be wrong with sensors and wheels",
    "stall": "the plate is driven on, and all that it pushes stands still",
    "unseen": "no measurement has come for a while",
    "arrived": "the goal's object is within its tolerances as measured, and what error of the camera is not excluded",
    "gave up": "nothing more can be done, and why",
}
"""Kinds of events, and what they mean."""

LINES = 20
"""Events of a run that people are shown, at most."""
NUMBER = re.compile(r"[-\d.]+")

WARNINGS = ("deviation", "stall", "moved", "dropped", "unseen", "gave up")
"""Kinds that are told as warnings."""


@dataclass(frozen=True)
class Event:
    """Something that happened.

    Attributes:
        time: s.
        kind: A word of `KINDS`.
        text: The same in a sentence, with the numbers.
    """

    time: float
    kind: str
    text: str


def collapsed(events: Sequence[Event], most: int = LINES) -> list[Event]:
    """Return events as people read them: of more than `most`, those that differ in numbers only are one with a count.

    Where these are too many still, those of one kind are.
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
    """An attempt to plan on the way.

    Attributes:
        time: When, s.
        result: What was planned; None where the start or the chain is none to plan with.
        reason: Why there is no plan; empty if there is one.
        seconds: CPU time that it took, s; NaN of one that was read from a log.
        rest: Whether it is of all that is left to do, several pushes, and not of the one that was begun.
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
    """What a sensor said of the objects.

    Attributes:
        t: (k,) when measurements were taken, s.
        poses: (k, n, 3) of the objects in the world, with noise.
    """

    t: FloatArray
    poses: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", frozen(self.t, (None,), "times of measurements"))
        object.__setattr__(self, "poses", frozen(self.poses, (len(self.t), None, 3), "measured poses"))


@dataclass(frozen=True, eq=False)
class Feedback:
    """What a log of a closed loop has beside its plan and its execution.

    Attributes:
        measured: All measurements.
        events: All that was noticed and done.
        replans: All attempts to plan after the first one.
    """

    measured: Measured
    events: tuple[Event, ...]
    replans: tuple[Replan, ...]


def segments_of(plan: Plan | None, feedback: Feedback | None) -> tuple[Segment, ...]:
    """Return what `Execution.segment` counts: the segments of a plan, and of plans for the rest that a loop made.

    Another path of a push that was begun is still that push.
    """
    replans = () if feedback is None else feedback.replans
    plans = [] if plan is None else [plan]
    plans += [r.result for r in replans if r.rest and r.solved and r.result is not None]
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

    def __repr__(self) -> str:
        """Say what it is in a line."""
        return f"<Run: {self.plan!r}, log {self.log}>"

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened, was noticed and was done in a closed loop."""
        return () if self.feedback is None else self.feedback.events
