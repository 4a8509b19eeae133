"""What is no number or cannot be ends in an error of pushplan's own that says so.

Arguments of a wrong type are the point here: that is what mypy is told to ignore.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import pushplan
from pushplan.errors import PushplanError
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory


@cache
def plan() -> pushplan.Plan:
    return pushplan.plan(pushplan.load_scenario("two-crates"), first=True, time_limit=60.0)


def path() -> PushPath:
    found = plan().path
    assert found is not None
    return found


def trajectory() -> Trajectory:
    found = plan().trajectory
    assert found is not None
    return found


def world() -> pushplan.World:
    return pushplan.World.from_scenario(plan().scenario)


CALLS: dict[str, tuple[Callable[[], Any], str]] = {
    "path": (lambda: path().poses_at([math.nan]), "costs hold NaN"),
    "trajectory": (lambda: trajectory().poses_at([math.nan]), "times hold NaN"),
    "huge": (lambda: trajectory().poses_at([10**400]), "times cannot be read"),
    "margin": (lambda: plan().scenario.stable_set().margin("ab"), "twists cannot be read as numbers"),
    "window": (lambda: plan().scenario.stable_set().cor_region(1, (1.0, 2.0)), "window is"),  # type: ignore[arg-type]
    "start": (lambda: pushplan.Planner(plan().scenario).plan(start="ab"), "start cannot be read"),
    "obstacle": (
        lambda: pushplan.Planner(plan().scenario).with_obstacles([1.0]),  # type: ignore[list-item]
        r"obstacle 0 is 1\.0; allowed: PolygonObstacle and CircleObstacle",
    ),
    "samples": (lambda: pushplan.trial(plan(), 0.5), "the number of samples is 0.5"),  # type: ignore[arg-type]
    "seed": (lambda: pushplan.trial(plan(), 2, seed=-1), "the seed is -1"),
    "iterations": (
        lambda: pushplan.plan(plan().scenario, iterations=10**400),
        "allowed: a whole number from 1",
    ),
    "simulator": (lambda: pushplan.trial(plan(), 2, simulator=7), "7 is no simulator"),  # type: ignore[arg-type]
    "follower": (lambda: pushplan.Follower(7), "nothing to follow in 7"),  # type: ignore[arg-type]
    "move": (lambda: pushplan.SlipSimulator(world()).move({}, 1.0), "twist cannot be read"),  # type: ignore[arg-type]
    "poses": (lambda: world().with_object_poses(np.array([["a"] * 3])), "cannot be read as numbers"),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_silly_call_is_told_so(name: str) -> None:
    call, said = CALLS[name]
    with pytest.raises(PushplanError, match=said):
        call()
