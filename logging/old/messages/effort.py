"""What planning took, as metadata: the one part of a plan that two runs with the same seed do not share.

Numbers are written with 18 significant digits, so every double comes back bit for bit, and all take the same
room, so that no other byte of the file moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pushplan.plans.result import PlanResult

_NONE = "none"


@dataclass(frozen=True)
class Effort:
    """Wall-clock seconds since planning began, and the work done in them.

    Attributes:
        planning_s: Planning took so long.
        first_solution_s: The first path was found, or None.
        progress_s: The best path improved.
        extensions: Number of arcs propagated.
    """

    planning_s: float
    first_solution_s: float | None
    progress_s: tuple[float, ...]
    extensions: int

    @classmethod
    def from_plan(cls, plan: PlanResult) -> Effort:
        """Return what `plan` took."""
        seconds = tuple(point.seconds for point in plan.progress)
        return cls(plan.planning_s, plan.first_solution_s, seconds, plan.extensions)

    @classmethod
    def from_words(cls, words: Mapping[str, str]) -> Effort:
        """Return what `to_words` wrote.

        Raises:
            KeyError: When a word is missing.
            ValueError: When one is not a number.
        """
        first = words["first_solution_s"]
        return cls(
            planning_s=float(words["planning_s"]),
            first_solution_s=None if first == _NONE else float(first),
            progress_s=tuple(map(float, words["progress_s"].split())),
            extensions=int(words["extensions"]),
        )

    def to_words(self) -> dict[str, str]:
        """Return the metadata."""
        first = self.first_solution_s
        return {
            "planning_s": exact(self.planning_s),
            "first_solution_s": _NONE if first is None else exact(first),
            "progress_s": " ".join(map(exact, self.progress_s)),
            "extensions": f"{self.extensions:012d}",
        }


def exact(number: float) -> str:
    """Return `number` in words of fixed width that give it back bit for bit."""
    return f"{number:.17e}"
