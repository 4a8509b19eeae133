"""Plans and what makes them go to other processes, and are there what they were here."""

import pickle

import numpy as np
import pytest

import pushplan


@pytest.fixture(scope="module")
def plan() -> pushplan.Plan:
    return pushplan.plan(pushplan.load_scenario("two-crates"), first=True, time_limit=60.0)


def test_a_plan_comes_back_with_what_is_worked_out_late(plan: pushplan.Plan) -> None:
    back = pickle.loads(pickle.dumps(plan))
    assert back.metrics() == plan.metrics()
    assert back.robustness == plan.robustness
    assert back.trajectory is not None
    assert plan.trajectory is not None
    np.testing.assert_array_equal(back.trajectory.poses, plan.trajectory.poses)


def test_sets_and_planners_answer_as_before(plan: pushplan.Plan) -> None:
    stable = plan.scenario.stable_set()
    twists = np.array([[1.0, 0.0, 0.0], [1.0, 0.1, 0.5]])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(stable)).margin(twists), stable.margin(twists))
    planner = pickle.loads(pickle.dumps(pushplan.Planner(plan.scenario)))
    assert planner.plan(time_limit=60.0).cost == pytest.approx(plan.cost)


def test_a_controller_goes_on_where_it_was(plan: pushplan.Plan) -> None:
    controller = pickle.loads(pickle.dumps(pushplan.Controller(plan)))
    assert controller.step(0.0).any()


def test_a_follower_goes_on_where_it_was(plan: pushplan.Plan) -> None:
    follower = pickle.loads(pickle.dumps(pushplan.Follower(plan)))
    assert follower.step(plan.segments[0].path.start).twist is not None
