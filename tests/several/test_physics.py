"""Several pushes where contacts are real: what is in its place goes as planned, what is not comes home too."""

from __future__ import annotations

import math

import numpy as np
import pytest
from several.conftest import Problem

from pushplan.geometry import se2
from pushplan.plan import plan
from pushplan.plans.result import PlanResult
from pushplan.scenario.model import Scenario
from pushplan.several.modes import find_modes
from pushplan.several.physics import SeveralReport, execute_in_physics
from pushplan.sim.slip.simulate import simulate
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray

OFF = np.array([[0.0, 2e-3, math.radians(0.5)]])


@pytest.fixture(scope="module")
def asked(problem: Problem) -> Scenario:
    return problem("omnidirectional", goal={"pose": [0.95, 1.1, 0.0]})


@pytest.fixture(scope="module")
def found(asked: Scenario) -> PlanResult:
    result = plan(asked, first=True)
    assert result.solved
    return result


def executed(asked: Scenario, found: PlanResult, placed: FloatArray | None) -> SeveralReport:
    pytest.importorskip("mujoco", reason="MuJoCo is not installed; the extra pushplan[physics] brings it")
    assert found.trajectory is not None
    modes = find_modes(asked)
    return execute_in_physics(asked, found.segments, found.trajectory, modes, placed=placed)


def test_the_engine_does_what_was_planned(asked: Scenario, found: PlanResult) -> None:
    report = executed(asked, found, None)
    assert report.kept
    assert report.reached(1e-3, math.radians(0.1))
    assert len(report.pushes) == sum(segment.pushes for segment in found.segments)
    assert max(push.approach for push in report.pushes) < 1e-3
    assert max(push.retreat for push in report.pushes) < 1e-3


def test_the_settling_push_closes_a_contact_that_is_off(asked: Scenario, found: PlanResult) -> None:
    report = executed(asked, found, OFF)
    assert max(push.gap for push in report.pushes) < 2e-4
    assert report.reached(5e-3, math.radians(1.0))
    assert report.clear > 5e-3


@pytest.mark.parametrize("placed", [np.zeros((1, 3)), OFF])
def test_where_contacts_slip_the_box_comes_home_too(
    asked: Scenario, found: PlanResult, placed: FloatArray
) -> None:
    own = asked.chain.objects[0].pose_chain
    world = World.from_scenario(asked).with_object_poses(se2.compose(se2.compose(asked.start, placed), own))
    assert found.trajectory is not None
    report = simulate(found.trajectory, world)
    assert report.jammed_at is None
    position, angle = se2.pose_error(
        report.object_poses[-1, 0], se2.compose(found.segments[-1].load_after, own)
    )
    exact = not placed.any()
    assert position < (1e-9 if exact else 5e-3)
    assert angle < (1e-9 if exact else math.radians(1.0))
