"""What a controller notices and does, in the order of time."""

from __future__ import annotations

from dataclasses import dataclass

KINDS = {
    "plan": "the plan that is executed first",
    "left": "an object is off its place in the plan",
    "look": "the plate stands still, and what was measured since is averaged",
    "replan": "a plan was made, or none was found",
    "close": "a short push begins that closes contacts",
    "unseen": "no measurement has come for a while",
    "arrived": "the goal's object is within its tolerances",
    "gave up": "nothing more can be done, and why",
}
"""Kinds of events, and what they mean."""


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
