"""The searches of one plan: with one margin after the other until there is a path, by travel before by time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pushplan.planners.improve.session import Budget, Session
from pushplan.planners.infeasible.bounds import lower_bound
from pushplan.planners.infeasible.diagnosis import InfeasibilityMonitor
from pushplan.planners.ompl.search import Factory, search
from pushplan.planners.problem.objective import make_objective
from pushplan.planners.problem.problem import Posing, body_reach, sampling_box
from pushplan.plans.path import PushPath
from pushplan.plans.result import ProgressPoint
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

GLANCE = 0.125
"""Share of the budget that the largest margins have at first where the first path is all that is wanted.

Where one of them allows no path, half of the budget need not go by before that is taken for granted.
"""

GLANCES = 3
"""So many margins have it."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A search and what it was posed from.

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


@dataclass(frozen=True, eq=False)
class Search:
    """How every search of a plan is made.

    Attributes:
        stable: The set of the plan.
        make: What makes the planner.
        budget: Of all searches together.
        seed: Of the random numbers.
        began: `time.perf_counter` when posing began, which counts to the time limit.
        good_enough: Share above the lower bound at which a path is good enough; 0 asks for the best.
        progress: Called with every improvement.
        pose: Makes the compiled problems.
        known: (k, 4) arcs of a path that is free and stable with the first margin; None where there is none.
    """

    stable: StableSet
    make: Factory
    budget: Budget
    seed: int
    began: float
    good_enough: float = 0.0
    progress: Callable[[ProgressPoint], None] | None = None
    pose: Posing = field(default_factory=Posing)
    known: FloatArray | None = None
    points: list[ProgressPoint] = field(default_factory=list)

    def with_margins(self, scenario: Scenario, margins: Sequence[float]) -> Attempt:
        """Search with one margin after the other; return the first attempt with a path, or the last.

        Args:
            scenario: The problem.
            margins: To try, largest first.

        Raises:
            EmptyStableSetError: When no twist that the drive can make has the first margin.
        """
        attempt = None
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
        if (
            budget.first
        ):  # no path is compared with another: an objective that takes long to make is not needed
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
        if before is None or known is None:
            problem = self.pose(scenario, self.stable, self.began + budget.time_limit)
            if self.known is not None:  # its twists need not lie on a segment
                problem = problem._replace(
                    segments=np.vstack([problem.segments, np.tile(self.known[:, :3], 2)])
                )
        else:
            objective = make_objective(scenario, self.stable, before.problem.segments)
            problem = before.problem._replace(objective=objective)
        monitor = InfeasibilityMonitor(scenario, self.stable, problem, budget.time_limit)

        def improved(path: PushPath, cost: float, iterations: int, seconds: float) -> None:
            self.points.append(ProgressPoint(seconds, cost, iterations, path))
            if self.progress is not None:
                self.progress(self.points[-1])

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
            session.raise_lower_bound(
                lower_bound(scenario, self.pose.controls(scenario, self.stable).segments)
            )
        path = search(session, self.make, sampling_box(scenario), body_reach(scenario))
        return Attempt(scenario, session, monitor, path)
