"""The kinematic simulator: poses as commanded, loss of stability where the margin ends."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import there
from plans_of import push_of

from pushplan.mechanics.chain import Limits
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.execution import Execution
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.sim.kinematic import execute


@pytest.fixture(scope="module")
def stable(make_chain: Any) -> StableSet:
    chain = make_chain.boxes(2, size=(0.1, 0.2))
    limits = replace(chain.pusher.limits, contact="quasi-static")
    return stable_set(replace(chain, pusher=replace(chain.pusher, limits=limits)), "ecof")


def executed(trajectory: Trajectory, stable: StableSet) -> Execution:
    plan = push_of(stable.chain, trajectory)
    return execute(plan.scenario, plan.segments, "ecof")


def _path(*arcs: tuple[float, float, float, float]) -> PushPath:
    values = np.array(arcs)
    return PushPath(
        np.array([0.2, -0.1, 0.4]), values[:, :3] / cost_rate(values[:, :3])[:, None], values[:, 3]
    )


STABLE_ARCS = [(1.0, 0.0, 0.0, 0.4), (1.0, -0.1, 0.8, 0.3), (1.0, 0.1, -0.8, 0.3)]


def test_execution_follows_what_was_commanded(stable: StableSet) -> None:
    trajectory = time_path(_path(*STABLE_ARCS), Bounds(Limits()))
    execution = executed(trajectory, stable)
    np.testing.assert_allclose(execution.poses, trajectory.poses, atol=1e-12)
    assert execution.loss is None


def test_the_loss_lies_between_the_samples_around_the_exact_end_of_the_set(stable: StableSet) -> None:
    """The twist turns steadily out of the set; the exact time at which the margin ends is found by bisection."""
    coefficients = np.array([[[0.1, 0.0, 0.0], [0.0, 0.0, 0.2], [0.0, 0.0, 0.0]]])
    trajectory = Trajectory(np.zeros(3), np.array([0.0, 10.0]), coefficients, np.zeros(1))
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        inside = stable.margin(trajectory.twists_at(np.array([middle])))[0] > 0.0
        low, high = (middle, high) if inside else (low, middle)
    loss = there(executed(trajectory, stable).loss)
    assert low <= loss.time <= low + 1.0 / trajectory.rate + 1e-9
