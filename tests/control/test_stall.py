"""Stalls: both simulators stop the plate at the robot's force, and the loop ends with what is too heavy."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import yaml
from conftest import Patch, there
from several.conftest import problem_document

import pushplan
from pushplan.plans.plan import Plan
from pushplan.scenario.file import example_text, scenario_from_document
from pushplan.sim.control.controller import Controller
from pushplan.sim.control.jobs import Phase
from pushplan.sim.control.simulated_push import Disturbance, simulate_push
from pushplan.sim.control.stall import StallWatch
from pushplan.sim.physics.simulate import simulate_in_physics
from pushplan.sim.physics.simulator import PhysicsSimulator
from pushplan.sim.slip import simulate
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

PLACES = np.array([[0.05, 0.0, 0.0], [0.15, 0.01, 0.0]])
RATE, SPEED = 50.0, 0.2


def met(gap: float = 0.0, stuck: float = math.inf) -> Callable[[float], list[float]]:
    """Ways of both objects while the plate has gone so far: met after a gap, and stuck from there on."""
    return lambda way: [min(max(way - gap, 0.0), stuck)] * 2


@pytest.mark.parametrize(
    ("moves", "late", "onto", "names", "off", "stands"),
    [
        (met(), 0.0, "", (), 0.0, None),
        (met(), 0.2, "", (), 0.0, None),
        (met(gap=0.012), 0.15, "", (), 0.0, None),  # the plate was not in contact yet
        (met(gap=0.025), 0.0, "", (), 0.018, None),  # nor here, by the measurements
        (met(stuck=0.0), 0.0, "", ("near", "far"), 0.0, None),
        (met(stuck=0.2), 0.2, "", ("near", "far"), 0.0, None),
        (met(stuck=0.2), 0.0, "", ("near", "far"), 0.0, 0.2),  # the plate is measured, too
        (met(stuck=0.2), 0.0, "other", ("other",), 0.0, None),
        (lambda way: [min(way, 0.1), 0.0], 0.0, "", ("far",), 0.0, None),  # the plate has just met it
        (lambda way: [way, 0.0], 0.0, "", (), 0.0, None),  # its contact slips
        (lambda way: [0.0, math.nan], 0.0, "", ("near", "far"), 0.0, None),
        (lambda way: [way, math.nan], 0.0, "", (), 0.0, None),
    ],
)
def test_only_a_load_that_stands_still_as_a_whole_stalls(
    moves: Callable[[float], list[float]],
    late: float,
    onto: str,
    names: tuple[str, ...],
    off: float,
    stands: float | None,
) -> None:
    watch, random = StallWatch(["near", "far"], onto), np.random.default_rng(1)
    ways = np.cumsum(np.minimum(0.5 * np.arange(200) / RATE, SPEED)) / RATE
    found: tuple[str, ...] = ()
    for k, way in enumerate(ways):
        plate = np.array([min(way, stands) if stands is not None else way, 0.0, 0.0])
        watch.driven(k / RATE, np.array([(way - ways[max(k - 1, 0)]), 0.0, 0.0]), plate - [off, 0.0, 0.0])
        if k % 2 == 0:
            seen = PLACES + random.normal(size=(2, 3)) * [1e-3, 1e-3, 5e-3]
            seen[:, 0] += moves(float(ways[max(0, k - round(late * RATE))]))
            watch.see(k / RATE, np.where(np.isnan(seen[:, :1]), np.nan, seen), 1e-3)
        found = found or watch.stalled(PLACES)
    assert found == names


def _plan(**robot: Any) -> Plan:
    document = {**yaml.safe_load(example_text("two-crates")), "robot": {"limits": robot}}
    plan = pushplan.plan(scenario_from_document(document), seed=1, time_limit=60.0, iterations=300, first=True)
    assert plan.solved
    return plan


@pytest.fixture(scope="module")
def plan() -> Plan:
    return _plan(force=8.0)


@pytest.mark.parametrize("simulator", [SlipSimulator, PhysicsSimulator])
def test_a_load_heavier_than_believed_stalls_and_the_loop_says_so(plan: Plan, simulator: Any) -> None:
    world = World.from_scenario(plan.scenario)
    in_slip = simulator is SlipSimulator
    if not in_slip:
        pytest.importorskip("mujoco")
    executed: Any = simulate if in_slip else simulate_in_physics
    heavy = world.with_mass(1.5)
    report = executed(plan, heavy)
    assert not report.kept
    assert not report.arrived(plan.scenario)
    stalled_at = there(report.stalled_at)
    assert report.t[-1] <= stalled_at < there(plan.duration)
    if in_slip:
        assert executed(plan, world).stalled_at is None
        forces = np.hypot(*report.wrenches[:, :2].T)
        assert 0.9 * 8.0 < forces.max() <= 8.0
    controller = Controller(plan)
    course = simulate_push(heavy, controller, controller.settings.rate, simulator_of=simulator)
    assert controller.reason == "the plate stalls: it cannot push near, far, and has 8 N"
    assert "stall" in [event.kind for event in controller.events]
    assert course.t[-1] < stalled_at + 2.0
    assert np.ptp(course.object_poses[-8:, :, :2], axis=0).max() < 1e-4


@pytest.mark.parametrize("simulator_of", [SlipSimulator, PhysicsSimulator])
def test_a_stalled_plate_stands_until_it_backs_off(plan: Plan, simulator_of: Any) -> None:
    if simulator_of is PhysicsSimulator:
        pytest.importorskip("mujoco")
    world = World.from_scenario(plan.scenario).with_floor_friction(1.5)
    simulator: Any = simulator_of(world)
    for _ in range(10):
        simulator.move([0.1, 0.0, 0.0], 0.05)
    assert simulator.stalled
    assert np.hypot(*(simulator.plate_pose - world.start)[:2]) < 8e-3
    simulator.move([-0.1, 0.0, 0.0], 0.5)
    assert not simulator.stalled
    assert simulator.plate_pose[0] - world.start[0] < -0.04


def test_a_plate_that_closes_contacts_may_not_have_met_its_load_yet(plan: Plan, monkeypatch: Patch) -> None:
    controller, asked = Controller(plan), set[Phase]()

    def stalled(watch: StallWatch, places: FloatArray) -> tuple[str, ...]:
        asked.add(controller.phase)
        return ()

    monkeypatch.setattr(StallWatch, "stalled", stalled)
    apart = Disturbance(8.0, 0, 8e-3, 0.0, 0.09)
    simulate_push(World.from_scenario(plan.scenario), controller, controller.settings.rate, [apart])
    assert "close" in [event.kind for event in controller.events]
    assert Phase.PUSHING in asked
    assert Phase.CLOSING not in asked


@pytest.mark.parametrize("kick", [(15.0, 0, 10e-3, 0.0, 0.05), (8.0, 1, 15e-3, 0.0, 0.05)])
def test_a_push_that_closes_contacts_only_as_believed_is_tried(plan: Plan, kick: tuple[Any, ...]) -> None:
    controller = Controller(plan)
    simulate_push(World.from_scenario(plan.scenario), controller, controller.settings.rate, [Disturbance(*kick)])
    assert controller.phase is Phase.ARRIVED or "remain to the goal" in controller.reason, controller.reason


def test_of_several_pushes_a_second_stall_ends_all() -> None:
    scenario = scenario_from_document(problem_document("car", 2, robot={"limits": {"force": 8.0}}))
    plan = pushplan.plan(scenario, seed=1, time_limit=60.0, first=True)
    controller = Controller(plan)
    simulate_push(World.from_scenario(scenario).with_mass(1.5), controller, controller.settings.rate)
    assert controller.reason == "the plate stalls: it cannot push b1, b0, and has 8 N"  # from another face
    assert [event.kind for event in controller.events].count("stall") == 2
    assert any(replan.rest and replan.solved for replan in controller.replans)
