"""Why no path is found: what is proven, what may be the reason, and how far the search came.

It is looked into while a search goes on without a path, so that one that cannot end well ends soon, and after it.
"Cannot" is said of what is proven, "perhaps" of everything else.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

from pushplan.planners.infeasible.boxed_in import boxed_in_faults
from pushplan.planners.infeasible.passage import passage_faults
from pushplan.planners.infeasible.turning import turning_faults
from pushplan.planners.problem.controls import straight_pushes
from pushplan.planners.problem.problem import Problem
from pushplan.result import Diagnosis
from pushplan.scenario import Scenario
from pushplan.stable_sets.stable_set import StableSet

FIRST_DOUBT = 0.1
"""Seconds of a search without a path before the first step is taken."""

PATIENCE = 80.0
"""The next step is taken when the search has gone on for so many times as long as the steps before took together.

A step takes up to about ten times as long as those before it, so they take up to about an eighth of a search.
"""


class Doubts:
    """What may keep a search from a path, found out in steps, short ones first, until one proves that there is none.

    Args:
        scenario: The problem.
        stable: The set that it was posed in.
        problem: What is searched.

    Attributes:
        reasons: What was found, proven or not.
    """

    def __init__(self, scenario: Scenario, stable: StableSet, problem: Problem) -> None:
        self.reasons: list[Diagnosis] = []
        self._steps = _steps(scenario, stable, problem)
        self._due, self._spent = FIRST_DOUBT, 0.0

    @property
    def proven(self) -> tuple[Diagnosis, ...]:
        """The reasons for which there is no path."""
        return tuple(item for item in self.reasons if item.proven)

    def settled(self, seconds: float) -> bool:
        """Return whether there is no path, as far as is known; take the next step if the time has come.

        Args:
            seconds: That the search has taken.
        """
        if seconds >= self._due and not self.proven:
            self._take_step()
        return bool(self.proven)

    def take_all_steps(self) -> None:
        """Find out all that can be, or that there is no path."""
        while not self.proven and self._take_step():
            pass

    def _take_step(self) -> bool:
        """Take the next step; return whether there was one."""
        began = time.perf_counter()
        found = next(self._steps, None)
        self._spent += time.perf_counter() - began
        self._due = max(FIRST_DOUBT, PATIENCE * self._spent) if found is not None else math.inf
        self.reasons += found or []
        return found is not None


def _steps(scenario: Scenario, stable: StableSet, problem: Problem) -> Iterator[list[Diagnosis]]:
    found = [
        *passage_faults(scenario, straight_pushes(problem.segments)),
        *turning_faults(scenario, stable, problem.segments),
    ]
    boxed_in = boxed_in_faults(scenario, stable, problem)
    if not any(item.proven for item in found):  # the first step of these is as quick
        found += next(boxed_in)
    yield found
    yield from boxed_in


def diagnose(doubts: Doubts, extensions: int, error: tuple[float, float]) -> tuple[Diagnosis, ...]:
    """Return what kept a search from finding a path: the proven reasons, or all that may be one.

    Args:
        doubts: What may have kept it.
        extensions: Arcs that were propagated.
        error: How far (m, rad) from the goal the nearest pose was that the search reached.
    """
    doubts.take_all_steps()
    return doubts.proven or (*doubts.reasons, _just_time(extensions, error, bool(doubts.reasons)))


def _just_time(extensions: int, error: tuple[float, float], guessed: bool) -> Diagnosis:
    first = "nothing proves that there is no way" if guessed else "nothing shows that there is no way"
    text = (
        f"{first}: {extensions} extensions came within {error[0]:.3g} m and {math.degrees(error[1]):.3g} deg of the "
        "goal, and more time or another seed may help"
    )
    numbers = {"extensions": float(extensions), "position": error[0], "angle": error[1]}
    return Diagnosis("time", text, False, numbers)
