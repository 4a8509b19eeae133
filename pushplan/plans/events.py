"""What a controller saw, noticed and did, in the order of time."""

from __future__ import annotations

from dataclasses import dataclass

from pushplan.plans.plan import Plan
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
    "arrived": "the goal's object is within its tolerances",
    "gave up": "nothing more can be done, and why",
}
"""Kinds of events, and what they mean."""

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


@dataclass(frozen=True, eq=False)
class Replan:
    """An attempt to plan on the way.

    Attributes:
        time: When, s.
        result: What was planned; None where the start or the chain is none to plan with.
        reason: Why there is no plan; empty if there is one.
        seconds: CPU time that it took, s; NaN of one that was read from a log.
    """

    time: float
    result: Plan | None
    reason: str
    seconds: float

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
