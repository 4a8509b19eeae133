"""From a scenario and what planning in it rests on to a checked result: search, timing, execution, verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from pushplan.errors import OutOfTimeError, PlanningError, TimingError
from pushplan.geometry.se2 import pose_error
from pushplan.planners.attempts import Attempt, Search
from pushplan.planners.failure import Failure, explain_failure
from pushplan.planners.improve.session import Branches, Budget
from pushplan.planners.infeasible.bounds import lower_bound
from pushplan.planners.ompl.search import Factory
from pushplan.planners.problem.controls import margins_to_try
from pushplan.planners.problem.problem import Posing
from pushplan.planners.trajectories import make_trajectory
from pushplan.planners.validation.clearance import Room
from pushplan.planners.validation.verdict import EXACT, path_verdict, verdict
from pushplan.plans.judge import planning_set
from pushplan.plans.path import PushPath
from pushplan.plans.result import Diagnosis, PlanResult, ProgressPoint
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.scenario.model import Scenario
from pushplan.scenario.room import Surroundings, placed, placement_troubles
from pushplan.sets.stable_set import StableSet
from pushplan.sim.judging import execute_trajectory
from pushplan.sim.robustness import robustness_of
from pushplan.util.arrays import FloatArray
from pushplan.util.collection import no_collection
from pushplan.util.stopwatch import Stopwatch

ROUNDING = 1e-9
"""Share of the lower bound by which an optimal path's cost may exceed it."""

STALL = 42_000
"""Iterations without a better path after which planning ends, for a time limit of 1 s; they grow with its root.

More are made for paths that are far above the lower bound, see `Budget.stall`.

Planning is done in a fraction of the limit as a rule, and then the same seed gives the same plan on any machine.
"""


@dataclass(frozen=True, eq=False)
class Means:
    """What planning rests on, the same for many starts and goals.

    Attributes:
        stable: The set to plan in.
        margins: To plan with, one after the other until there is a path.
        room: What is in the way, for the checker.
        pose: Makes the compiled problem of a scenario.
        timed: Whether paths are timed, executed and checked as trajectories.
        rate: Samples per second of these.
    """

    stable: StableSet
    margins: tuple[float, ...]
    room: Room
    pose: Posing = field(default_factory=Posing)
    timed: bool = True
    rate: float = SAMPLE_RATE


@dataclass(frozen=True, eq=False)
class Wanted:
    """How to search, in the words of `plan`; None stands for what the scenario says.

    Attributes:
        known: (k, 4) arcs of a path that is there already, free and stable with the first margin.
        explain: Find out why there is no path where none is found.
    """

    name: str
    make: Factory
    seed: int | None = None
    time_limit: float | None = None
    first: bool = False
    iterations: int | None = None
    gap: float | None = None
    progress: Callable[[ProgressPoint], None] | None = None
    stop: Callable[[], bool] | None = None
    known: FloatArray | None = None
    explain: bool = True


@dataclass(frozen=True, eq=False)
class TimedPath:
    """A path as it is driven; what there is none of is None, and the reason says why."""

    path: PushPath | None = None
    trajectory: Trajectory | None = None
    reason: str = ""


def means_for(scenario: Scenario, stable_set: str | None = None, pose: Posing | None = None) -> Means:
    """Return what planning in a scenario rests on.

    Args:
        scenario: The problem.
        stable_set: Name of the set to plan in; None stands for the scenario's.
        pose: Makes the compiled problems, if not in the usual way.

    Raises:
        PushplanError: When there is no such set.
    """
    stable = planning_set(scenario, stable_set)
    return Means(stable, margins_to_try(scenario, stable), Room.of(scenario), pose or Posing())


def planned(scenario: Scenario, means: Means, wanted: Wanted, watch: Stopwatch, began: float) -> PlanResult:
    """Return the plan for a scenario.

    Args:
        scenario: The problem.
        means: What planning in it rests on.
        wanted: How to search.
        watch: Takes the time of the phases.
        began: `time.perf_counter` from which the time limit counts.

    Raises:
        PlanningError: When the start or the goal is too near to something, or they are the same.
        EmptyStableSetError: When no pusher twist keeps every contact.
    """
    check_ends(scenario, means.room)
    seed = scenario.planner.seed if wanted.seed is None else wanted.seed
    limit = scenario.planner.time_limit if wanted.time_limit is None else wanted.time_limit
    good_enough = scenario.planner.gap if wanted.gap is None else wanted.gap
    stall, gap = int(STALL * math.sqrt(limit)), max(good_enough, ROUNDING)
    budget = Budget(limit, stall, gap, wanted.first, wanted.iterations, stop=wanted.stop)
    search = Search(
        means.stable, wanted.make, budget, seed, began, good_enough, wanted.progress, means.pose, wanted.known
    )
    try:
        with watch("search"), no_collection():
            attempt = search.with_margins(scenario, means.margins)
    except OutOfTimeError as error:
        return _without_search(scenario, means, wanted, seed, time.perf_counter() - began, str(error))
    seconds = time.perf_counter() - began
    with no_collection():
        return _checked(attempt, search.points, means, wanted, scenario, seed, seconds, watch)


def _without_search(
    scenario: Scenario, means: Means, wanted: Wanted, seed: int, seconds: float, reason: str
) -> PlanResult:
    return PlanResult(
        solved=False,
        reason=reason,
        planner=wanted.name,
        stable_set=means.stable.name,
        seed=seed,
        path=None,
        trajectory=None,
        first_solution_s=None,
        planning_s=seconds,
        progress=(),
        extensions=0,
        min_margin=None,
        tree=Branches().ends,
        diagnosis=(Diagnosis("time", reason, False),),
        objective=scenario.planner.cost,
        margin_asked=means.margins[0],
        margin=means.margins[0],
    )


def _checked(
    attempt: Attempt,
    points: list[ProgressPoint],
    means: Means,
    wanted: Wanted,
    scenario: Scenario,
    seed: int,
    seconds: float,
    watch: Stopwatch,
) -> PlanResult:
    """Time, execute and check what a search found; find out why it found nothing."""
    session, posed, stable = attempt.session, attempt.scenario, means.stable
    segments = means.pose.controls(posed, stable).segments
    with watch("timing"):
        timed = _soonest(posed, attempt, means) if means.timed else TimedPath(attempt.path)
    path, trajectory = timed.path, timed.trajectory
    with watch("execution"):
        execution = None if trajectory is None else execute_trajectory(posed, stable.name, trajectory)
    with watch("checking"):
        reason, failure = timed.reason, None
        if path is None:
            reason, failure = _why_none(attempt, stable, wanted)
        elif trajectory is not None and execution is not None:
            reason = verdict(posed, stable, path, trajectory, execution, means.room)
        elif not means.timed:
            reason = path_verdict(posed, stable, path, means.room)
    solved = not reason
    return PlanResult(
        solved=solved,
        reason=reason,
        planner=wanted.name,
        stable_set=stable.name,
        seed=seed,
        path=path if solved else None,
        trajectory=trajectory if solved else None,
        first_solution_s=points[0].seconds if points else None,
        planning_s=seconds,
        progress=tuple(points),
        extensions=session.extensions,
        min_margin=None if path is None or not len(path.twists) else float(stable.margin(path.twists).min()),
        tree=session.branches.ends,
        lower_bound=session.lower_bound if path is None else partial(lower_bound, posed, segments, path.cost),
        diagnosis=failure.diagnosis if failure else (),
        approximate_path=failure.nearest if failure else None,
        approximate_error=failure.error if failure else None,
        objective=scenario.planner.cost,
        margin_asked=means.margins[0],
        margin=posed.required_margin,
        execution=execution if solved else None,
        robustness=partial(robustness_of, scenario.chain, trajectory) if solved and trajectory else None,
    )


def _why_none(attempt: Attempt, stable: StableSet, wanted: Wanted) -> tuple[str, Failure | None]:
    """Why a search found no path, and more about it unless it was interrupted."""
    if wanted.stop is not None and wanted.stop():
        return "the search was interrupted before it found a path", None
    if not wanted.explain:
        return "no path was found in time", None
    failure = explain_failure(attempt.session, attempt.scenario, stable, attempt.monitor)
    return failure.reason, failure


def _soonest(scenario: Scenario, attempt: Attempt, means: Means) -> TimedPath:
    """Return the best path with its trajectory, or why none can be driven.

    Where paths are ranked by time, the ones that were best by travel are driven as well, and the soonest counts:
    an objective knows a motion only roughly.
    """
    if attempt.path is None:
        return TimedPath()
    found: list[tuple[float, PushPath, Trajectory]] = []
    reason = ""
    for path in (attempt.path, *attempt.others):
        try:
            trajectory = make_trajectory(
                scenario, path, means.stable, means.rate, attempt.session.problem.scene
            )
        except TimingError as error:
            reason = reason or f"a path was found that cannot be driven: {error}"
        else:
            found.append((trajectory.duration, path, trajectory))
    if not found:
        return TimedPath(attempt.path, reason=reason)
    _, path, trajectory = min(found, key=lambda item: item[0])
    return TimedPath(path, trajectory)


def check_ends(scenario: Scenario, room: Room) -> None:
    """Refuse a start or a goal that is too near to something, and a goal that is the start.

    Raises:
        PlanningError: With what is wrong.
    """
    both = np.stack([scenario.start, scenario.goal.pose_chain])
    if max(pose_error(*both)) < EXACT:
        raise PlanningError("the chain is at the goal already: there is nothing to push")
    if (room.gaps(both, 2.0 * scenario.clearance) > scenario.clearance).all():
        return
    surroundings = Surroundings(scenario.workspace, scenario.obstacles, scenario.clearance)
    troubles: list[str] = []
    for what, pose in (("start", scenario.start), ("goal", scenario.goal.pose_chain)):
        troubles += placement_troubles(what, placed(scenario.chain.bodies, pose), surroundings)
    if troubles:
        raise PlanningError("; ".join(troubles))
