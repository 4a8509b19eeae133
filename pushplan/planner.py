"""Plans a scenario of any kind: prepares once, then searches, times, executes and validates."""

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
from pushplan.scenario.one_load import start_errors
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
    """Plan the pushes that bring every object of a scenario to its goal.

    Args:
        scenario: Scenario of any kind, its file, or the name of a packaged example.
        watch: Measures the phases `preparing`, `search`, `timing`, `execution` and `validation`.
        **options: See `PlanSettings`; the scenario provides those that are not given.

    Returns:
        The plan. If no plan is found in time, `solved` is False and `reason` says why.

    Raises:
        PlanningError: If the problem is invalid.
        EmptyStableSetError: If no pusher twist keeps every contact.
    """
    watch, settings = watch or Stopwatch(), PlanSettings(**options)
    planner = Planner(scenario_of(scenario), settings=settings, watch=watch)
    return planner.solve(planner.scenario, planner.settings, watch, planner.began)


class Planner:
    """Plans several times in one scenario and keeps its stable sets, contacts and collision scene.

    Args:
        scenario: Loads, room and settings.
        settings: Default settings of every plan.
        meridians: Resolution of the stable set for an omnidirectional pusher, for a single push only. Half as many
            meridians take half the time to compute.
        rate: Sampling rate of trajectories in execution and validation, 1/s.
        watch: Measures the phase `preparing`.
        **options: See `PlanSettings`; they replace `settings`.

    Attributes:
        scenario: The scenario with the settings applied.
        settings: The settings, completed from the scenario.
        began: Time at which the preparation began (`time.perf_counter`), s.

    Raises:
        PlanningError: If the settings do not fit the scenario.
        EmptyStableSetError: If no pusher twist keeps every contact.
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
        given = PlanSettings(**options) if settings is None else settings
        self.scenario = given.applied(scenario)
        self.planner_name, _ = planner_named(given.planner or scenario.planner.name)
        set_name = add_set(given.stable_set or scenario.stability.set)
        self.settings = replace(given.completed(scenario), stable_set=set_name)
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
        """Return the first plan from a start to a goal, validated like every plan.

        Args:
            start: Pose (3,) of the chain frame in the world, for a single load only; None for the scenario's start.
            goal: Pose (3,) of the chain frame in the world; for a multi-push plan also alternative poses (g, 3).
            robot: Pose (3,) of the plate frame in the world, if the plate need not be in contact.
            timed: Compute, execute and validate the trajectory. If False, only the paths are validated, which takes
                a tenth of the time, and `trajectory`, `execution` and `robustness` are None.
            previous: Earlier path of a single push, in the contact's frame. The first candidate is a path onto it
                and along its rest, moved to end at the goal. A plan that is still good is kept this way.
            explain: Explain a failure. This takes longer than some searches.
            first: See `PlanSettings`. For this and the next arguments, None means the planner's setting.
            seed: Seed of the random numbers.
            time_limit: Time limit, s.
            iterations: Largest number of search iterations.
            gap: Optimality gap at which the search ends.
            observer: Callbacks for messages, progress and cancelling.

        Raises:
            PlanningError: If a pose is invalid or too near to an obstacle, or start and goal are the same.
        """
        began = time.perf_counter()
        given = {"seed": seed, "time_limit": time_limit, "iterations": iterations, "gap": gap, "observer": observer}
        known: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        settings = replace(self.settings, first=first, **known)
        scenario = self._with_poses(start, goal, robot)
        return self.solve(scenario, settings, Stopwatch(), began, timed, previous, explain)

    def _with_poses(self, start: ArrayLike | None, goal: ArrayLike | None, robot: ArrayLike | None) -> Scenario:
        """Return the scenario with another start, goal and pose of the robot."""
        scenario, task = self.scenario, self.scenario.task
        if all(value is None for value in (start, goal, robot)):
            return scenario
        task = task.with_poses(
            None if start is None else _poses(start, "start")[0],
            None if goal is None else _poses(goal, "goal"),
            None if robot is None else _poses(robot, "robot")[0],
        )
        scenario = replace(scenario, task=task)
        wrong = "" if task.held else "; ".join(text for _, text in start_errors(scenario))
        if wrong:
            raise PlanningError(wrong)
        return scenario

    def reach(self, starts: ArrayLike, goals: ArrayLike) -> FloatArray:
        """Return the costs (n, m), m, of the cheapest collision-free steering paths from starts to goals.

        A steering path consists of three stable arcs with the margin that `plan` tries first. The cost is inf if no
        steering path is collision-free; `plan` can still find a path then.

        Args:
            starts: Poses (n, 3) of the chain frame in the world.
            goals: Poses (m, 3) of the chain frame in the world.

        Raises:
            PlanningError: If poses are not finite or not (k, 3), or the scenario is not of a single push.
        """
        steering = self._search.steering()
        both = (_poses(starts, "starts"), _poses(goals, "goals"))
        return costs_of_words(steering.scene, steering.families, *both, self.scenario.clearance)

    def with_obstacles(self, obstacles: Iterable[Obstacle]) -> Planner:
        """Return a planner with other obstacles that keeps stable sets and contacts.

        Raises:
            PlanningError: If an item is not an obstacle.
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
        """The stable set of a single push."""
        return self._search.steering().stable

    @property
    def margin(self) -> float:
        """The first margin that a single push is planned with."""
        return self._search.steering().margin

    @property
    def twists(self) -> FloatArray:
        """Stable twists (k, 3) of the steering paths, scaled to a cost rate of 1."""
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
            scenario: The planner's scenario, with any start and goal.
            settings: Complete settings.
            watch: Measures the phases.
            began: Start of the time limit (`time.perf_counter`), s.
            timed: See `plan`.
            previous: See `plan`.
            explain: See `plan`.

        Raises:
            PlanningError: If a start or a goal is too near to an obstacle, or they are the same.
            EmptyStableSetError: If no pusher twist keeps every contact.
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
        """Time, execute and validate the search's result; return the plan, or the reason why there is none."""
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
        """Return the fastest candidate, timed; if none can be timed, the best one and the reason.

        If paths are ranked by time, all candidates are timed, because the objective only estimates the duration. The
        best one comes last, because it needs the most stops.
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
    """Return poses as an array (k, 3).

    Raises:
        PlanningError: If they are not poses.
    """
    array = np.atleast_2d(numbers(poses, what))
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise PlanningError(f"{what}: an array of shape {array.shape}; allowed: poses (k, 3)")
    wrong = array[~(np.abs(array) <= FARTHEST)]
    if len(wrong):
        raise PlanningError(f"{what}: a pose with {wrong[0]:g}; allowed: numbers (m, rad) up to {FARTHEST:g}")
    return array
