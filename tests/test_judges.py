"""Judges of results can say no: good plans and executions spoilt in one way are refused, with the reason."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pushplan.planners.validation.verdict import flaw as path_flaw
from pushplan.planners.validation.verdict import verdict

import pushplan
from pushplan.bench.validation import validation_error, with_kept_margin
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan
from pushplan.plans.run import Execution, StabilityLoss
from pushplan.scenario.model import PolygonObstacle, Scenario, Workspace
from pushplan.sets.named import stable_set


@cache
def good() -> tuple[Scenario, Plan, Execution]:
    run = pushplan.run(pushplan.load_scenario("free-space"), time_limit=60.0, first=True)
    assert run.plan.solved
    assert run.execution is not None
    assert run.plan.margin is not None
    return run.scenario.with_margin(run.plan.margin), run.plan, run.execution


def obstacle_on_the_way() -> PolygonObstacle:
    """A small square where the first object is half-way."""
    scenario, _, execution = good()
    x, y, _ = execution.poses[len(execution.poses) // 2]
    away = scenario.chain.objects[0].pose_chain[0]
    corners = [[-0.01, -0.01], [0.01, -0.01], [0.01, 0.01], [-0.01, 0.01]]
    return PolygonObstacle(np.array([x, y]) + away * np.array([1.0, 0.0]) + np.array(corners))


def test_a_good_run_has_no_flaw() -> None:
    scenario, result, execution = good()
    assert validation_error(scenario, execution) == ""
    assert result.path is not None
    assert result.trajectory is not None
    assert verdict(scenario, stable_set(scenario.chain), result.path, result.trajectory, execution) == ""


def test_an_execution_that_lost_a_contact_solves_nothing() -> None:
    scenario, result, execution = good()
    lost = replace(execution, loss=StabilityLoss(1.5, 0, -0.25, (0.0, 0.0, 0.0)))
    assert validation_error(scenario, lost) == "contact 0 is lost after 1.500 s with a margin of -0.25"
    assert result.path is not None
    assert result.trajectory is not None
    said = verdict(scenario, stable_set(scenario.chain), result.path, result.trajectory, lost)
    name = scenario.chain.contact_name(0)
    assert said == (
        f"the plan does not hold when it is executed: contact {name} is lost after 1.50 s, with a margin of -0.25"
    )


def test_where_the_scenario_says_auto_the_margin_of_the_plan_is_what_counts() -> None:
    scenario, result, _ = good()
    assert result.margin is not None
    auto = replace(scenario, stability=replace(scenario.stability, margin="auto"))
    assert with_kept_margin(auto, result) == scenario
    stated = scenario.with_margin(0.5)
    assert with_kept_margin(stated, result) == stated


def test_a_margin_at_what_the_scenario_asks_for_is_too_small() -> None:
    scenario, result, execution = good()
    smallest = float(execution.margins.min())
    strict = replace(scenario, stability=replace(scenario.stability, margin=smallest))
    assert (
        validation_error(strict, execution)
        == f"the smallest margin is {smallest:.3g}; it must be above {smallest:g}"
    )
    assert result.path is not None
    stable = stable_set(scenario.chain)
    smallest = float(stable.margin(result.path.twists).min())
    strict = replace(scenario, stability=replace(scenario.stability, margin=smallest))
    said = path_flaw(strict, stable, result.path, execution.poses)
    assert said == f"the path's smallest margin is {smallest:.3g}; it must be above {smallest:g}"


@pytest.mark.parametrize("error", [(0.5, 0.0), (0.0, 0.5)])
def test_a_goal_missed_in_place_or_in_angle_is_missed(error: tuple[float, float]) -> None:
    scenario, _, execution = good()
    said = validation_error(scenario, replace(execution, goal_error=error))
    assert said == f"the goal is missed by {error[0]:.2g} m and {error[1]:.2g} rad"


def test_a_body_that_meets_an_obstacle_on_the_way_is_named() -> None:
    scenario, result, execution = good()
    blocked = replace(scenario, obstacles=(obstacle_on_the_way(),))
    assert " meets obstacle 0 with the chain frame at " in validation_error(blocked, execution)
    assert result.path is not None
    assert "the path is not free: " in path_flaw(
        blocked, stable_set(scenario.chain), result.path, execution.poses
    )


def test_a_body_that_leaves_the_workspace_is_named() -> None:
    scenario, _, execution = good()
    x = float(execution.poses[:, 0].max()) - 0.05
    walled = replace(scenario, obstacles=(), workspace=Workspace(-9.0, x, -9.0, 9.0))
    assert " meets a wall of the workspace with the chain frame at " in validation_error(walled, execution)


def test_a_path_that_ends_elsewhere_is_refused() -> None:
    scenario, result, execution = good()
    path = result.path
    assert path is not None
    short = PushPath(path.start, path.twists, path.lengths * [*[1.0] * (len(path.lengths) - 1), 0.5])
    assert result.trajectory is not None
    said = verdict(scenario, stable_set(scenario.chain), short, result.trajectory, execution)
    assert said.startswith("the path misses the goal by ")
