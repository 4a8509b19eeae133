"""The search for one push: with one margin after the other until there is a path, by travel before by time."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pushplan.errors import OutOfTimeError
from pushplan.geometry.se2 import pose_error
from pushplan.planners.controls import margins_to_try
from pushplan.planners.infeasible.bounds import lower_bound
from pushplan.planners.infeasible.diagnosis import InfeasibilityMonitor, diagnose
from pushplan.planners.outcome import Improvements, Outcome, Segments
from pushplan.planners.problem import Posing, body_reach, make_objective, sampling_box
from pushplan.planners.search.planners import planner_named
from pushplan.planners.search.search import Factory, search
from pushplan.planners.search.session import Budget, Session
from pushplan.planners.validator import Validator
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Diagnosis, Load, Nearest, Segment
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

ROUNDING = 1e-9
"""Share of the lower bound by which an optimal path's cost may exceed it."""

STALL = 42_000
"""Iterations without a better path after which planning ends, for a time limit of 1 s; they grow with its root.

More are made for paths that are far above the lower bound, see `Budget.stall`.

Planning is done in a fraction of the limit as a rule, and then the same seed gives the same plan on any machine.
"""

GLANCE = 0.125
"""Share of the budget that the largest margins have at first where the first path is all that is wanted.

Where one of them allows no path, half of the budget need not go by before that is taken for granted.
"""

GLANCES = 3
"""So many margins have it."""

EXPLAINING = 0.5
"""Seconds that finding out why there is no path may take."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A search with one margin and what it was posed from.

    Attributes:
        scenario: The problem, its margin a number.
        session: The search, over.
        monitor: What may have kept it from a path.
        path: The best path, as the planner left it in OMPL's form; None without any.
        others: Further paths that were best by another objective.
    """

    scenario: Scenario
    session: Session
    monitor: InfeasibilityMonitor
    path: PushPath | None
    others: tuple[PushPath, ...] = ()


class PushSearch:
    """Searches for one push of a load that the plate touches already; what does not depend on start and goal is kept.

    Args:
        load: What is pushed.
        scenario: Room and settings.
        settings: Complete.
        posing: Makes the compiled problems.

    Attributes:
        stable: The set that is planned in.
        margins: To plan with, one after the other until there is a path.
        posing: Makes the compiled problems.
    """

    def __init__(self, load: Load, scenario: Scenario, settings: PlanSettings, posing: Posing) -> None:
        self.load, self.posing = load, posing
        self.stable: StableSet = load.stable_set(settings.set_name)
        self.margins = margins_to_try(scenario, self.stable)

    def of(self, scenario: Scenario, posing: Posing | None = None) -> PushSearch:
        """Return it for a scenario with other starts and goals, or in another room if `posing` is for that."""
        other: PushSearch = object.__new__(PushSearch)
        other.load, other.posing = self.load.with_problem(scenario), posing or self.posing
        other.stable, other.margins = self.stable, self.margins
        return other

    def search(
        self, scenario: Scenario, settings: PlanSettings, began: float, known: FloatArray | None = None
    ) -> Outcome:
        """Return the best path that was found.

        Args:
            scenario: The problem.
            settings: Complete.
            began: `time.perf_counter` from which the time limit counts.
            known: (k, 4) arcs of a path that is free and stable with the first margin; None where there is none.

        Raises:
            EmptyStableSetError: When no twist that the drive can make has the first margin.
        """
        limit, gap = settings.time_limit, settings.gap
        assert limit is not None
        assert gap is not None
        assert settings.seed is not None
        budget = Budget(
            limit,
            int(STALL * math.sqrt(limit)),
            max(gap, ROUNDING),
            settings.first,
            settings.iterations,
            stop=settings.observer.cancelled,
        )
        improvements = Improvements(settings.observer, began)
        make = planner_named(settings.planner)[1] if settings.planner is not None else None
        assert make is not None
        searches = _Searches(self, make, budget, settings.seed, began, gap, improvements, known)
        try:
            attempt = searches.with_margins(scenario)
        except OutOfTimeError as error:
            reason = str(error)
            told = (reason, (Diagnosis("time", reason, False),), None)
            return Outcome((), self.margins[0], self.margins[0], 0, (), _cost, explain=lambda: told)
        return self._outcome(attempt, settings, improvements)

    def _outcome(self, attempt: Attempt, settings: PlanSettings, improvements: Improvements) -> Outcome:
        session, posed = attempt.session, attempt.scenario
        paths = () if attempt.path is None else (attempt.path, *attempt.others)
        segments = self.posing.controls(posed, self.stable).segments
        return Outcome(
            tuple(self.segments(posed, path) for path in paths),
            self.margins[0],
            posed.required_margin,
            session.extensions,
            tuple(improvements.found),
            _cost,
            lambda found: lower_bound(posed, segments, _cost(found) if found else math.inf),
            session.branches.ends,
            lambda: self._explain(attempt, settings),
            session.problem.scene,
        )

    def segments(self, posed: Scenario, path: PushPath) -> Segments:
        """Return a path as the segments of a plan."""
        return (Segment.push(self.load, path, posed.poses, posed.required_margin),)

    def _explain(
        self, attempt: Attempt, settings: PlanSettings
    ) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
        """Find out why there is no path, and how near to the goal one ends."""
        session, posed = attempt.session, attempt.scenario
        path = session.nearest_path
        nearest = self.segments(posed, path)
        sound = len(path.twists) > 0 and not Validator(posed).flaw_of(nearest[0], settings.set_name)
        error = pose_error(path.end if sound else path.start, posed.goal.pose_chain)
        found = diagnose(attempt.monitor, session.extensions, error, EXPLAINING)
        words = "; ".join(item.text for item in found)
        if not any(item.proven for item in found):
            allowed = "" if settings.iterations is None else f" or {settings.iterations} iterations"
            words = f"no path found within the time limit of {settings.time_limit:g} s{allowed}: {words}"
        return words, found, Nearest(nearest if sound else (), error)


def _cost(segments: Segments) -> float:
    return segments[0].cost


@dataclass(frozen=True, eq=False)
class _Searches:
    """The searches of one plan: how every one of them is made.

    Attributes:
        of: What they rest on.
        make: What makes the planner.
        budget: Of all searches together.
        seed: Of the random numbers.
        began: `time.perf_counter` when preparing began, which counts to the time limit.
        good_enough: Share above the lower bound at which a path is good enough; 0 asks for the best.
        improvements: Better and better paths.
        known: See `PushSearch.search`.
    """

    of: PushSearch
    make: Factory
    budget: Budget
    seed: int
    began: float
    good_enough: float
    improvements: Improvements
    known: FloatArray | None

    def with_margins(self, scenario: Scenario) -> Attempt:
        """Search with one margin after the other; return the first attempt with a path, or the last."""
        attempt, margins = None, self.of.margins
        for seed, margin, share in self._turns(margins):
            budget = replace(self.budget, patience=share)
            attempt = replace(self, seed=seed)._attempt(scenario.with_margin(margin), budget, attempt)
            if attempt.path is not None or self._is_over(attempt, margin == margins[-1]):
                break
        assert attempt is not None
        return attempt

    def _turns(self, margins: Sequence[float]) -> Iterator[tuple[int, float, float]]:
        """Yield seeds and margins with the share of the budget after which a search without a path gives way."""
        share, seed = 0.0, self.seed
        if self.budget.first and len(margins) > 1:
            for margin in margins[:GLANCES]:
                share += GLANCE
                yield seed, margin, share
            seed += 1
        for k, margin in enumerate(margins):
            # Half of what is left of the budget may go by without a path before a lower margin is tried.
            share = 1.0 if k == len(margins) - 1 else 0.5 * (1.0 + share)
            yield seed, margin, share

    def _is_over(self, attempt: Attempt, lowest: bool) -> bool:
        """Whether no other margin has time left, or could help; what is proven with the lowest holds with all."""
        session = attempt.session
        # Of all that can be proven, only a passage that is too narrow stands in the way with every margin.
        proven = any(lowest or fault.cause == "gap" for fault in attempt.monitor.proven)
        return proven or self.budget.is_used_up(time.perf_counter() - self.began, session.iterations)

    def _attempt(self, scenario: Scenario, budget: Budget, before: Attempt | None) -> Attempt:
        """Search with the scenario's margin; by travel first where paths are ranked by time."""
        earlier = None if before is None else before.session
        by_travel = replace(scenario, planner=replace(scenario.planner, cost="travel"))
        if budget.first:
            # No path is compared with another: an objective that takes long to make is not needed.
            return replace(self._run(by_travel, budget, earlier), scenario=scenario)
        if scenario.planner.cost != "time":
            return self._run(scenario, budget, earlier)
        # Fewest metres in few arcs make a good start, for half of the budget at most: a path found by time alone is
        # not always the faster one.
        first = self._run(by_travel, replace(budget, enough=0.5), earlier)
        if first.path is None:
            return first
        second = self._run(scenario, budget, first.session, first.path)
        return replace(second, others=(first.path,))

    def _run(
        self, scenario: Scenario, budget: Budget, before: Session | None, known: PushPath | None = None
    ) -> Attempt:
        """Search once, from a path known to the search before if there is one: only the objective is another then."""
        stable, posing = self.of.stable, self.of.posing
        if before is None or known is None:
            problem = posing(scenario, stable, self.began + budget.time_limit)
            if self.known is not None:  # its twists need not lie on a segment
                problem = problem.with_segments(np.vstack([problem.segments, np.tile(self.known[:, :3], 2)]))
        else:
            objective = make_objective(scenario, stable, before.problem.segments)
            problem = before.problem.with_objective(objective)
        monitor = InfeasibilityMonitor(scenario, stable, problem, budget.time_limit)

        def improved(path: PushPath, cost: float, iterations: int, seconds: float) -> None:
            self.improvements.add(cost, iterations, self.of.segments(scenario, path), seconds)

        session = Session(
            problem,
            scenario.start,
            budget,
            self.seed,
            improved,
            monitor.settled,
            before,
            time.perf_counter() - self.began,
        )
        if known is not None:
            session.offer(np.column_stack([known.twists, known.lengths]))
        elif self.known is not None:
            session.offer(self.known)
        if self.good_enough > 0.0:
            session.raise_lower_bound(lower_bound(scenario, posing.controls(scenario, stable).segments))
        path = search(session, self.make, sampling_box(scenario), body_reach(scenario))
        return Attempt(scenario, session, monitor, path)
