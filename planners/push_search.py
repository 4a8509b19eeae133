"""Search for a single push, with successively lower margins, first by travel and then by time."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pushplan.core.problem import Problem
from pushplan.errors import OutOfTimeError, PlanningError
from pushplan.geometry.se2 import pose_error
from pushplan.planners.controls import margins_to_try
from pushplan.planners.infeasible.bounds import lower_bound, time_bound
from pushplan.planners.infeasible.diagnosis import InfeasibilityMonitor, diagnose
from pushplan.planners.outcome import Budget, Improvements, Outcome, Question, Segments, Steering, TaskSearch
from pushplan.planners.problem import Posing, make_objective, open_scene, rejoin, sampling_box
from pushplan.planners.search.common import Common
from pushplan.planners.search.planners import planner_named
from pushplan.planners.search.search import Factory, Search
from pushplan.planners.search.session import Session, StopRule
from pushplan.planners.validator import Validator
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.load import Load
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Nearest
from pushplan.plans.segment import Segment
from pushplan.plans.settings import Observer, PlanSettings
from pushplan.scenario.goals import EXACT
from pushplan.scenario.model import Scenario
from pushplan.scenario.room import placed, placement_errors
from pushplan.sets.force_limited_set import ForceLimitedSet
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

ROUNDING = 1e-9
"""Relative gap to the lower bound at which a path counts as optimal."""

STALL = 42_000
"""Iterations without a better path after which planning stops, for a time limit of 1 s.

The number grows with the square root of the limit, and for paths far above the lower bound (`StopRule.stall`).
Planning usually stops well before the time limit. Then the same seed gives the same plan on any machine.
"""

FIRST_TURN = 512
"""Iterations with the largest margin before the next one is tried, if the first path is enough.

So a margin without a path costs little time.
"""

LONGER_TURN = 0.5
"""Iterations with the largest margin before the next one is tried, as a share of the stall limit.

It holds if the path should be good: a path with a larger margin is worth more than an earlier path.
"""

NEXT_SHARE = 0.6
"""Total iterations of a margin as a share of those of the next larger margin.

If only the fourth of seven margins allows a path, 16 runs took up to 1.9 s with 0.5, 1.0 s with 0.6 and 0.7 s with
0.7. Rooms that the largest margin solves took no longer, but three of 40 paths in mazes had a smaller margin.
"""

NEAR_BEST = (0.01, 0.002)
"""Relative excess over the best value; the first path within each is timed too.

The best path touches the clearance in so many places that its blends may need stops there. Without these further
paths, plans of `two-crates` were 8 to 29 % above the bound (ten seeds). With them, they were 8 to 12 % above it.
"""

EXPLAINING, MOST_OF_LIMIT = 0.5, 0.1
"""Time (s) and share of the time limit that are reserved for a diagnosis; the smaller one counts."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A search with one margin, and its scenario.

    Attributes:
        scenario: Scenario with a number as margin.
        search: The search.
        path: Best path so far, after conversion from OMPL's form; None if there is none.
        others: Further paths that may be faster; those with more clearance come last.
    """

    scenario: Scenario
    search: Search
    path: PushPath | None = None
    others: tuple[PushPath, ...] = ()

    @property
    def session(self) -> Session:
        """State of the search."""
        return self.search.session


class PushSearch(TaskSearch):
    """Search for a single push of a load in contact with the plate. Data for other starts and goals are cached.

    Args:
        load: The pushed load.
        scenario: Scenario with room and settings.
        settings: Complete settings.
        posing: Factory of compiled problems.

    Attributes:
        stable: Stable set to plan in.
        margins: Margins to plan with, in the order in which they are tried.
        posing: Factory of compiled problems.
    """

    def __init__(self, load: Load, scenario: Scenario, settings: PlanSettings, posing: Posing) -> None:
        self.load, self.posing, self._settings = load, posing, settings
        self.stable: StableSet = load.stable_set(settings.set_name)
        self.margins = margins_to_try(scenario, self.stable)

    def of(self, scenario: Scenario, posing: Posing | None = None) -> PushSearch:
        """Return the search for a scenario with another start and goal, or in another room given `posing`."""
        other: PushSearch = object.__new__(PushSearch)
        other.load, other.posing = self.load.with_problem(scenario), posing or self.posing
        other._settings = self._settings
        other.stable, other.margins = self.stable, self.margins
        return other

    @property
    def set_name(self) -> str:
        """Name of the stable set."""
        return self.stable.name

    def with_obstacles(self, scenario: Scenario) -> PushSearch:
        """Return the search for a scenario that differs only in its obstacles."""
        return self.of(scenario, self.posing.in_room(open_scene(scenario)))

    def _check_ends(self, scenario: Scenario, validator: Validator) -> None:
        """Check that start and goal are free and different.

        Raises:
            PlanningError: If they are not.
        """
        both = np.stack([scenario.start, scenario.goal.pose_chain])
        if max(pose_error(*both)) < EXACT:
            raise PlanningError("the chain is at the goal already: there is nothing to push")
        if not validator.too_near(self.load, both):
            return
        wrong: list[str] = []
        for what, pose in zip(("start", "goal"), both, strict=True):
            wrong += placement_errors(what, placed(scenario.chain.bodies, pose), scenario)
        if wrong:
            raise PlanningError("; ".join(wrong))

    def steering(self) -> Steering:
        """Return the data for collision-free steering paths of the push."""
        posed, margin = self.load.problem.with_margin(self.margins[0]), self.margins[0]
        families = self.posing.controls(posed, self.stable).families
        return Steering(self.posing.scene(posed), families, self.stable, margin)

    def _rest(self, previous: PushPath, scenario: Scenario) -> FloatArray | None:
        """Return the arcs onto an earlier path and along its rest; None if none are free and stable."""
        steering = self.steering()
        return rejoin(
            steering.scene,
            steering.families,
            scenario.clearance,
            lambda twists: self.stable.margin(twists) > self.margins[0],
            previous,
            scenario.start,
            scenario.goal.pose_chain,
        )

    def search(self, question: Question, budget: Budget, observer: Observer) -> Outcome:
        """Return the best plan found; see `TaskSearch.search`."""
        scenario, limit = question.scenario, budget.time_limit
        self._check_ends(scenario, question.validator)
        reused = None if question.previous is None else self._rest(question.previous, scenario)
        stop = StopRule(
            limit,
            int(STALL * math.sqrt(limit)),
            max(budget.gap, ROUNDING),
            budget.first,
            budget.iterations,
            stop=observer.cancelled,
            explaining=min(EXPLAINING, MOST_OF_LIMIT * limit) if question.explain else 0.0,
        )
        improvements = Improvements(observer, budget.began)
        _, make = planner_named(self._settings.planner or scenario.planner.name)
        own = self if scenario is self.load.problem else self.of(scenario)
        searches = _Searches(own, scenario, make, stop, budget.seed, budget.began, budget.gap, improvements, reused)
        try:
            attempt = searches.with_margins()
        except OutOfTimeError as error:
            reason = str(error)
            explanation = (reason, (Diagnosis("time", reason, False),), None)
            return Outcome((), self.margins[0], self.margins[0], 0, (), _cost, explain=lambda: explanation)
        return own._outcome(attempt, searches.monitor, budget, improvements)

    def _outcome(
        self,
        attempt: Attempt,
        monitor: Callable[[], InfeasibilityMonitor],
        budget: Budget,
        improvements: Improvements,
    ) -> Outcome:
        session, posed = attempt.session, attempt.scenario
        paths = () if attempt.path is None else (attempt.path, *attempt.others)
        segments = self.posing.controls(posed, self.stable).segments
        return Outcome(
            tuple(self.segments(posed, path) for path in paths),
            self.margins[0],
            posed.required_margin,
            session.iterations,
            tuple(improvements.found),
            _cost,
            lambda found: _bound_of_objective(posed, segments, found),
            session.common.branches.ends,
            lambda: self._explain(attempt, monitor(), budget),
            session.problem.scene,
        )

    def segments(self, posed: Scenario, path: PushPath) -> Segments:
        """Return a path as the segments of a plan."""
        return (Segment.push(self.load, path, posed.poses, posed.required_margin),)

    def _explain(
        self, attempt: Attempt, monitor: InfeasibilityMonitor, budget: Budget
    ) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
        """Return the reasons for a failure, and the path that ends nearest to the goal."""
        session, posed = attempt.session, attempt.scenario
        path = session.nearest_path
        nearest = self.segments(posed, path)
        sound = len(path.twists) > 0 and not Validator(posed).flaw_of(nearest[0], self._settings.set_name)
        error = pose_error(path.end if sound else path.start, posed.goal.pose_chain)
        found = diagnose(monitor, session.extensions, error, min(EXPLAINING, budget.until - time.perf_counter()))
        if isinstance(self.stable, ForceLimitedSet):
            found = (*found, Diagnosis("force", self.stable.left_out, False))
        words = "; ".join(item.text for item in found)
        if not any(item.proven for item in found):
            allowed = "" if budget.iterations is None else f" or {budget.iterations} iterations"
            words = f"no path found within the time limit of {budget.time_limit:g} s{allowed}: {words}"
        return words, found, Nearest(nearest if sound else (), error)


def _cost(segments: Segments) -> float:
    return segments[0].cost


def bound_of_plan(posed: Scenario, stable: StableSet, found: Segments) -> float | None:
    """Return the lower bound for a plan of one push; its scenario has a number as margin."""
    return _bound_of_objective(posed, Posing().controls(posed, stable).segments, found)


def _bound_of_objective(posed: Scenario, segments: FloatArray, found: Segments) -> float | None:
    """Return the lower bound of the ranking objective: travel (m) or time (s); None for margins."""
    if posed.planner.cost == "margin":
        return None
    if posed.planner.cost == "time":
        timed = bool(found) and found[0].trajectory is not None
        return time_bound(posed, segments, found[0].duration if timed else math.inf)
    return lower_bound(posed, segments, found[0].cost if found else math.inf)


@dataclass(eq=False)
class _Searches:
    """The searches of one plan, one for each margin, which take turns.

    Attributes:
        of: Search that they belong to.
        scenario: Scenario of the problem.
        make: Factory of the planner.
        budget: Stopping rule of all searches together.
        seed: Seed of the random numbers.
        began: Value of `time.perf_counter` before the set-up, which counts towards the time limit.
        gap: Relative gap to the lower bound at which a path is good enough; 0 for the best path.
        improvements: Successively better paths.
        reused: Arcs that reuse an earlier path; None if there are none.
    """

    of: PushSearch
    scenario: Scenario
    make: Factory
    budget: StopRule
    seed: int
    began: float
    gap: float
    improvements: Improvements
    reused: FloatArray | None
    _monitor: InfeasibilityMonitor | None = None
    _common: Common | None = None

    def monitor(self) -> InfeasibilityMonitor:
        """Return the diagnosis of the searches. It uses the lowest margin, which allows the most paths."""
        if self._monitor is None:
            lowest = by_travel(self.scenario.with_margin(self.of.margins[-1]))
            pose = cache(lambda: self.of.posing(lowest, self.of.stable))
            self._monitor = InfeasibilityMonitor(lowest, self.of.stable, pose, self.budget.time_limit)
        return self._monitor

    def with_margins(self) -> Attempt:
        """Search with all margins in turns until one has a path. Return this attempt or the lowest margin's."""
        attempts: list[Attempt] = []
        for number, iterations in self._turns():
            if number == len(attempts):
                attempts.append(self._attempt(self.of.margins[number]))
            attempt = attempts[number]
            # A margin without a path can use half of the remaining budget before the next lower one is tried.
            lower_untried = len(attempts) == number + 1 < len(self.of.margins)
            used = self.budget.used(time.perf_counter() - self.began, attempt.session.iterations)
            attempt.session.take_turn(iterations, 0.5 * (1.0 + used) if lower_untried else 1.0)
            path = attempt.search.run()
            if path is not None:
                return self._ranked(replace(attempt, path=path))
            if attempt.session.finished:
                break
        return attempts[-1]

    def _turns(self) -> Iterator[tuple[int, float]]:
        """Yield the indices of margins with the iterations of their turns.

        In total, each margin gets `NEXT_SHARE` of the iterations of the next larger one, whose turn comes after it.
        """
        count = len(self.of.margins)
        if count == 1:
            yield 0, math.inf
        first = FIRST_TURN if self.budget.first else round(LONGER_TURN * self.budget.stall)
        for level in itertools.count():
            for number in reversed(range(min(level + 1, count))):
                yield number, round(first * max(1.0, 2.0 ** (level - 1) * NEXT_SHARE**number))

    def _ranked(self, attempt: Attempt) -> Attempt:
        """If paths are ranked by time, continue by time from the best path by travel.

        The search by travel uses at most half of the budget. It gives a good start: few metres in few arcs. A path
        found by time alone is not always faster.
        """
        margin = attempt.scenario.required_margin
        posed = self.scenario.with_margin(margin)
        if self.budget.first or posed.planner.cost != "time":
            return replace(attempt, scenario=posed)
        path, problem = attempt.path, attempt.session.problem
        assert path is not None
        objective = make_objective(posed, self.of.stable, problem.segments)
        session = self._session(posed, problem.with_objective(objective), self.budget)
        session.offer(np.column_stack([path.twists, path.lengths]))
        search = self._search(posed, session)
        best = search.run()
        return Attempt(
            posed, search, best, (path, *session.near_best(NEAR_BEST), *attempt.session.near_best(NEAR_BEST))
        )

    def _attempt(self, margin: float) -> Attempt:
        """Begin a search with a margin; by travel if paths are ranked by time."""
        posed, budget, posing = self.scenario.with_margin(margin), self.budget, self.of.posing
        if budget.first or posed.planner.cost == "time":
            # Rank by travel at first, because the other objectives take long to build.
            posed, budget = by_travel(posed), replace(budget, enough=0.5)
        problem = posing(posed, self.of.stable, self.began + budget.time_limit)
        if self.reused is not None:  # its twists may lie on no segment
            problem = problem.with_segments(np.vstack([problem.segments, np.tile(self.reused[:, :3], 2)]))
        session = self._session(posed, problem, budget)
        if self.reused is not None:
            session.offer(self.reused)
        return Attempt(posed, self._search(posed, session))

    def _session(self, posed: Scenario, problem: Problem, budget: StopRule) -> Session:
        bound = cache(lambda: lower_bound(posed, self.of.posing.controls(posed, self.of.stable).segments))

        def improved(path: PushPath, cost: float, iterations: int, seconds: float) -> None:
            self.improvements.add(cost, iterations, self.of.segments(posed, path), seconds)
            if self.gap > 0.0:  # computed late, because it takes longer than most first paths
                session.raise_lower_bound(bound())

        if self._common is None:
            self._common = Common(posed.start, problem.goal, time.perf_counter() - self.began)
        session = Session(
            problem,
            posed.start,
            budget,
            self.seed,
            improved,
            lambda seconds: self.monitor().settled(seconds),
            self._common,
        )
        return session

    def _search(self, posed: Scenario, session: Session) -> Search:
        return Search(session, self.make, sampling_box(posed), posed.chain.reach)


def by_travel(scenario: Scenario) -> Scenario:
    """Return the scenario with paths ranked by travel."""
    return scenario.with_planner(cost="travel")
