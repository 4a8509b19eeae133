"""Judges of results can say no: good plans and executions spoilt in one way are refused, with the reason."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pushplan.bench.validation import validation_error
from pushplan.planners.planner import plan
from pushplan.planners.validator import Validator
from pushplan.plans.path import PushPath
from pushplan.plans.plan import Plan, Segment
from pushplan.plans.run import Execution, StabilityLoss
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import PolygonObstacle, Scenario, Workspace


@cache
def good() -> tuple[Plan, Execution]:
    found = plan(load_scenario("free-space"), time_limit=60.0, first=True)
    assert found.solved
    assert found.execution is not None
    return found, found.execution


def path() -> PushPath:
    found = good()[0].path
    assert found is not None
    return found


def flaw(scenario: Scenario, segment: Segment) -> str:
    return Validator(scenario).flaw((segment,), good()[1])


def obstacle_on_the_way() -> PolygonObstacle:
    """A small square where the first object is half-way."""
    _, execution = good()
    corners = np.array([[-0.01, -0.01], [0.01, -0.01], [0.01, 0.01], [-0.01, 0.01]])
    return PolygonObstacle(execution.objects[len(execution.t) // 2, 0, :2] + corners)


def test_an_execution_that_lost_a_contact_solves_nothing() -> None:
    found, execution = good()
    loss = StabilityLoss(1.5, 0, "box", "plate-box", -0.25, (0.0, 0.0, 0.0))
    assert validation_error(found, replace(execution, loss=loss)) == (
        "the plan does not hold when it is executed: contact plate-box is lost after 1.50 s, with a margin of -0.25"
    )


def test_a_margin_at_what_is_asked_for_is_too_small() -> None:
    found, execution = good()
    smallest = execution.min_margin
    assert smallest is not None
    said = validation_error(replace(found, margin=smallest), execution)
    assert said == f"the smallest margin is {smallest:.3g}; it must be above {smallest:g}"
    (push,) = found.segments
    smallest = float(found.scenario.stable_set().margin(path().twists).min())
    said = flaw(found.scenario, replace(push, margin=smallest))
    assert said.endswith(f"the path's smallest margin is {smallest:.3g}; it must be above {smallest:g}")


@pytest.mark.parametrize("error", [(0.5, 0.0), (0.0, 0.5)])
def test_a_goal_missed_in_place_or_in_angle_is_missed(error: tuple[float, float]) -> None:
    found, execution = good()
    said = validation_error(found, replace(execution, goal_error=error))
    assert said == f"the goal is missed by {error[0]:.2g} m and {error[1]:.2g} rad"


def test_a_body_that_meets_an_obstacle_on_the_way_is_named() -> None:
    found, _ = good()
    blocked = replace(found.scenario, obstacles=(obstacle_on_the_way(),))
    said = flaw(blocked, found.segments[0])
    assert "the path is not free: " in said
    assert " meets obstacles[0] with the chain frame at " in said


def test_a_body_that_leaves_the_workspace_is_named() -> None:
    found, execution = good()
    x = float(execution.objects[..., 0].max()) - 0.05
    walled = replace(found.scenario, obstacles=(), workspace=Workspace(-9.0, x, -9.0, 9.0))
    assert " a wall of the workspace with the chain frame at " in flaw(walled, found.segments[0])


def test_a_path_that_ends_elsewhere_is_refused() -> None:
    found, _ = good()
    (push,) = found.segments
    assert push.load is not None
    whole = path()
    short = PushPath(whole.start, whole.twists, whole.lengths * [*[1.0] * (len(whole.lengths) - 1), 0.5])
    elsewhere = Segment.push(push.load, short, push.before, push.margin)
    assert flaw(found.scenario, elsewhere).startswith("the path misses the goal by ")
    assert "moves what it does not push" in flaw(found.scenario, replace(elsewhere, after=push.after))
