"""Plan a push: from a scenario to a timed path to the goal pose on which no contact slips."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal, TypedDict

from pushplan.errors import PlanningError, TimingError
from pushplan.geometry.se2 import pose_error
from pushplan.kernels import warm_up
from pushplan.names import AUTO, COSTS
from pushplan.path import PushPath
from pushplan.planners.attempts import Attempt, Search
from pushplan.planners.failure import explain_failure
from pushplan.planners.improve.budget import Budget
from pushplan.planners.infeasible.lower_bound import lower_bound
from pushplan.planners.ompl.factories import planner_named
from pushplan.planners.ompl.search import Factory
from pushplan.planners.problem.margins import margins_to_try
from pushplan.planners.trajectories import make_trajectory
from pushplan.planners.validation.verdict import EXACT, verdict
from pushplan.reading.arrangement.placement import Surroundings, bodies_at, placement_troubles
from pushplan.result import PlanResult, ProgressPoint
from pushplan.scenario import Scenario
from pushplan.sim.judging import execute_trajectory, planning_set
from pushplan.stable_sets.named import add_set
from pushplan.stable_sets.stable_set import StableSet
from pushplan.stopwatch import Stopwatch
from pushplan.tolerance.work_out import tolerance_of
from pushplan.trajectory import Trajectory

ROUNDING = 1e-9
"""Share of the lower bound by which an optimal path's cost may exceed it."""

STALL = 42_000
"""Iterations without a better path after which planning ends, for a time limit of 1 s; they grow with its root.

Planning is done in a fraction of the limit as a rule, and then the same seed gives the same plan on any machine.
"""


class PlanOptions(TypedDict, total=False):
    """The keywords of `plan` that whatever plans hands on; see there."""

    planner: str | Factory | None
    stable_set: str | type[StableSet] | None
    seed: int | None
    time_limit: float | None
    first: bool
    iterations: int | None
    cost: str | None
    margin: float | Literal["auto"] | None
    gap: float | None
    progress: Callable[[ProgressPoint], None] | None
    tell: Callable[[str], None] | None
    stop: Callable[[], bool] | None


def plan(
    scenario: Scenario,
    *,
    planner: str | Factory | None = None,
    stable_set: str | type[StableSet] | None = None,
    seed: int | None = None,
    time_limit: float | None = None,
    first: bool = False,
    iterations: int | None = None,
    cost: str | None = None,
    margin: float | Literal["auto"] | None = None,
    gap: float | None = None,
    progress: Callable[[ProgressPoint], None] | None = None,
    tell: Callable[[str], None] | None = None,
    watch: Stopwatch | None = None,
    stop: Callable[[], bool] | None = None,
) -> PlanResult:
    """Plan a push to the goal pose.

    Args:
        scenario: The problem; what the others leave open is taken from it.
        planner: Name of the planner, `module:attribute`, or what makes an `ompl.base.Planner` from a space
            information.
        stable_set: What limits the pusher's twists: the name of a stable set, `module:attribute`, or a subclass of
            `StableSet`.
        seed: Of the random numbers; the same seed gives the same plan unless the time limit cuts it short.
        time_limit: Wall-clock seconds of posing the problem and of planning, at most; executing and checking the
            plan, or finding out why there is none, come on top.
        first: Stop at the first path instead of shortening it.
        iterations: Extensions and shortcuts, at most; where they, not the time limit, end the search, the same seed
            gives the same plan on every machine.
        cost: What ranks paths, one of `names.COSTS`.
        margin: What the twists' margins have to exceed; `auto` as in `StabilitySettings`.
        gap: Share above the lower bound (`planners.lower_bound`) at which a path is good enough to stop.
        progress: Called with every improvement.
        tell: Called with sentences for the user about what takes long.
        stop: Asked many times a second whether the search has to end at once; the best path until then counts.
        watch: Takes the time of the phases `posing`, `search`, `timing`, `execution` and `checking`.

    Returns:
        The result; `solved` is False, with the reason, when no path was found in time.

    Raises:
        PlanningError: When the problem cannot be posed.
        EmptyStableSetError: When no pusher twist keeps every contact.
    """
    scenario = _settled(scenario, cost, margin)
    name, make = planner_named(planner or scenario.planner.name)
    watch = watch or Stopwatch()
    with watch("posing"):
        wanted = scenario.stability.set if stable_set is None else add_set(stable_set)
        warm_up(name, tell, wanted, scenario.interval is not None)
        began = time.perf_counter()
        stable = planning_set(scenario, wanted)
        _check_ends(scenario)
        margins = margins_to_try(scenario, stable)
    used_seed = scenario.planner.seed if seed is None else seed
    limit = scenario.planner.time_limit if time_limit is None else time_limit
    good_enough = scenario.planner.gap if gap is None else gap
    budget = Budget(
        limit, int(STALL * math.sqrt(limit)), max(good_enough, ROUNDING), first, iterations, stop=stop
    )
    with watch("search"):
        search = Search(stable, make, budget, used_seed, began, good_enough, progress)
        attempt = search.with_margins(scenario, margins)
    session, posed = attempt.session, attempt.scenario
    seconds = session.elapsed
    with watch("timing"):
        path, trajectory, reason = _soonest(posed, attempt, stable)
    with watch("execution"):
        execution = None if trajectory is None else execute_trajectory(posed, stable.name, trajectory)
    with watch("checking"):
        failure = None
        if attempt.path is None and stop is not None and stop():
            reason = "the search was interrupted before it found a path"
        elif attempt.path is None:
            failure = explain_failure(session, posed, stable, attempt.monitor)
            reason = failure.reason
        elif path is not None and trajectory is not None and execution is not None:
            reason = verdict(posed, stable, path, trajectory, execution)
        least = session.lower_bound if path is None else partial(lower_bound, posed, path.cost)
        solved = not reason
        bears = (
            partial(tolerance_of, scenario.chain, trajectory) if solved and trajectory is not None else None
        )
    return PlanResult(
        solved=solved,
        reason=reason,
        planner=name,
        stable_set=stable.name,
        seed=used_seed,
        path=path if solved else None,
        trajectory=trajectory if solved else None,
        first_solution_s=session.progress[0].seconds if session.progress else None,
        planning_s=seconds,
        progress=tuple(session.progress),
        extensions=session.extensions,
        min_margin=None if path is None or not len(path.twists) else float(stable.margin(path.twists).min()),
        tree=session.branches.ends,
        lower_bound=least,
        diagnosis=failure.diagnosis if failure else (),
        approximate_path=failure.nearest if failure else None,
        approximate_error=failure.error if failure else None,
        objective=scenario.planner.cost,
        margin_asked=margins[0],
        margin=posed.required_margin,
        execution=execution if solved else None,
        tolerance=bears,
    )


def _soonest(
    scenario: Scenario, attempt: Attempt, stable: StableSet
) -> tuple[PushPath | None, Trajectory | None, str]:
    """Return the best path with its trajectory, or why none can be driven.

    Where paths are ranked by time, the ones that were best by travel are driven as well, and the soonest counts:
    prices know a motion only roughly.
    """
    if attempt.path is None:
        return None, None, ""
    found: list[tuple[float, PushPath, Trajectory]] = []
    reason = ""
    for path in (attempt.path, *attempt.others):
        try:
            trajectory = make_trajectory(scenario, path, stable, scene=attempt.session.problem.scene)
        except TimingError as error:
            reason = reason or f"a path was found that cannot be driven: {error}"
        else:
            found.append((trajectory.duration, path, trajectory))
    if not found:
        return attempt.path, None, reason
    _, path, trajectory = min(found, key=lambda item: item[0])
    return path, trajectory, ""


def _settled(scenario: Scenario, cost: str | None, margin: float | Literal["auto"] | None) -> Scenario:
    """Return the scenario with another cost and margin.

    Raises:
        PlanningError: When there is no such cost or margin.
    """
    if margin is not None:
        if margin != AUTO and not 0.0 <= margin < 1.0:
            raise PlanningError(f"the margin is {margin}; it must be {AUTO!r} or a number from 0 to 1")
        scenario = replace(scenario, stability=replace(scenario.stability, margin=margin))
    if scenario.stability.margin == 0.0 and scenario.chain.pusher.limits.contact == "dynamic":
        raise PlanningError(
            "a margin of 0 leaves the contacts nothing to spare for inertia; allowed: a margin above 0, or "
            "pusher.limits.contact: quasi-static"
        )
    if cost is None:
        return scenario
    if cost not in COSTS:
        raise PlanningError(f"no cost is called {cost!r}; there are {', '.join(COSTS)}")
    return replace(scenario, planner=replace(scenario.planner, cost=cost))


def _check_ends(scenario: Scenario) -> None:
    """Refuse a start or a goal that is too near to something, and a goal that is the start."""
    surroundings = Surroundings(scenario.workspace, scenario.obstacles, scenario.clearance)
    troubles: list[str] = []
    for what, pose in (("start", scenario.start), ("goal", scenario.goal.pose_chain)):
        troubles += placement_troubles(what, bodies_at(scenario.chain, pose), surroundings)
    if troubles:
        raise PlanningError("; ".join(troubles))
    if max(pose_error(scenario.start, scenario.goal.pose_chain)) < EXACT:
        raise PlanningError("the chain is at the goal already: there is nothing to push")
