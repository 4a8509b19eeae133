"""Push problems for OMPL: pose a problem, solve it with any OMPL planner, and get the path back.

The planner `auto` solves the same problem with two of OMPL's RRTs, one from the start and one back from the goal.

The states are poses of the chain frame (`SE2StateSpace`). The controls are three coordinates in [0, 1]: a segment of
the stable set, a position on this segment, and the arc length divided by the longest allowed length. Propagation is
exact; an arc in collision ends out of bounds. The goal is the region from which a collision-free steering path of
stable arcs leads exactly to the goal pose.
"""

from __future__ import annotations

import math
from typing import Any

from pushplan.errors import PlanningError
from pushplan.planners.controls import margins_to_try
from pushplan.planners.problem import build_problem, sampling_box
from pushplan.planners.search.form import information_of, pose_problem
from pushplan.planners.search.form import push_path as path_of
from pushplan.planners.search.session import Session, StopRule
from pushplan.plans.judge import planning_set
from pushplan.plans.path import PushPath
from pushplan.scenario.model import Scenario
from pushplan.sets.named import add_set
from pushplan.sets.stable_set import StableSet

__all__ = ["pose", "push_path"]

NEVER = 10**15
"""Iterations without improvement that end a search: never, because OMPL's stopping condition ends it."""


def pose(scenario: Scenario, stable: str | type[StableSet] | StableSet | None = None) -> tuple[Any, Any]:
    """Return OMPL's space information (`ompl.control.SpaceInformation`) and problem definition of a scenario.

    Args:
        scenario: The problem. For the margin `auto`, the first margin that `plan` tries is used.
        stable: Stable set that limits the pusher's twists: a name, `module:attribute`, a subclass of `StableSet` or
            an instance; None for that of the scenario.

    Raises:
        PushplanError: If there is no stable set of this name.
        EmptyStableSetError: If no pusher twist keeps every contact.
    """
    if not isinstance(stable, StableSet):
        stable = planning_set(scenario, None if stable is None else add_set(stable))
    scenario = scenario.with_margin(margins_to_try(scenario, stable)[0])
    session = Session(
        build_problem(scenario, stable), scenario.start, StopRule(math.inf, stall=NEVER), scenario.planner.seed
    )
    return pose_problem(session, sampling_box(scenario), scenario.chain.reach)


def push_path(definition: Any, scenario: Scenario | None = None) -> PushPath:
    """Return the path of an exact solution, including the final steering path to the goal.

    Args:
        definition: The solved problem definition.
        scenario: Scenario that the problem was posed from, as a check; None for no check.

    Raises:
        PlanningError: If there is no exact solution, if the solution is in collision, or if the problem was posed
            from another scenario.
    """
    start = information_of(definition).session.start
    if scenario is not None and (scenario.start != start).any():
        raise PlanningError("the problem definition was posed from another scenario")
    return path_of(definition)
