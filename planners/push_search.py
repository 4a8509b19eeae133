"""The search for one push: with one margin after the other until there is a path, by travel before by time."""

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
from pushplan.scenario.room import placed, placement_troubles
from pushplan.sets.force_limited_set import ForceLimitedSet
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

ROUNDING = 1e-9
"""Share of the lower bound by which an optimal path's cost may exceed it."""

STALL = 42_000
"""Iterations without a better path after which planning ends, for a time limit of 1 s; they grow with its root.

More are made for paths that are far above the lower bound, see `StopRule.stall`.

Planning is done in a fraction of the limit as a rule, and then the same seed gives the same plan on any machine.
"""

FIRST_TURN = 512
"""Iterations that the search with the largest margin has before the next one is tried, if any path will do.

Where one of them allows no path, little time goes by before that is taken for granted.
"""

LONGER_TURN = 0.5
"""The same, as a share of the iterations after which planning ends, where the path is to be good.

A larger margin that allows a path is worth more than a path that is found sooner.
"""

NEXT_SHARE = 0.6
"""Iterations of a margin, all in all, as a share of those of the next larger one.

Where only the fourth of seven margins allows a path, 16 runs took up to 1.9 s with 0.5, 1.0 s with 0.6 and 0.7 s with
0.7, rooms that the largest one solves as long as before; but of 40 paths in mazes, three had a smaller margin.
"""

NEAR_BEST = (0.01, 0.002)
"""Of a search, the first paths that exceed the best one by no more than these shares are timed, too.

The best path touches the clearance in so many places that its blends may need stops there. Without these paths, plans
of `two-crates` were 8 to 29 % above the bound (ten seeds); with them, 8 to 12 %.
"""

EXPLAINING, MOST_OF_LIMIT = 0.5, 0.1
"""Seconds, and share of the time limit, that are kept for finding out why there is no path: the smaller one."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A search with one margin and what it was posed from.

    Attributes:
        scenario: The problem, its margin a number.
        search: What goes on with it.
        path: The best path so far, as the planner left it in OMPL's form; None without any.
        others: Further paths that may be driven faster; the ones with more room around them come last.
    """

    scenario: Scenario
    search: Search
    path: PushPath | None = None
    others: tuple[PushPath, ...] = ()

    @property
    def session(self) -> Session:
        """The state of the search."""
        return self.search.session


class PushSearch(TaskSearch):
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
        self.load, self.posing, self._settings = load, posing, settings
        self.stable: StableSet = load.stable_set(settings.set_name)
        self.margins = margins_to_try(scenario, self.stable)

    def of(self, scenario: Scenario, posing: Posing | None = None) -> PushSearch:
        """Return it for a scenario with other starts and goals, or in another room if `posing` is for that."""
        other: PushSearch = object.__new__(PushSearch)
        other.load, other.posing = self.load.with_problem(scenario), posing or self.posing
        other._settings = self._settings
        other.stable, other.margins = self.stable, self.margins
        return other

    @property
    def set_name(self) -> str:
        """Name of the set that is planned in."""
        return self.stable.name

    def with_obstacles(self, scenario: Scenario) -> PushSearch:
        """See `TaskSearch`."""
        return self.of(scenario, self.posing.in_room(open_scene(scenario)))

    def _check_ends(self, scenario: Scenario, validator: Validator) -> None:
        """Refuse a start or a goal that is too near to something, and a goal that is the start.

        Raises:
            PlanningError: With what is wrong.
        """
        both = np.stack([scenario.start, scenario.goal.pose_chain])
        if max(pose_error(*both)) < EXACT:
            raise PlanningError("the chain is at the goal already: there is nothing to push")
        if not validator.too_near(self.load, both):
            return
        wrong: list[str] = []
        for what, pose in zip(("start", "goal"), both, strict=True):
            wrong += placement_troubles(what, placed(scenario.chain.bodies, pose), scenario)
        if wrong:
            raise PlanningError("; ".join(wrong))

    def steering(self) -> Steering:
        """See `TaskSearch`."""
        posed, margin = self.load.problem.with_margin(self.margins[0]), self.margins[0]
        families = self.posing.controls(posed, self.stable).families
        return Steering(self.posing.scene(posed), families, self.stable, margin)

    def _rest(self, previous: PushPath, asked: Scenario) -> FloatArray | None:
        """Return the arcs of a way onto an earlier path and along its rest, None where none is free and stable."""
        steering = self.steering()
        return rejoin(
            steering.scene,
            steering.families,
            asked.clearance,
            lambda twists: self.stable.margin(twists) > self.margins[0],
            previous,
            asked.start,
            asked.goal.pose_chain,
        )

    def search(self, question: Question, budget: Budget, observer: Observer) -> Outcome:
        """See `TaskSearch`."""
        scenario, limit = question.scenario, budget.time_limit
        self._check_ends(scenario, question.validator)
        known = None if question.previous is None else self._rest(question.previous, scenario)
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
        searches = _Searches(own, scenario, make, stop, budget.seed, budget.began, budget.gap, improvements, known)
        try:
            attempt = searches.with_margins()
        except OutOfTimeError as error:
            reason = str(error)
            told = (reason, (Diagnosis("time", reason, False),), None)
            return Outcome((), self.margins[0], self.margins[0], 0, (), _cost, explain=lambda: told)
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
        """Find out why there is no path, and how near to the goal one ends."""
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
    """Return the lower bound that belongs to a plan of one push; its scenario states the margin as a number."""
    return _bound_of_objective(posed, Posing().controls(posed, stable).segments, found)


def _bound_of_objective(posed: Scenario, segments: FloatArray, found: Segments) -> float | None:
    """Return what no plan beats of what ranks plans: travel (m) or time (s); of margins nothing is known."""
    if posed.planner.cost == "margin":
        return None
    if posed.planner.cost == "time":
        timed = bool(found) and found[0].trajectory is not None
        return time_bound(posed, segments, found[0].duration if timed else math.inf)
    return lower_bound(posed, segments, found[0].cost if found else math.inf)


@dataclass(eq=False)
class _Searches:
    """The searches of one plan, with one margin each: how they are made, and how they take turns.

    Attributes:
        of: What they rest on.
        scenario: The problem.
        make: What makes the planner.
        budget: Of all searches together.
        seed: Of the random numbers.
        began: `time.perf_counter` when preparing began, which counts to the time limit.
        good_enough: Share above the lower bound at which a path is good enough; 0 asks for the best.
        improvements: Better and better paths.
        known: See `PushSearch.search`.
    """

    of: PushSearch
    scenario: Scenario
    make: Factory
    budget: StopRule
    seed: int
    began: float
    good_enough: float
    improvements: Improvements
    known: FloatArray | None
    _monitor: InfeasibilityMonitor | None = None
    _common: Common | None = None

    def monitor(self) -> InfeasibilityMonitor:
        """Return what may keep the searches from a path; it is of the lowest margin, with which most is possible."""
        if self._monitor is None:
            lowest = by_travel(self.scenario.with_margin(self.of.margins[-1]))
            pose = cache(lambda: self.of.posing(lowest, self.of.stable))
            self._monitor = InfeasibilityMonitor(lowest, self.of.stable, pose, self.budget.time_limit)
        return self._monitor

    def with_margins(self) -> Attempt:
        """Search with all margins, in turns, until one allows a path; return that attempt, or that of the lowest."""
        attempts: list[Attempt] = []
        for number, iterations in self._turns():
            if number == len(attempts):
                attempts.append(self._attempt(self.of.margins[number]))
            attempt = attempts[number]
            # Half of what is left of the budget may go by without a path before a lower margin is tried at all.
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
        """Yield the numbers of margins with the iterations of their turns.

        Each margin gets `NEXT_SHARE` of what the next larger one gets, in all, which has its turn after it.
        """
        count = len(self.of.margins)
        if count == 1:
            yield 0, math.inf
        first = FIRST_TURN if self.budget.first else round(LONGER_TURN * self.budget.stall)
        for level in itertools.count():
            for number in reversed(range(min(level + 1, count))):
                yield number, round(first * max(1.0, 2.0 ** (level - 1) * NEXT_SHARE**number))

    def _ranked(self, attempt: Attempt) -> Attempt:
        """Go on by time where paths are ranked by it, from the path that is best by travel.

        Fewest metres in few arcs make a good start, for half of the budget at most: a path found by time alone is not
        always the faster one.
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
        """Begin to search with a margin; by travel where paths are ranked by time."""
        posed, budget, posing = self.scenario.with_margin(margin), self.budget, self.of.posing
        if budget.first or posed.planner.cost == "time":
            # No first path is compared with another: an objective that takes long to make is not needed.
            posed, budget = by_travel(posed), replace(budget, enough=0.5)
        problem = posing(posed, self.of.stable, self.began + budget.time_limit)
        if self.known is not None:  # its twists need not lie on a segment
            problem = problem.with_segments(np.vstack([problem.segments, np.tile(self.known[:, :3], 2)]))
        session = self._session(posed, problem, budget)
        if self.known is not None:
            session.offer(self.known)
        return Attempt(posed, self._search(posed, session))

    def _session(self, posed: Scenario, problem: Problem, budget: StopRule) -> Session:
        bound = cache(lambda: lower_bound(posed, self.of.posing.controls(posed, self.of.stable).segments))

        def improved(path: PushPath, cost: float, iterations: int, seconds: float) -> None:
            self.improvements.add(cost, iterations, self.of.segments(posed, path), seconds)
            if self.good_enough > 0.0:  # it takes longer than most first paths, which need not wait for it
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
