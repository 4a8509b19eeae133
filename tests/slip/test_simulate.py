"""Simulated slip against mechanics that can be worked out otherwise."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import ChainMaker

import pushplan
from pushplan.errors import PushplanError, SupportError
from pushplan.geometry import se2
from pushplan.mechanics.support import FeetSupport, UniformSupport, UnknownSupport
from pushplan.scenario.parts import PolygonObstacle
from pushplan.sim.report import ContactReport, Mode
from pushplan.sim.slip.simulator import SlipSettings, SlipSimulator, simulate_poses, steps_of
from pushplan.sim.world import World
from pushplan.util.arrays import FloatArray

make = ChainMaker()


def on_feet(outline: FloatArray) -> FeetSupport:
    """Four even feet, a little inside the corners."""
    return FeetSupport(0.9 * outline, np.full(len(outline), 1.0 / len(outline)))


def pushed(
    world: World, twist: tuple[float, float, float], way: float = 0.1, step: float = 1e-3
) -> ContactReport:
    """Push with a constant twist for `way` m of the fastest corner."""
    vx, vy, omega = twist
    rate = np.hypot(vx, vy) + world.chain.reach * abs(omega)
    duration = way / rate
    t = np.linspace(0.0, duration, int(np.ceil(way / step)) + 1)
    poses = se2.compose(world.start, se2.exp(np.array(twist) * t[:, None]))
    return simulate_poses(t, poses, world, SlipSettings(step=step))


@pytest.mark.parametrize("step", [1e-3, 1e-2, 5e-2])
@pytest.mark.parametrize("support", [on_feet, UniformSupport])
def test_what_sticks_moves_as_one_body_at_any_step_length(step: float, support: object) -> None:
    world = World.from_chain(make.boxes(3, support=support), (0.3, -0.2, 1.0))  # type: ignore[arg-type]
    report = pushed(world, (0.1, 0.005, 0.05), way=2.0, step=step)
    assert (report.modes == Mode.STICK).all()
    assert report.object_errors.max() < 1e-9


@pytest.mark.parametrize("mu", [0.1, 0.3, 0.6])
def test_a_face_pushed_beyond_its_friction_cone_slides_along_the_cones_edge(mu: float) -> None:
    chain = make.boxes(1, pusher_friction=mu)
    report = pushed(World.from_chain(chain), (0.1, 0.09, 0.0))
    moved = report.objects[-1, 0] - report.objects[0, 0]
    assert (report.modes == Mode.SLIDE).all()
    assert moved[1] / moved[0] == pytest.approx(
        mu, abs=1e-6
    )  # friction along the motion, force along the edge
    assert abs(moved[2]) < 1e-6
    assert report.slide[-1, 0] == pytest.approx(moved[1] - report.poses[-1, 1], abs=1e-9)


def test_contact_forces_balance_the_closed_form_of_floor_friction() -> None:
    chain = make.boxes(1, pusher_friction=0.2)
    world = World.from_chain(chain)
    report = pushed(world, (0.1, 0.03, 0.9), way=0.05)
    assert (report.modes[:, 0] != Mode.STICK).all()
    obj = chain.objects[0]
    simulator = SlipSimulator(world, settings=SlipSettings(step=1e-3))
    forces = simulator.follow(steps_of(report.poses)).forces
    for k in range(len(forces)):
        there = replace(obj, pose_chain=se2.relative(report.poses[k], report.objects[k, 0]))
        moved = se2.compose(
            se2.relative(report.poses[k], report.objects[k + 1, 0]), se2.inverse(there.pose_chain)
        )
        wrench = -pushplan.friction_wrench(there, se2.log(moved)[None])[0]
        normal, tangential = forces[k, 0, :2].sum(), forces[k, 0, 2]
        assert np.hypot(normal, tangential) == pytest.approx(np.hypot(*wrench[:2]), rel=5e-3)


def random_world(rng: np.random.Generator) -> World:
    n = int(rng.integers(1, 4))
    chain = make.boxes(
        n,
        contact_friction=float(rng.uniform(0.1, 0.45)),
        pusher_friction=float(rng.uniform(0.1, 0.45)),
        support=on_feet if rng.random() < 0.5 else UniformSupport,
    )
    return World.from_chain(chain)


def test_contacts_slip_where_the_exact_set_says_so() -> None:
    rng = np.random.default_rng(1)
    looked = 0
    for _ in range(60):
        world = random_world(rng)
        twist = (0.1, float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-1.0, 1.0)))
        margin = float(pushplan.stable_set(world.chain, "ecof").margin(np.array([twist]))[0])
        if abs(margin) < 0.01:
            continue  # undecided: the end of a segment is an unstable equilibrium
        looked += 1
        assert pushed(world, twist, way=0.03).kept == (margin > 0.0), (twist, margin)
    assert looked > 40


def test_a_mirrored_push_slips_mirrored() -> None:
    world = World.from_chain(make.boxes(2, contact_friction=0.15, pusher_friction=0.2, support=on_feet))
    left, right = pushed(world, (0.1, 0.04, 0.4)), pushed(world, (0.1, -0.04, -0.4))
    assert not left.kept
    assert np.abs(left.objects - right.objects * [1.0, -1.0, -1.0]).max() < 1e-7


def test_nothing_goes_through_walls_obstacles_or_one_another() -> None:
    wall = PolygonObstacle(np.array([[0.15, -0.3], [0.4, 0.3], [0.5, 0.3], [0.5, -0.3]]))
    world = replace(World.from_chain(make.boxes(2, support=on_feet)), obstacles=(wall,), other_friction=0.1)
    report = pushed(world, (0.1, 0.0, 0.0), way=0.12)
    assert not report.kept
    last = [
        shapely.Polygon(se2.transform_points(pose, obj.outline))
        for pose, obj in zip(report.objects[-1], world.chain.objects, strict=True)
    ]
    plate = shapely.Polygon(se2.transform_points(report.poses[-1], world.chain.pusher.outline))
    bodies = [*last, plate, shapely.Polygon(wall.outline)]
    depths = [shapely.intersection(a, b).area / 0.1 for i, a in enumerate(bodies) for b in bodies[:i]]
    assert max(depths) < 2e-5


def test_a_box_driven_square_into_a_wall_is_a_jam() -> None:
    wall = PolygonObstacle(np.array([[0.15, -0.3], [0.2, -0.3], [0.2, 0.3], [0.15, 0.3]]))
    world = replace(World.from_chain(make.boxes(1, support=on_feet)), obstacles=(wall,))
    report = pushed(world, (0.1, 0.0, 0.0))
    assert report.jammed_at == pytest.approx(0.5, abs=0.02)
    assert report.poses[-1, 0] == pytest.approx(0.05, abs=2e-3)
    assert not report.kept
    simulator = SlipSimulator(world)
    simulator.move([0.1, 0.0, 0.0], 1.0)
    assert simulator.jammed
    assert len(simulator.move([-0.1, 0.0, 0.0], 1.0).end) == 0


def test_loads_that_are_not_known_and_other_arguments_are_refused() -> None:
    chain = make.boxes(1, support=UnknownSupport)
    with pytest.raises(SupportError, match="the load under 'box0' is unknown"):
        SlipSimulator(World.from_chain(chain))
    frictionless = World.from_chain(make.boxes(1, floor_friction=0.0))
    with pytest.raises(SupportError, match="floor friction must be > 0"):
        SlipSimulator(frictionless)
    with pytest.raises(PushplanError, match="simulate takes a World, not Chain"):
        pushplan.simulate(None, chain)  # type: ignore[arg-type]


def test_worlds_differ_as_asked_for_one_object_or_all() -> None:
    world = World.from_chain(make.boxes(2))
    one, both = world.with_floor_friction(0.5, "box1"), world.with_floor_friction(0.5)
    assert [obj.floor_friction for obj in one.chain.objects] == [0.3, 0.15]
    assert [obj.floor_friction for obj in both.chain.objects] == [0.15, 0.15]
    assert [c.friction for c in world.with_contact_friction(0.5, "box1").chain.contacts] == [0.5, 0.15]
    assert world.with_contact_friction(0.5).chain.pusher.friction == 0.25
    assert [obj.mass for obj in world.with_mass(2.0, "box0").chain.objects] == [2.0, 1.0]
    poses = se2.compose(np.array([0.1, 0.2, 0.3]), world.object_poses)
    assert np.abs(world.with_object_poses(poses).object_poses - poses).max() < 1e-12
    with pytest.raises(PushplanError, match="must be > 0 and at most"):
        world.with_mass(0.0)
