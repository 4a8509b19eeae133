"""The physics engine moved step by step against the slip simulator moved by the same twists."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from conftest import Captured

import pushplan
from pushplan.cli.main import main
from pushplan.geometry.se2 import compose, relative
from pushplan.scenario.file import example_text
from pushplan.sim.physics.simulator import PhysicsSimulator
from pushplan.util.arrays import FloatArray

pytest.importorskip("mujoco", reason="the extra pushplan[physics] brings MuJoCo")

AHEAD, BACK = np.array([0.1, 0.0, 0.02]), np.array([-0.1, 0.0, 0.0])


@pytest.fixture
def crates() -> pushplan.Scenario:
    return pushplan.load_scenario("two-crates")


def moved(world: pushplan.World, *twists: tuple[FloatArray, int]) -> list[tuple[FloatArray, FloatArray]]:
    """Return where objects end and the last wrench, in the engine and in the simulator with slip."""
    found = []
    for simulator in (PhysicsSimulator(world), pushplan.SlipSimulator(world)):
        wrench = np.zeros(3)
        for twist, steps in twists:
            for _ in range(steps):
                wrench = simulator.move(twist, 0.02).wrenches.mean(axis=0)
        assert not simulator.jammed
        found.append((simulator.object_poses, wrench))
    return found


@pytest.mark.parametrize("name", ["two-crates", "hook", "feet"])  # boxes, a polygon that is not convex, known feet
def test_objects_that_stick_go_where_they_do_without_inertia(name: str) -> None:
    world = pushplan.World.from_scenario(pushplan.load_scenario(name))
    (there, wrench), (here, expected) = moved(world, (AHEAD, 25))
    np.testing.assert_allclose(there, here, atol=1e-4)
    np.testing.assert_allclose(wrench[:2], expected[:2], atol=0.05 * np.abs(expected).max())


def test_what_is_left_stays_and_what_is_met_askew_turns_until_it_is_flush(crates: pushplan.Scenario) -> None:
    world = pushplan.World.from_scenario(crates).with_offset([0.004, 0.0, 0.05])
    straight = np.array([0.02, 0.0, 0.0])
    for objects, _ in (ends := moved(world, (straight, 125), (BACK, 5))):
        places = relative(compose(world.start, [0.05, 0.0, 0.0]), objects)
        apart = places - crates.chain.places
        assert np.abs(apart[:, 0]).max() < 1e-3
        assert np.abs(apart[:, 2]).max() < 2e-3
    np.testing.assert_allclose(ends[0][0], ends[1][0], atol=1.5e-3)


def test_a_world_may_be_disturbed_and_the_plate_taken_away(crates: pushplan.Scenario) -> None:
    simulator = PhysicsSimulator(pushplan.World.from_scenario(crates))
    poses = simulator.object_poses + np.array([0.3, 0.1, 0.2])
    simulator.place(poses, simulator.plate_pose)
    simulator.hold(None)
    simulator.move([-0.2, 0.0, 1.0], 0.5)
    simulator.hold(simulator.world.chain)
    np.testing.assert_allclose(simulator.object_poses, poses, atol=1e-9)
    way = relative(simulator.world.start, simulator.plate_pose)
    assert np.hypot(way[0], way[1]) == pytest.approx(0.1, rel=0.2)


def test_the_command_closes_the_loop_in_the_engine(tmp_path: Path, capsys: Captured) -> None:
    stated = yaml.safe_load(example_text("one-box"))
    stated["pusher"]["limits"] = {"speed": 0.5, "acceleration": 1.5, "jerk": 30, "angular_speed": 2}
    stated |= {"goal": {"pose": [1.0, 0.2, 0.2]}, "obstacles": []}
    (tmp_path / "box.yaml").write_text(json.dumps(stated))
    assert main(["simulate", str(tmp_path / "box.yaml"), "--closed-loop", "--physics", "--no-log", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["outcome"] == "arrived"
    assert told["replans"] == []
    assert told["goal_error"]["position"] < 2e-3
