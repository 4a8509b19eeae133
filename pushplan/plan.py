"""Plan a push: from a scenario to a timed path to the goal pose on which no contact slips."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Literal, TypedDict

from pushplan.errors import PlanningError
from pushplan.kernels import warm_up
from pushplan.planned import Wanted, means_for, planned
from pushplan.planners.ompl.factories import planner_named
from pushplan.planners.ompl.search import Factory
from pushplan.plans.result import PlanResult, ProgressPoint
from pushplan.scenario.model import Scenario
from pushplan.sets.named import add_set
from pushplan.sets.stable_set import StableSet
from pushplan.several.plan import Asked, plan_pushes
from pushplan.several.prepared import Prepared
from pushplan.several.warm import warm_up_several
from pushplan.util.collection import no_collection
from pushplan.util.names import AUTO, COSTS, DEFAULT_PLANNER, RANKED_BY
from pushplan.util.stopwatch import Stopwatch


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
    scenario = settled(scenario, cost, margin)
    name, make = planner_named(planner or scenario.planner.name)
    watch = watch or Stopwatch()
    if scenario.pushes is not None:
        require_own_search(scenario, name)
        asked = Asked(seed, time_limit, first, iterations, gap, progress, stop)
        set_name = None if stable_set is None else add_set(stable_set)
        return _several(scenario, asked, set_name, tell, watch)
    with watch("posing"):
        set_name = scenario.stability.set if stable_set is None else add_set(stable_set)
        warm_up(name, tell, set_name, scenario.interval is not None)
        began = time.perf_counter()
        with no_collection():
            means = means_for(scenario, set_name)
    wanted = Wanted(name, make, seed, time_limit, first, iterations, gap, progress, stop)
    return planned(scenario, means, wanted, watch, began)


def _several(
    scenario: Scenario,
    asked: Asked,
    set_name: str | None,
    tell: Callable[[str], None] | None,
    watch: Stopwatch,
) -> PlanResult:
    """Plan several pushes."""
    with watch("posing"):
        warm_up_several(tell, set_name or scenario.stability.set, scenario.interval is not None)
        began = time.perf_counter()
        with no_collection():
            prepared = Prepared.of(scenario, set_name)
    return plan_pushes(prepared, asked, watch, began)


def require_own_search(scenario: Scenario, planner: str) -> None:
    """Refuse what the search for several pushes cannot take into account.

    Raises:
        PlanningError: When another planner or another cost is asked for.
    """
    if planner != DEFAULT_PLANNER:
        raise PlanningError(
            f"several pushes (robot.start) have a search of their own, {DEFAULT_PLANNER}; the planner {planner!r} is "
            "for a single push"
        )
    if scenario.planner.cost != RANKED_BY:
        raise PlanningError(
            f"several pushes (robot.start) are ranked by {RANKED_BY}, with the weights in 'pushes'; "
            f"the cost {scenario.planner.cost!r} is for a single push"
        )


def settled(scenario: Scenario, cost: str | None, margin: float | Literal["auto"] | None) -> Scenario:
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
