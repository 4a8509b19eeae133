"""The slip simulator's solver: docs/will-it-hold.md has figures of a million steps."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from conftest import ChainMaker

import pushplan.core.slip as slip
from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.mechanics.support import FeetSupport, UniformSupport
from pushplan.scenario.parts import CircleObstacle
from pushplan.sim.slip.simulator import SlipSimulator
from pushplan.sim.world import World
from pushplan.util.arrays import FloatArray

make = ChainMaker()


def four_feet(outline: FloatArray) -> FeetSupport:
    return FeetSupport(0.9 * outline, np.full(4, 0.25))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_every_step_of_random_pushes_is_solved(count: int) -> None:
    rng = np.random.default_rng(count)
    for _ in range(10):
        mu = rng.uniform(0.1, 0.8, 2)
        chain = make.boxes(count, contact_friction=mu[0], pusher_friction=mu[1], support=UniformSupport)
        simulator = SlipSimulator(World.from_chain(chain))
        twist = rng.normal(size=3) * [1.0, 1.0, 5.0]
        twist[0] = abs(twist[0])
        trace = simulator.follow(np.tile(1e-3 * twist / np.linalg.norm(twist), (100, 1)))
        assert np.isfinite(trace.poses).all()
        assert np.isfinite(trace.forces).all()
        assert not np.isin(trace.end, (slip.JAMMED, slip.UNSOLVED)).any()
        assert trace.residual.max() <= 1e-7
        assert (trace.forces[:, :, :2] >= -1e-9).all()
        pressed = trace.forces[:, :, :2].sum(axis=2)
        mu_of = np.array([contact.friction for contact in chain.contacts])
        assert (np.abs(trace.forces[:, :, 2]) <= mu_of * pressed + 1e-6).all()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_plate_pushes_with_what_the_floor_holds_against(count: int) -> None:
    """Floor friction from the feet's own displacements, in the plate's frame in the middle of every step."""
    rng = np.random.default_rng(10 + count)
    for friction in (0.05, 0.8):  # slides, sticks
        chain = make.boxes(count, contact_friction=friction, pusher_friction=friction, support=four_feet)
        world = World.from_chain(chain)
        simulator = SlipSimulator(world)
        motion = 2e-4 * np.array([1.0, rng.uniform(-0.5, 0.5), rng.uniform(-4.0, 4.0)])
        trace = simulator.follow(np.tile(motion, (200, 1)))
        poses = np.concatenate([world.object_poses[None], trace.poses])
        plate = se2.compose(world.start, se2.exp((np.arange(200)[:, None] + 0.5) * motion))
        held = np.zeros((200, 3))
        for i, obj in enumerate(chain.objects):
            feet = np.array([se2.transform_points(pose, 0.9 * obj.outline) for pose in poses[:, i]])
            middle = 0.5 * (feet[1:] + feet[:-1]) - plate[:, None, :2]
            moved = np.diff(feet, axis=0)
            loads = obj.friction_load / 4
            force = loads * moved / np.maximum(np.linalg.norm(moved, axis=2, keepdims=True), 1e-15)
            torque = middle[..., 0] * force[..., 1] - middle[..., 1] * force[..., 0]
            held += np.column_stack([se2.rotate(-plate[:, 2], force.sum(axis=1)), torque.sum(axis=1)])
        assert trace.wrenches == pytest.approx(held, abs=0.02 * np.abs(held[:, 0]).max())
        assert np.median(np.abs(trace.wrenches - held)) < 1e-3 * np.abs(held).max()


def test_steps_of_five_millimetres_come_close_to_short_ones() -> None:
    rng = np.random.default_rng(4)
    changes = []
    for _ in range(20):
        world = World.from_chain(make.boxes(2, contact_friction=0.15, pusher_friction=0.2))
        twist = np.array([1.0, rng.uniform(-0.8, 0.8), rng.uniform(-8.0, 8.0)])
        ends = []
        for step in (5e-4, 5e-3):
            simulator = SlipSimulator(world)
            simulator.follow(np.tile(twist * step / (1.0 + 0.1 * abs(twist[2])), (round(0.1 / step), 1)))
            ends.append(simulator.object_poses)
        changes.append(np.hypot(*(ends[0] - ends[1])[:, :2].T).max())
    assert np.percentile(changes, 90) < 6e-4


def test_a_simulator_from_another_process_goes_on_as_the_one_that_stayed() -> None:
    simulator = SlipSimulator(World.from_chain(make.boxes(3, contact_friction=0.2)))
    simulator.move([0.1, 0.05, 0.3], 0.5)
    copy = pickle.loads(pickle.dumps(simulator))
    traces = [one.move([0.1, -0.02, 0.1], 0.5) for one in (simulator, copy)]
    for name in ("poses", "modes", "forces", "wrenches", "others", "residual", "end"):
        np.testing.assert_array_equal(getattr(traces[0], name), getattr(traces[1], name), err_msg=name)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(traces[0])).forces, traces[0].forces)


def test_more_contacts_than_there_is_room_for_are_refused() -> None:
    around = np.linspace(0.1, 1.4, 40)
    # Around a corner: each pin touches along a line of its own.
    places = [0.1, 0.05] + 2e-3 * np.column_stack([np.cos(around), np.sin(around)])
    pins = tuple(CircleObstacle(place, 1e-3) for place in places)
    simulator = SlipSimulator(replace(World.from_chain(make.boxes(1)), obstacles=pins))
    with pytest.raises(PushplanError, match="more than 32 contacts at once"):
        simulator.move([0.1, 0.0, 0.0], 0.1)
