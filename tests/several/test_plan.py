"""Plans of several pushes: whole, timed, executed, judged; and refused with the reason."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from several.conftest import DRIVES, Problem

import pushplan
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.plans.result import PlanResult
from pushplan.plans.segment import Segment, trajectory_of
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario
from pushplan.several.modes import find_modes
from pushplan.several.plan import objective_cost
from pushplan.several.verdict import verdict_on

ROUND = {"goal": {"pose": [0.5, 1.0, 0.0], "of": "b0"}}
"""Back towards the robot: it has to drive around the box."""


@pytest.fixture(scope="module", params=DRIVES)
def planned(problem: Problem, request: pytest.FixtureRequest) -> tuple[Scenario, PlanResult]:
    scenario = problem(request.param, **ROUND)
    return scenario, pushplan.plan(scenario, iterations=3, time_limit=60.0)


def test_a_goal_behind_the_box_is_reached_from_its_other_side(planned: tuple[Scenario, PlanResult]) -> None:
    scenario, plan = planned
    assert plan.solved, plan.reason
    assert plan.execution is not None
    assert max(plan.execution.goal_error) < 1e-9
    assert plan.margin is not None
    assert plan.min_margin is not None
    assert plan.min_margin > plan.margin
    kinds = [segment.kind for segment in plan.segments]
    assert kinds == ["transit", "approach", "push", "retreat"] * (len(kinds) // 4)
    assert plan.objective_cost == pytest.approx(plan.progress[-1].cost, abs=1e-9)
    assert plan.lower_bound is not None
    assert plan.objective_cost is not None
    assert plan.lower_bound <= plan.objective_cost
    assert scenario.pushes is not None
    assert plan.segments[-1].face == "front"


def test_segments_join_and_rest_where_they_do(planned: tuple[Scenario, PlanResult]) -> None:
    scenario, plan = planned
    assert plan.trajectory is not None
    robot, load = scenario.robot_start, scenario.start
    for segment in plan.segments:
        path = segment.robot_path
        assert max(se2.pose_error(path.start, robot)) < 1e-9
        assert max(se2.pose_error(segment.load_before, load)) < 1e-9
        speeds = plan.trajectory.twists_at(np.array([segment.t0, segment.t1]))
        np.testing.assert_allclose(speeds, 0.0, atol=1e-9)
        assert max(se2.pose_error(trajectory_of(segment, plan.trajectory).poses[-1], segment.path.end)) < 1e-9
        robot, load = path.end, segment.load_after


def test_the_load_rests_unless_it_is_pushed(planned: tuple[Scenario, PlanResult]) -> None:
    _, plan = planned
    assert plan.execution is not None
    loads, t = plan.execution.load_poses, plan.execution.t
    for segment in plan.segments:
        inside = loads[(t > segment.t0 + 1e-9) & (t < segment.t1 - 1e-9)]
        if not segment.pushes:
            np.testing.assert_allclose(np.ptp(inside, axis=0), 0.0, atol=0.0)
            np.testing.assert_allclose(inside[0], segment.load_before, atol=1e-9)
    np.testing.assert_allclose(loads[-1], plan.segments[-1].load_after, atol=1e-9)


def moved(segment: Segment, by: float) -> Segment:
    x, y, theta = segment.path.start
    path = replace(segment.path, start=np.array([x, y + by, theta]))
    return replace(segment, path=path)


BROKEN: dict[str, tuple[int, Any, str]] = {
    "a transit that begins elsewhere": (0, lambda s: moved(s, 1e-3), "does not begin where"),
    "an approach that moves the load": (
        1, lambda s: replace(s, load_after=s.load_after + np.array([1e-3, 0.0, 0.0])), "moves the load"
    ),
    "a push of another face": (2, lambda s: replace(s, face="rear"), "does not follow an approach"),
    "a retreat from another face": (3, lambda s: replace(s, face="left"), "not followed by a retreat"),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_a_plan_that_was_tampered_with_is_refused(planned: tuple[Scenario, PlanResult], what: str) -> None:
    scenario, plan = planned
    k, change, words = BROKEN[what]
    segments = tuple(change(s) if i == k else s for i, s in enumerate(plan.segments))
    modes = find_modes(scenario)
    assert plan.trajectory is not None
    assert plan.execution is not None
    assert verdict_on(scenario, plan.segments, plan.trajectory, plan.execution, modes) == ""
    assert words in verdict_on(scenario, segments, plan.trajectory, plan.execution, modes)


def test_a_way_through_something_new_is_refused(planned: tuple[Scenario, PlanResult]) -> None:
    scenario, plan = planned
    assert plan.trajectory is not None
    assert plan.execution is not None
    way = plan.segments[0].robot_path
    x, y, _ = way.poses_at(np.array([0.5 * way.cost]))[0]
    blocked = replace(scenario, obstacles=(pushplan.CircleObstacle(np.array([x, y]), 0.05),))
    assert "is not free" in verdict_on(
        blocked, plan.segments, plan.trajectory, plan.execution, find_modes(blocked)
    )


def test_costs_are_what_the_weights_make_of_the_segments(problem: Problem) -> None:
    scenario = problem("omnidirectional", pushes={"transit_weight": 2.0, "switch_cost": 5.0}, **ROUND)
    plan = pushplan.plan(scenario, first=True, time_limit=60.0)
    alone = sum(segment.path.cost for segment in plan.segments if not segment.pushes)
    pushes = sum(segment.pushes for segment in plan.segments)
    assert plan.way_pushed is not None
    expected = plan.way_pushed + 2.0 * alone + 5.0 * (pushes - 1)
    assert objective_cost(scenario, plan.segments) == pytest.approx(expected)


def test_a_row_of_boxes_is_taken_from_its_other_end(problem: Problem) -> None:
    scenario = problem("omnidirectional", boxes=3, goal={"pose": [0.7, 1.0, 0.0]})
    plan = pushplan.plan(scenario, first=True, time_limit=60.0)
    assert plan.solved, plan.reason
    assert [segment.face for segment in plan.segments if segment.pushes] == ["b2 front"]
    assert plan.execution is not None
    assert plan.execution.margins.shape[1] == 3


def test_a_square_box_may_end_in_any_of_its_orientations(problem: Problem) -> None:
    goal = {"pose": [2.0, 1.0, 1.5707963267948966], "of": "b0", "symmetry": 4}
    plan = pushplan.plan(problem("car", goal=goal), first=True, time_limit=60.0)
    assert plan.solved, plan.reason
    assert plan.way_pushed == pytest.approx(
        0.925
    )  # to where its frame, 75 mm ahead of the chain's, is at x = 2 m
    assert plan.segments[-1].load_after[2] == pytest.approx(0.0, abs=1e-9)


def test_a_robot_that_touches_the_box_backs_off_first(problem: Problem) -> None:
    scenario = problem("car", robot={"start": [1.0, 1.0, 0.0]}, **ROUND)
    plan = pushplan.plan(scenario, first=True, time_limit=60.0)
    assert plan.solved, plan.reason
    assert [segment.kind for segment in plan.segments[:2]] == ["retreat", "transit"]


def test_a_box_in_a_corner_that_no_push_gets_out_of_is_said_so(problem: Problem) -> None:
    corner = {"start": [0.01, 0.085, 0.0], "workspace": {"x": [0.0, 3.0], "y": [0.0, 3.0]}}
    changes = {"robot": {"start": [1.5, 1.5, 0.0]}, "goal": {"pose": [1.0, 1.0, 0.0]}}
    plan = pushplan.plan(problem("car", **corner, **changes), time_limit=60.0)
    assert not plan.solved
    assert plan.planning_s < 30.0
    assert plan.diagnosis[0].cause == "boxed in"
    assert plan.diagnosis[0].proven
    assert "at the start, the robot has no room" in plan.reason


def test_a_goal_that_no_robot_can_back_off_from_is_said_so(problem: Problem) -> None:
    walls = [{"box": [0.5, 0.02], "pose": [2.0, 1.0 + y, 0.0]} for y in (-0.1, 0.1)]
    walls += [{"box": [0.02, 0.2], "pose": [2.0 + x, 1.0, 0.0]} for x in (-0.14, 0.14)]
    scenario = problem("car", obstacles=walls, goal={"pose": [2.0, 1.0, 0.0], "of": "b0"})
    plan = pushplan.plan(scenario, time_limit=60.0)
    assert not plan.solved
    assert plan.diagnosis[0].proven
    assert "at the goal, the robot has no room" in plan.reason


@pytest.mark.parametrize("option", [{"planner": "rrt"}, {"cost": "time"}])
def test_what_is_for_a_single_push_is_refused(problem: Problem, option: Any) -> None:
    with pytest.raises(PlanningError, match=r"several pushes \(robot.start\)"):
        pushplan.plan(problem("car"), **option)


def test_a_box_that_is_at_its_goal_needs_no_push(problem: Problem) -> None:
    with pytest.raises(PlanningError, match="at a goal already"):
        pushplan.plan(problem("car", goal={"pose": [1.0, 1.0, 0.0], "of": None}))


def test_queries_answer_as_the_whole_call_does_and_again_among_other_things(problem: Problem) -> None:
    scenario = problem("car", **ROUND)
    assert scenario.pushes is not None
    questions = pushplan.PushQueries(scenario)
    goals = [goal.pose_chain for goal in scenario.pushes.goals]
    once = pushplan.plan(scenario, first=True, time_limit=60.0)
    answers = [questions.plan(scenario.pushes.robot_start, scenario.start, goals) for _ in range(2)]
    assert [answer.objective_cost for answer in answers] == [once.objective_cost] * 2
    way = once.segments[0].robot_path
    x, y, _ = way.poses_at(np.array([0.5 * way.cost]))[0]
    blocked = questions.with_obstacles([pushplan.CircleObstacle(np.array([x, y]), 0.05)])
    around = blocked.plan(scenario.pushes.robot_start, scenario.start, goals, time_limit=60.0)
    assert around.solved, around.reason
    assert around.objective_cost != once.objective_cost


def test_queries_refuse_what_is_not_free(problem: Problem) -> None:
    questions = pushplan.PushQueries(problem("car"))
    with pytest.raises(PlanningError, match="at the robot's start, 'pusher' overlaps 'b0'"):
        questions.plan([1.05, 1.0, 0.0], [1.0, 1.0, 0.0], [[2.0, 1.0, 0.0]])
    with pytest.raises(PlanningError, match=r"the goal is occupied: at the goal, 'b0' leaves the workspace"):
        questions.plan([0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [[9.0, 1.0, 0.0]])
    with pytest.raises(PlanningError, match="allowed: finite poses"):
        questions.plan([0.0, 1.0, 0.0], [1.0, 1.0], [[2.0, 1.0, 0.0]])
    with pytest.raises(PlanningError, match=r"no robot\.start; allowed: Queries"):
        pushplan.PushQueries(load_scenario("one-box"))
