"""Plan a push: from a scenario to a timed path to the goal pose on which no contact slips."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from pushplan.errors import PlanningError, TimingError
from pushplan.kernels import warm_up
from pushplan.names import COSTS
from pushplan.path import PushPath
from pushplan.planners.budget import Budget
from pushplan.planners.diagnosis import Doubts
from pushplan.planners.failure import explain_failure
from pushplan.planners.lower_bound import lower_bound
from pushplan.planners.ompl.factories import planner_named
from pushplan.planners.ompl.search import Factory, search
from pushplan.planners.ompl.solution import push_path
from pushplan.planners.problem import body_reach, build_problem, sampling_box
from pushplan.planners.session import Session
from pushplan.planners.trajectories import make_trajectory
from pushplan.planners.verdict import EXACT, verdict
from pushplan.reading.placement import Surroundings, bodies_at, placement_troubles
from pushplan.result import PlanResult, ProgressPoint
from pushplan.scenario import Scenario
from pushplan.sim.kinematic import pose_error
from pushplan.stable_sets.named import add_set
from pushplan.stable_sets.stable_set import StableSet
from pushplan.stopwatch import Stopwatch
from pushplan.trajectory import Trajectory

ROUNDING = 1e-9
"""Share of the lower bound by which an optimal path's cost may exceed it."""

STALL = 42_000
"""Iterations without a better path after which planning ends, for a time limit of 1 s; they grow with its root.

Planning is done in a fraction of the limit as a rule, and then the same seed gives the same plan on any machine.
"""


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
    gap: float | None = None,
    progress: Callable[[ProgressPoint], None] | None = None,
    tell: Callable[[str], None] | None = None,
    watch: Stopwatch | None = None,
) -> PlanResult:
    """Plan a push to the goal pose.

    Args:
        scenario: The problem; what the others leave open is taken from it.
        planner: Name of the planner, `module:attribute`, or what makes an `ompl.base.Planner` from a space
            information.
        stable_set: What limits the pusher's twists: the name of a stable set, `module:attribute`, or a subclass of
            `StableSet`.
        seed: Of the random numbers; the same seed gives the same plan unless the time limit cuts it short.
        time_limit: Wall-clock seconds of planning, at most.
        first: Stop at the first path instead of shortening it.
        iterations: Extensions and shortcuts, at most; where they, not the time limit, end the search, the same seed
            gives the same plan on every machine.
        cost: What ranks paths, one of `names.COSTS`.
        gap: Share above the lower bound (`planners.lower_bound`) at which a path is good enough to stop.
        progress: Called with every improvement.
        tell: Called with sentences for the user about what takes long.
        watch: Takes the time of the phases `posing`, `search`, `timing` and `checking`.

    Returns:
        The result; `solved` is False, with the reason, when no path was found in time.

    Raises:
        PlanningError: When the problem cannot be posed.
        EmptyStableSetError: When no pusher twist keeps every contact.
    """
    scenario = _ranked_by(scenario, cost)
    name, make = planner_named(planner or scenario.planner.name)
    watch = watch or Stopwatch()
    with watch("posing"):
        warm_up(name, tell)
        stable = scenario.stable_set(None if stable_set is None else add_set(stable_set))
        problem = build_problem(scenario, stable)
        _check_ends(scenario)
    used_seed = scenario.planner.seed if seed is None else seed
    limit = scenario.planner.time_limit if time_limit is None else time_limit
    good_enough = scenario.planner.gap if gap is None else gap
    budget = Budget(limit, int(STALL * math.sqrt(limit)), max(good_enough, ROUNDING), first, iterations)
    doubts = Doubts(scenario, stable, problem)
    session = Session(problem, scenario.start, budget, used_seed, progress, doubts.settled)
    with watch("search"):
        if good_enough > 0.0:
            session.raise_lower_bound(lower_bound(scenario))
        definition = search(session, make, sampling_box(scenario), body_reach(scenario))
    seconds = session.elapsed
    path = push_path(definition) if definition.hasExactSolution() else None
    with watch("timing"):
        trajectory, untimed = _timed(scenario, path, stable)
    with watch("checking"):
        failure = None if path is not None else explain_failure(session, scenario, stable, doubts)
        if path is not None and trajectory is not None:
            reason = verdict(scenario, stable, path, trajectory)
        else:
            reason = failure.reason if failure is not None else untimed
        least = session.lower_bound if path is None else lower_bound(scenario, path.cost)
    solved = not reason
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
    )


def _timed(scenario: Scenario, path: PushPath | None, stable: StableSet) -> tuple[Trajectory | None, str]:
    """Return the trajectory along a path, or why the path cannot be driven."""
    if path is None:
        return None, ""
    try:
        return make_trajectory(scenario, path, stable), ""
    except TimingError as error:
        return None, f"a path was found that cannot be driven: {error}"


def _ranked_by(scenario: Scenario, cost: str | None) -> Scenario:
    """Return the scenario with another cost."""
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
