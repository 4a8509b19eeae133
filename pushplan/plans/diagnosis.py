"""Why there is no plan; apart from plans, so that checking a scenario need not load them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

CAUSES = {
    "gap": "a passage between start and goal is too narrow for the chain",
    "heading": "no stable push turns the chain, and the goal asks for another heading",
    "direction": "no stable push turns the chain, and the goal lies in a direction that none goes",
    "one-sided": "the chain turns to one side only",
    "wide turns": "the turns are wide for the room there is",
    "force": "the robot has not the force for some of the stable pushes",
    "boxed in": "hardly any push is possible from the start, or into the goal",
    "order": "no order of the objects was found",
    "closing": "an object does not surely become flush with what is pushed onto it",
    "time": "the search was not over",
}
"""What a diagnosis may name, and what it means."""


@dataclass(frozen=True)
class Diagnosis:
    """One reason why there is no plan.

    Attributes:
        cause: A word of `CAUSES`.
        text: The same in a sentence, with the numbers.
        proven: There is no plan for this reason; False stands for a guess.
        numbers: The numbers by name, SI units.
        blocking: Indices of the scenario's obstacles that part start and goal or box in an end or the robot, where
            they are known.
    """

    cause: str
    text: str
    proven: bool
    numbers: Mapping[str, float] = field(default_factory=dict)
    blocking: tuple[int, ...] = ()
