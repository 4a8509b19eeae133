"""Multi-push plans and rearrangements with real contacts: they go as planned, and displaced objects arrive, too."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import there
from kinds import FAST

import pushplan
from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.sim.follower import Follower, FollowerState
from pushplan.sim.slip import simulate
from pushplan.sim.trials import execute_trials
from pushplan.slip.world import World

OFF = np.array([0.0, 2e-3, math.radians(0.5)])
NEAR = [5e-3, math.radians(1.0)]


@pytest.fixture(scope="module", params=["multi-push", "rearrangement"])
def found(request: pytest.FixtureRequest) -> Plan:
    return pushplan.plan(pushplan.scenario_from_text(FAST[request.param]), first=True, seed=1, time_limit=60.0)


def test_a_world_of_other_objects_is_refused(found: Plan) -> None:
    other = World.from_scenario(pushplan.load_scenario("two-crates"))
    with pytest.raises(PushplanError, match="the world has the objects near, far, but the plan has"):
        simulate(found, other)
    in_contact = replace(World.from_scenario(found.scenario), plate=None)
    with pytest.raises(PushplanError, match="the plate's start in the world does not fit it"):
        simulate(found, in_contact)


def test_displaced_objects_also_reach_their_goals(found: Plan) -> None:
    """All of them are 2 mm and half a degree off their nominal poses."""
    world = World.from_scenario(found.scenario)
    report = simulate(found, world.with_object_poses(se2.compose(world.object_poses, OFF)))
    assert report.jammed_at is None
    assert (report.goal_errors(found.scenario) <= NEAR).all()
    trials = execute_trials(found, 6, TrialUncertainty(contact_friction=0.1), seed=2)
    assert (trials.errors <= np.array(NEAR)).all()
    assert (trials.report(3).objects[-1] == trials.object_poses[3]).all()


def test_a_robot_that_follows_the_plan_arrives_and_its_objects_are_watched(found: Plan) -> None:
    execution, trajectory = there(found.execution), there(found.trajectory)
    follower, base = Follower(found), trajectory.base_poses[0]
    for step in range(20_000):
        at = min(int(np.searchsorted(execution.t, 0.02 * step)), len(execution.t) - 1)
        command = follower.step(base, execution.objects[at])
        if command.state is not FollowerState.FOLLOWING:
            break
        base = se2.compose(base, se2.exp(0.02 * command.twist))
    assert (command.state, command.reason) == (FollowerState.ARRIVED, "")
    assert np.hypot(*(base - trajectory.base_poses[-1])[:2]) < 1e-3
