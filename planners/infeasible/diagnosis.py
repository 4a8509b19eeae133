"""Why no path is found: what is proven, what may be the reason, and how far the search came.

It is looked into while a search goes on without a path, so that one that cannot end well ends soon, and after it.
"Cannot" is said of what is proven, "perhaps" of everything else.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

from pushplan.core.problem import Problem
from pushplan.planners.controls import straight_pushes
from pushplan.planners.infeasible.passage import passage_faults
from pushplan.planners.infeasible.pockets import boxed_in_faults
from pushplan.planners.infeasible.turning import turning_faults
from pushplan.plans.plan import Diagnosis
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.sets.stable_set import StableSet

FIRST_STEP = 0.1
"""Seconds of a search without a path before the first step is taken."""

PATIENCE = 80.0
"""The next step is taken when the search has gone on for so many times as long as the steps before took together.

A step takes up to about ten times as long as those before it, so they take up to about an eighth of a search.
"""

GROWTH = {"passage": 1.0, "pockets": 10.0}
"""So many times as long as the one before may a step of each stage take."""

A_CORNER = 1.2e-4
"""What a corner of an obstacle adds to the first step, at most, s: it is grown, and joined with what it touches."""


class InfeasibilityMonitor:
    """What may keep a search from a path, found out in steps, short ones first, until one proves that there is none.

    Args:
        scenario: The problem.
        stable: The set that it was posed in.
        problem: What is searched.
        limit: Seconds that a search may take: no step is taken that is likely to go on beyond.

    Attributes:
        reasons: What was found, proven or not.
    """

    def __init__(self, scenario: Scenario, stable: StableSet, problem: Problem, limit: float = math.inf) -> None:
        self.reasons: list[Diagnosis] = []
        self._stages = {
            "passage": _passages(scenario, problem),
            "pockets": _turns_and_pockets(scenario, stable, problem),
        }
        self._limit, self._due, self._spent = limit, FIRST_STEP, 0.0
        self._expected = A_CORNER * sum(  # a round obstacle counts as 16 corners
            16 if isinstance(obstacle, CircleObstacle) else len(obstacle.outline) for obstacle in scenario.obstacles
        )

    @property
    def proven(self) -> tuple[Diagnosis, ...]:
        """The reasons for which there is no path."""
        return tuple(item for item in self.reasons if item.proven)

    def settled(self, seconds: float) -> bool:
        """Return whether there is no path, as far as is known; take the next step if the time has come.

        Args:
            seconds: That the search has taken.
        """
        if seconds >= self._due and not self.proven and self._expected <= self._limit - seconds:
            self._take_step()
        return bool(self.proven)

    def take_all_steps(self, seconds: float = math.inf) -> None:
        """Find out all that can be in so many seconds, or that there is no path, and how narrow its passage is."""
        until = time.perf_counter() + seconds
        while self._stages and self._expected <= until - time.perf_counter():
            if self.proven and "passage" not in self._stages:
                return
            self._take_step()

    def _take_step(self) -> None:
        """Take the next step, if there is one."""
        if not self._stages:
            self._due = math.inf
            return
        stage = next(iter(self._stages))
        began = time.perf_counter()
        found = next(self._stages[stage], None)
        took = time.perf_counter() - began
        self._spent += took
        self._due = max(FIRST_STEP, PATIENCE * self._spent)
        if found is None:
            del self._stages[stage]
            return
        self._expected = GROWTH[stage] * took
        known = [(item.cause, item.proven) for item in found]
        self.reasons = [item for item in self.reasons if (item.cause, item.proven) not in known] + found


def _passages(scenario: Scenario, problem: Problem) -> Iterator[list[Diagnosis]]:
    yield from passage_faults(scenario, straight_pushes(problem.segments))


def _turns_and_pockets(scenario: Scenario, stable: StableSet, problem: Problem) -> Iterator[list[Diagnosis]]:
    yield turning_faults(scenario, stable, problem.segments)
    yield from boxed_in_faults(scenario, stable, problem)


def diagnose(
    monitor: InfeasibilityMonitor, extensions: int, error: tuple[float, float], seconds: float = math.inf
) -> tuple[Diagnosis, ...]:
    """Return what kept a search from finding a path: the proven reasons, or all that may be one.

    Args:
        monitor: What may have kept it.
        extensions: Arcs that were propagated.
        error: How far (m, rad) from the goal the nearest pose was that the search reached.
        seconds: What finding out may still take.
    """
    monitor.take_all_steps(seconds)
    return monitor.proven or (*monitor.reasons, _just_time(extensions, error, bool(monitor.reasons)))


def _just_time(extensions: int, error: tuple[float, float], guessed: bool) -> Diagnosis:
    first = "nothing proves that there is no way" if guessed else "nothing shows that there is no way"
    text = (
        f"{first}: {extensions} extensions came within {error[0]:.3g} m and {math.degrees(error[1]):.3g} deg of the "
        "goal, and more time or another seed may help"
    )
    numbers = {"extensions": float(extensions), "position": error[0], "angle": error[1]}
    return Diagnosis("time", text, False, numbers)
