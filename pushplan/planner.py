"""Planning: prepare once, search, time, execute and validate, whatever the scenario asks for."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from pushplan.core.problem import reach as costs_of_words
from pushplan.errors import PlanningError, TimingError
from pushplan.planners.controls import MERIDIANS
from pushplan.planners.outcome import Budget, Outcome, Question, Segments
from pushplan.planners.search.planners import planner_named
from pushplan.planners.searches import prepare_search
from pushplan.planners.timing.blending import time_segments
from pushplan.planners.validator import Validator
from pushplan.plans.diagnosis import Diagnosis
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Nearest, Plan, reason_of
from pushplan.plans.settings import Observer, PlanOptions, PlanSettings, named
from pushplan.plans.trajectory import SAMPLE_RATE
from pushplan.scenario.file import scenario_of
from pushplan.scenario.model import Scenario
from pushplan.scenario.one_load import troubles_at_first
from pushplan.scenario.parts import Obstacle
from pushplan.sets.named import add_set
from pushplan.sets.stable_set import StableSet
from pushplan.sim.kinematic import execute
from pushplan.sim.robustness import least_robustness
from pushplan.util.arrays import FloatArray, numbers
from pushplan.util.names import FARTHEST
from pushplan.util.stopwatch import Stopwatch, no_collection


@named
def plan(scenario: Scenario | str | Path, *, watch: Stopwatch | None = None, **options: Unpack[PlanOptions]) -> Plan:
    """Plan how every object of a scenario gets to its goal.

    Args:
        scenario: One push, several pushes of one load, or several objects; or its file, or a packaged example's name.
        watch: Takes the time of the phases `preparing`, `search`, `timing`, `execution` and `validation`.
        **options: See `PlanSettings`; what they leave open is taken from the scenario.

    Returns:
        The plan; it is not `solved`, and has the reason, where none was found in time.

    Raises:
        PlanningError: When the problem cannot be posed.
        EmptyStableSetError: When no pusher twist keeps every contact.
    """
    watch, settings = watch or Stopwatch(), PlanSettings(**options)
    planner = Planner(scenario_of(scenario), settings=settings, watch=watch)
    return planner.solve(planner.scenario, planner.settings, watch, planner.began)


class Planner:
    """Plans in one scenario, prepared once: stable sets, contacts, collision scene and compiled code are kept.

    Args:
        scenario: Loads, room and settings.
        settings: How to plan, as far as a question does not say otherwise.
        meridians: How finely an omnidirectional pusher's twists are taken from the stable set; half as many take half
            the time to make. Of a single push only.
        rate: Samples per second of trajectories, at which they are executed and validated.
        watch: Takes the time of the phase `preparing`.
        **options: See `PlanSettings`, in place of `settings`.

    Attributes:
        scenario: With which questions are asked.
        settings: Complete.
        began: `time.perf_counter` when it began to prepare, compiled code being ready.

    Raises:
        PlanningError: When the settings do not go together with the scenario.
        EmptyStableSetError: When no pusher twist keeps every contact.
    """

    @named
    def __init__(
        self,
        scenario: Scenario,
        *,
        settings: PlanSettings | None = None,
        meridians: int = MERIDIANS,
        rate: float = SAMPLE_RATE,
        watch: Stopwatch | None = None,
        **options: Unpack[PlanOptions],
    ) -> None:
        asked = PlanSettings(**options) if settings is None else settings
        self.scenario = asked.applied(scenario)
        self.planner_name, _ = planner_named(asked.planner or scenario.planner.name)
        set_name = add_set(asked.stable_set or scenario.stability.set)
        self.settings = replace(asked.completed(scenario), stable_set=set_name)
        self.rate = rate
        with (watch or Stopwatch())("preparing"):
            self.began = time.perf_counter()
            with no_collection():
                self._search = prepare_search(self.scenario, self.settings, meridians)
            self._validator = Validator(self.scenario)

    def plan(
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        *,
        robot: ArrayLike | None = None,
        timed: bool = True,
        previous: PushPath | None = None,
        explain: bool = True,
        first: bool = True,
        seed: int | None = None,
        time_limit: float | None = None,
        iterations: int | None = None,
        gap: float | None = None,
        observer: Observer | None = None,
    ) -> Plan:
        """Return the first plan from one place to another, validated like every plan.

        Args:
            start: (3,) pose of the chain frame in the world; None stands for the scenario's. Of one load only.
            goal: (3,) likewise, or (g, 3) any of which will do where there may be several pushes.
            robot: (3,) pose of the plate frame in the world, where the plate need not be in contact.
            timed: Make, execute and validate the trajectory. Without it the paths alone are validated, which takes a
                tenth of the time; `trajectory`, `execution` and `robustness` are None.
            previous: An earlier path of a single push, in the contact's frame; a way onto it and along its rest,
                moved so that it ends at the goal, is the first candidate, so that a plan that is still good is kept.
            explain: Find out why there is no plan where none is found, which takes longer than some searches.
            first: See `PlanSettings`, like the next ones; None stands for the planner's.
            seed: Of the random numbers.
            time_limit: Seconds.
            iterations: Of the search, at most.
            gap: Share above the lower bound that is good enough.
            observer: Who is told.

        Raises:
            PlanningError: When a pose is none, too near to something, or start and goal are the same.
        """
        began = time.perf_counter()
        given = {"seed": seed, "time_limit": time_limit, "iterations": iterations, "gap": gap, "observer": observer}
        known: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        settings = replace(self.settings, first=first, **known)
        scenario = self._asked(start, goal, robot)
        return self.solve(scenario, settings, Stopwatch(), began, timed, previous, explain)

    def _asked(self, start: ArrayLike | None, goal: ArrayLike | None, robot: ArrayLike | None) -> Scenario:
        """Return the scenario with another start, goal and place of the robot."""
        scenario, task = self.scenario, self.scenario.task
        if all(value is None for value in (start, goal, robot)):
            return scenario
        asked = task.asked(
            None if start is None else _poses(start, "start")[0],
            None if goal is None else _poses(goal, "goal"),
            None if robot is None else _poses(robot, "robot")[0],
        )
        scenario = replace(scenario, task=asked)
        wrong = "" if task.held else "; ".join(text for _, text in troubles_at_first(scenario))
        if wrong:
            raise PlanningError(wrong)
        return scenario

    def reach(self, starts: ArrayLike, goals: ArrayLike) -> FloatArray:
        """Return the costs (n, m), m, of the cheapest collision-free steering paths between poses.

        From each of the starts (n, 3) to each of the goals (m, 3). A steering path is three stable arcs with the
        margin that is asked for first. The cost is inf where none is free, which does not say that there is no path;
        `plan` searches for one.

        Raises:
            PlanningError: When poses are not finite or not (k, 3), or the scenario is not of a single push.
        """
        steering = self._search.steering()
        both = (_poses(starts, "starts"), _poses(goals, "goals"))
        return costs_of_words(steering.scene, steering.families, *both, self.scenario.clearance)

    def with_obstacles(self, obstacles: Iterable[Obstacle]) -> Planner:
        """Return a planner among other obstacles; stable sets and contacts are kept.

        Raises:
            PlanningError: When one of them is no obstacle.
        """
        obstacles = tuple(obstacles)
        for k, one in enumerate(obstacles):
            if not isinstance(one, Obstacle):
                what = f"obstacle {k} is {one!r:.40}"
                raise PlanningError(f"{what}; allowed: PolygonObstacle and CircleObstacle")
        other: Planner = object.__new__(Planner)
        other.__dict__.update(self.__dict__)
        other.scenario = replace(self.scenario, obstacles=obstacles)
        other._search = self._search.with_obstacles(other.scenario)
        other._validator = Validator(other.scenario)
        return other

    @property
    def stable(self) -> StableSet:
        """The set that a single push is planned in."""
        return self._search.steering().stable

    @property
    def margin(self) -> float:
        """The margin that a single push is planned with first."""
        return self._search.steering().margin

    @property
    def twists(self) -> FloatArray:
        """(k, 3) stable twists that steering paths are made of, scaled to a cost rate of 1."""
        twists = np.unique(self._search.steering().families.reshape(-1, 3), axis=0)
        return np.asarray(twists[np.abs(twists).max(axis=1) > 0.0])

    def solve(
        self,
        scenario: Scenario,
        settings: PlanSettings,
        watch: Stopwatch,
        began: float,
        timed: bool = True,
        previous: PushPath | None = None,
        explain: bool = True,
    ) -> Plan:
        """Search, time, execute and validate.

        Args:
            scenario: As the planner's, but for starts and goals.
            settings: Complete.
            watch: Takes the time of the phases.
            began: `time.perf_counter` from which the time limit counts.
            timed: See `plan`.
            previous: See `plan`.
            explain: See `plan`.

        Raises:
            PlanningError: When a start or a goal is too near to something, or they are the same.
            EmptyStableSetError: When no pusher twist keeps every contact.
        """
        validator = self._validator.of(scenario)
        question = Question(scenario, validator, previous, explain)
        with watch("search"), no_collection():
            outcome = self._search.search(question, Budget.of(settings, began), settings.observer)
        seconds = time.perf_counter() - began
        with no_collection():
            return self._finished(scenario, settings, outcome, validator, watch, seconds, timed, explain)

    def _finished(
        self,
        scenario: Scenario,
        settings: PlanSettings,
        outcome: Outcome,
        validator: Validator,
        watch: Stopwatch,
        seconds: float,
        timed: bool,
        explain: bool,
    ) -> Plan:
        """Return what was found timed, executed and validated; else why nothing was found."""
        reason, execution = "", None
        diagnosis: tuple[Diagnosis, ...] = outcome.proofs
        nearest: Nearest | None = None
        segments = outcome.candidates[0] if outcome.candidates else ()
        if segments:
            scenario = scenario.settled(segments[-1].after).without_goals(outcome.undelivered)
            validator = validator.of(scenario)
        with watch("timing"):
            if segments and timed:
                segments, reason = self._fastest(scenario, outcome, settings.set_name)
        executed = bool(segments) and timed and not reason
        name = self._set_name(segments)
        with watch("execution"):
            if executed:
                execution = execute(scenario, segments, name)
        with watch("validation"):
            if not segments and not reason:
                reason, diagnosis, nearest = _why_not(outcome, settings, explain)
            elif not reason:
                reason = validator.flaw(segments, execution, settings.set_name)
        found, bound = segments if not reason else (), outcome.lower_bound
        undelivered = outcome.undelivered if found else {}
        if undelivered:
            reason = reason_of(undelivered, len(undelivered) + len(scenario.goals))
        return Plan(
            scenario,
            found,
            reason,
            self.planner_name,
            name,
            settings.seed or 0,
            cost=outcome.cost(found) if found else None,
            objective=scenario.planner.cost,
            lower_bound=(lambda: bound(found)) if callable(bound) else bound,
            first_solution_s=outcome.improvements[0].seconds if outcome.improvements else None,
            planning_s=seconds,
            iterations=outcome.iterations,
            improvements=outcome.improvements,
            margin_asked=outcome.margin_asked,
            margin=outcome.margin,
            tree=outcome.tree,
            diagnosis=diagnosis,
            nearest=nearest,
            execution=execution if found else None,
            robustness=(lambda: least_robustness(found)) if found and timed else None,
            remarks=outcome.remarks_on(scenario, found),
            undelivered=undelivered,
        )

    def _set_name(self, segments: Segments) -> str:
        loads = [segment.load for segment in segments if segment.load is not None]
        return loads[0].stable_set(self.settings.set_name).name if loads else self._search.set_name

    def _fastest(self, scenario: Scenario, outcome: Outcome, set_name: str | None) -> tuple[Segments, str]:
        """Return the plan that is driven fastest, timed; or the best one, and why none can be driven.

        Where paths are ranked by time, others are driven as well: an objective knows a motion only roughly. The best
        one comes last, as it needs the most stops.
        """
        fastest, least, reason = outcome.candidates[0], math.inf, ""
        for segments in reversed(outcome.candidates):
            try:
                timed = time_segments(scenario, segments, self.rate, set_name, outcome.scene, least)
            except TimingError as error:
                reason = f"a plan was found that cannot be driven: {error}"
                continue
            duration = sum(segment.duration for segment in timed)
            if duration < least:
                fastest, least = timed, duration
        return fastest, reason if least == math.inf else ""


def _why_not(
    outcome: Outcome, settings: PlanSettings, explain: bool
) -> tuple[str, tuple[Diagnosis, ...], Nearest | None]:
    """Return the reason, the diagnosis and the nearest plan of a search that found none."""
    if settings.observer.cancelled():
        return "the search was interrupted before it found a plan", (), None
    if not explain or outcome.explain is None:
        return "no plan was found in time", (), None
    return outcome.explain()


def _poses(poses: ArrayLike, what: str) -> FloatArray:
    """Return poses as (k, 3) numbers.

    Raises:
        PlanningError: When they are none.
    """
    array = np.atleast_2d(numbers(poses, what))
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise PlanningError(f"{what}: an array of shape {array.shape}; allowed: poses (k, 3)")
    wrong = array[~(np.abs(array) <= FARTHEST)]
    if len(wrong):
        raise PlanningError(f"{what}: a pose with {wrong[0]:g}; allowed: numbers (m, rad) up to {FARTHEST:g}")
    return array
