"""Many questions in one room: each answer is what a plan of its own would say."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pushplan import Scenario
from pushplan.errors import PlanningError
from pushplan.geometry.se2 import pose_error
from pushplan.planners.clearance import find_collision
from pushplan.planners.planner import Planner, plan
from pushplan.planners.problem import build_problem
from pushplan.planners.search.form import free_word
from pushplan.planners.search.session import Budget, Session
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Goal, PolygonObstacle

START, GOAL = np.array([0.3, 0.3, 0.8]), np.array([3.5, 3.4, 0.5])


@pytest.fixture(scope="module")
def clutter() -> Scenario:
    return load_scenario("three-boxes-clutter")


@pytest.fixture(scope="module")
def planner(clutter: Scenario) -> Planner:
    return Planner(clutter)


def _between(scenario: Scenario, start: np.ndarray, goal: np.ndarray) -> Scenario:
    return replace(scenario, start=start, goal=Goal(goal, None, goal, 0.002, 0.003))


def test_a_plan_is_the_first_plan_of_its_own_scenario(planner: Planner, clutter: Scenario) -> None:
    asked, own = planner.plan(START, GOAL, seed=3), plan(_between(clutter, START, GOAL), seed=3, first=True)
    assert asked.solved, asked.reason
    assert asked.path is not None
    assert own.path is not None
    assert asked.trajectory is not None
    assert own.trajectory is not None
    np.testing.assert_array_equal(asked.path.twists, own.path.twists)
    np.testing.assert_array_equal(asked.trajectory.poses, own.trajectory.poses)
    assert asked.robustness == own.robustness
    assert asked.lower_bound == own.lower_bound


def test_a_path_without_times_is_the_same_path_and_checked(planner: Planner, clutter: Scenario) -> None:
    timed, path = (planner.plan(START, GOAL, seed=3, timed=timed) for timed in (True, False))
    assert path.solved
    assert (path.trajectory, path.execution, path.robustness) == (None, None, None)
    assert path.path is not None
    assert timed.path is not None
    np.testing.assert_array_equal(path.path.lengths, timed.path.lengths)
    assert max(pose_error(path.path.end, GOAL)) < 1e-9
    assert find_collision(clutter, path.path.sampled(0.01)) is None


def test_reach_is_the_cost_of_the_free_word_of_each_pair(planner: Planner, clutter: Scenario) -> None:
    rng = np.random.default_rng(2)
    poses = rng.uniform([0.0, 0.0, -3.0], [4.0, 4.0, 3.0], (60, 3))
    free = [find_collision(clutter, pose[None]) is None for pose in poses]
    poses = np.concatenate([poses[free][:12], poses[np.logical_not(free)][:2]])
    starts, goals = poses[:7], poses[7:]
    costs = planner.reach(starts, goals)
    asked = clutter.with_margin(0.05)
    stable, found = asked.stable_set(), 0
    for (i, start), (j, goal) in product(enumerate(starts), enumerate(goals)):
        session = Session(build_problem(_between(asked, start, goal), stable), start, Budget(1.0), seed=0)
        ends = (find_collision(clutter, end[None]) is None for end in (start, goal))
        word = free_word(session, start, goal) if all(ends) else None
        assert costs[i, j] == pytest.approx(np.inf if word is None else word[:, 3].sum(), rel=1e-12)
        found += word is not None
    assert 1 < found < costs.size


def test_other_obstacles_change_the_room_and_nothing_else(planner: Planner) -> None:
    free = planner.with_obstacles([])
    assert np.isfinite(free.reach([START], [GOAL])).all()
    wall = PolygonObstacle(np.array([[0.0, 2.0], [4.0, 2.0], [4.0, 2.1], [0.0, 2.1]]))
    walled = free.with_obstacles([wall])
    assert np.isinf(walled.reach([START], [GOAL])).all()
    assert not walled.plan(START, GOAL, time_limit=0.3).solved
    assert free.plan(START, GOAL).solved


def test_poses_that_are_none_or_blocked_are_refused(planner: Planner) -> None:
    with pytest.raises(PlanningError, match=r"start have the shape \(1, 2\); allowed: finite poses \(k, 3\)"):
        planner.plan([0.0, 0.0], GOAL)
    with pytest.raises(PlanningError, match="goals have the shape"):
        planner.reach([START], [[np.nan, 0.0, 0.0]])
    with pytest.raises(PlanningError, match="at the goal, 'third'"):
        planner.plan(START, [1.0, 0.45, 0.0])
    with pytest.raises(PlanningError, match="nothing to push"):
        planner.plan(START, START)
