"""Push problems for OMPL: pose one, solve it by any of OMPL's planners, get the path back.

The problem is the one that the planner `auto` solves with two of OMPL's RRTs, from the start and back from the goal.

The states are poses of the chain frame (`SE2StateSpace`), the controls three coordinates in [0, 1] that chart the
stable set: which segment of it, where on that, and how long the arc is, in units of the longest one. Propagation is
exact; an arc that touches something ends out of bounds. The goal is the region from which a free steering path
of stable arcs leads exactly to the goal pose.
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
"""Iterations after which a search would end by itself: planners stop when OMPL's condition tells them to."""


def pose(scenario: Scenario, stable: str | type[StableSet] | StableSet | None = None) -> tuple[Any, Any]:
    """Return OMPL's space information (`ompl.control.SpaceInformation`) and problem definition of a scenario.

    Args:
        scenario: The problem; where its margin is `auto`, the first of those that `plan` tries counts.
        stable: What limits the pusher's twists: the name of a stable set, `module:attribute`, a subclass of
            `StableSet` or an instance; None stands for that of the scenario.

    Raises:
        PushplanError: When there is no such set.
        EmptyStableSetError: When no pusher twist keeps every contact.
    """
    if not isinstance(stable, StableSet):
        stable = planning_set(scenario, None if stable is None else add_set(stable))
    scenario = scenario.with_margin(margins_to_try(scenario, stable)[0])
    session = Session(
        build_problem(scenario, stable), scenario.start, StopRule(math.inf, stall=NEVER), scenario.planner.seed
    )
    return pose_problem(session, sampling_box(scenario), scenario.chain.reach)


def push_path(definition: Any, scenario: Scenario | None = None) -> PushPath:
    """Return the path to the goal that an exact solution stands for, the last word included.

    Args:
        definition: The solved problem definition.
        scenario: What it was posed from, to be sure.

    Raises:
        PlanningError: When there is no exact solution, or what a planner left as one is not free, or the problem is
            that of another scenario.
    """
    start = information_of(definition).session.start
    if scenario is not None and (scenario.start != start).any():
        raise PlanningError("the problem definition was posed from another scenario")
    return path_of(definition)
