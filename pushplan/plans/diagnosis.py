"""Reasons why there is no plan, separate from plans so that checking a scenario does not load them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

CAUSES = {
    "gap": "a passage between start and goal is too narrow for the chain",
    "heading": "no stable push turns the chain, and the goal has another heading",
    "direction": "no stable push turns the chain, and none goes in the direction of the goal",
    "one-sided": "the chain turns only to one side",
    "wide turns": "the turns are too wide for the free space",
    "force": "the robot has too little force for some of the stable pushes",
    "boxed in": "hardly any push is possible from the start or into the goal",
    "order": "the search found no order of the objects",
    "closing": "an object is not sure to become flush with the load that is pushed onto it",
    "time": "the search ran out of time",
}
"""Causes of a diagnosis and their meanings."""


@dataclass(frozen=True)
class Diagnosis:
    """One reason why there is no plan.

    Attributes:
        cause: Cause, one of `CAUSES`.
        text: Sentence for the user, with the numbers.
        proven: Whether it proves that there is no plan; False marks a guess.
        numbers: Numbers by name, in SI units.
        blocking: Indices of the obstacles that separate start and goal, or box in an end or the robot, if known.
    """

    cause: str
    text: str
    proven: bool
    numbers: Mapping[str, float] = field(default_factory=dict)
    blocking: tuple[int, ...] = ()
