"""Simulated slip against independent mechanics and measured pushes, and its solver."""

import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely
from conftest import ChainMaker

import pushplan
import pushplan.core.slip as slip
from pushplan.errors import PushplanError, SupportError
from pushplan.geometry import se2
from pushplan.mechanics.chain import PLATE, Chain, Contact, PushedObject
from pushplan.mechanics.support import FeetSupport, UniformSupport, UnknownSupport
from pushplan.scenario.parts import CircleObstacle, PolygonObstacle
from pushplan.sim.report import ContactReport, Mode
from pushplan.sim.slip import simulate_poses
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

make = ChainMaker()


def on_feet(outline: FloatArray) -> FeetSupport:
    """Return four equal feet a little inside the corners."""
    return FeetSupport(0.9 * outline, np.full(len(outline), 1.0 / len(outline)))


def pushed(world: World, twist: tuple[float, float, float], way: float = 0.1, step: float = 1e-3) -> ContactReport:
    """Push with a constant twist until the fastest corner has moved by `way`, m."""
    vx, vy, omega = twist
    rate = np.hypot(vx, vy) + world.chain.reach * abs(omega)
    duration = way / rate
    t = np.linspace(0.0, duration, int(np.ceil(way / step)) + 1)
    poses = se2.compose(world.start, se2.exp(np.array(twist) * t[:, None]))
    return simulate_poses(t, poses, world)


@pytest.mark.parametrize("step", [1e-3, 1e-2, 5e-2])
@pytest.mark.parametrize("support", [on_feet, UniformSupport])
def test_sticking_objects_move_as_one_body_for_every_step_length(step: float, support: object) -> None:
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
    assert moved[1] / moved[0] == pytest.approx(mu, abs=1e-6)  # friction along the motion, force along the edge
    assert abs(moved[2]) < 1e-6
    assert report.slide[-1, 0] == pytest.approx(moved[1] - report.poses[-1, 1], abs=1e-9)


def random_world(rng: np.random.Generator) -> World:
    n = int(rng.integers(1, 4))
    chain = make.boxes(
        n,
        contact_friction=float(rng.uniform(0.1, 0.45)),
        pusher_friction=float(rng.uniform(0.1, 0.45)),
        support=on_feet if rng.random() < 0.5 else UniformSupport,
    )
    return World.from_chain(chain)


def test_contacts_slip_outside_the_exact_set() -> None:
    rng = np.random.default_rng(1)
    looked = 0
    for _ in range(30):
        world = random_world(rng)
        twist = (0.1, float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-1.0, 1.0)))
        margin = float(pushplan.stable_set(world.chain, "ecof").margin(np.array([twist]))[0])
        if abs(margin) < 0.01:
            continue  # undecided: the end of a segment is an unstable equilibrium
        looked += 1
        assert pushed(world, twist, way=0.03).kept == (margin > 0.0), (twist, margin)
    assert looked > 20


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


def scattered(seed: int) -> World:
    """Return four polygons at random headings, every other one non-convex, before a turned plate; a triangle and a
    disc.
    """
    rng = np.random.default_rng(seed)
    chain = make.boxes(1, size=(0.08, 0.12), pusher_friction=float(rng.uniform(0.1, 0.5)))
    start, beside = np.array([0.4, -0.3, rng.uniform(-3.0, 3.0)]), []
    for k in range(4):
        outline = make.star(rng, int(rng.integers(3, 7)), 0.07)
        outline = outline if k % 2 else shapely.get_coordinates(shapely.MultiPoint(outline).convex_hull)[-1:0:-1]
        obj = PushedObject(f"o{k}", outline, float(rng.uniform(0.3, 2.0)), 0.3, UniformSupport(outline), np.zeros(3))
        contact = Contact(np.array([-0.1, -0.01]), np.array([-0.1, 0.01]), 0.3, 0, PLATE)
        place = np.array([0.17 + 0.13 * (k // 2), 0.16 * (k % 2 - 0.5), rng.uniform(-3.0, 3.0)])
        beside.append(World.from_chain(Chain((obj,), (contact,), chain.pusher), se2.compose(start, place)))
    corners = se2.transform_points(start, np.array([[0.42, -0.05], [0.5, -0.2], [0.5, 0.0], [0.42, 0.1]]))
    obstacles = (PolygonObstacle(corners[:3]), CircleObstacle(corners[3], 0.05))
    world = World.from_chain(chain, start)
    return replace(world, beside=tuple(beside), obstacles=obstacles, other_friction=0.15)


@pytest.mark.parametrize("seed", [1, 3, 8])
def test_only_touched_bodies_move_and_none_overlap(seed: int) -> None:
    """Bodies rest and touch in random ways, corner to corner and face to face; shapely computes the overlaps."""
    world, rng = scattered(seed), np.random.default_rng(seed)
    simulator, (wall, disc), entered, moved = SlipSimulator(world), world.obstacles, 0.0, 0
    assert isinstance(wall, PolygonObstacle)
    assert isinstance(disc, CircleObstacle)
    still = [shapely.Polygon(wall.outline), shapely.Point(disc.center).buffer(disc.radius, quad_segs=400)]
    before = simulator.object_poses.copy()
    for _ in range(160):
        motion = np.array([8e-4, rng.uniform(-4e-4, 4e-4), rng.uniform(-8e-3, 8e-3)])
        trace, now = simulator.follow(motion[None]), simulator.object_poses.copy()
        assert np.isin(trace.end, (slip.CONVERGED, slip.FALLBACK)).all()
        outlines = [*(obj.outline for obj in world.objects), world.chain.pusher.outline]
        placed = map(se2.transform_points, (*now, simulator.plate_pose), outlines)
        bodies = [*map(shapely.Polygon, placed), *still]
        pairs = np.array([[a, b] for i, a in enumerate(bodies) for b in bodies[:i]])
        entered = max(entered, float(shapely.area(shapely.intersection(*pairs.T)).max()))
        gaps = shapely.distance(np.array(bodies)[:, None], np.array(bodies)) + np.eye(len(bodies))
        gone = np.abs(now - before).max(axis=1) > 1e-9
        assert (gaps.min(axis=1)[: len(now)][gone] < 6e-4).all()  # it was touched in the middle of the step
        before, moved = now, moved + int(gone.sum())
    assert entered < 1e-7
    assert moved > 200


@pytest.mark.parametrize(
    ("end", "jammed", "stalled"),
    [
        (slip.CONVERGED, False, False),
        (slip.FALLBACK, False, False),
        (slip.UNSOLVED, True, False),
        (slip.JAMMED, True, False),
        (slip.STALLED, False, True),
    ],
)
def test_after_a_step_without_a_solution_nothing_moves_until_objects_are_placed(
    end: int, jammed: bool, stalled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: list[int] = []

    class Ending:
        def __init__(self, *_: object) -> None: ...

        def march(self, motions: FloatArray, _: float) -> SimpleNamespace:
            counts.append(len(motions))
            return SimpleNamespace(end=np.array([slip.CONVERGED, end][: len(motions)]))

    monkeypatch.setattr(slip, "Simulation", Ending)
    world = World.from_chain(make.boxes(1))
    simulator = SlipSimulator(world)
    simulator.follow(np.zeros((2, 3)))
    assert (simulator.jammed, simulator.stalled) == (jammed, stalled)
    simulator.follow(np.zeros((2, 3)))
    assert counts == [2, 0 if jammed else 2]
    simulator.place(world.object_poses, world.start)
    assert not simulator.jammed
    assert not simulator.stalled


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
    with pytest.raises(PushplanError, match="simulate needs a World, not Chain"):
        pushplan.simulate(None, chain)  # type: ignore[arg-type]


def test_worlds_differ_as_requested_for_one_object_or_all() -> None:
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


SQUARE = 0.045 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
TIP = np.array([[0.0, 0.0, 4.75e-3]])
REAL = np.array(
    [
        [0.36206, -0.04214, 0.00652, 0.39749, 0.0081, 0.3981, -0.04191, 0.35061, -0.0673, -0.66979],
        [0.33746, -0.03813, -1.94385, 0.39771, -0.0084, 0.42881, -0.04751, 0.33751, -0.03824, -1.94499],
        [0.32365, -0.02318, 1.6992, 0.37769, -0.05201, 0.33338, -0.0752, 0.30304, -0.02116, 1.16534],
        [0.35093, -0.05449, 1.04953, 0.41471, -0.0334, 0.45331, -0.0652, 0.35101, -0.05453, 1.0517],
        [0.32371, -0.03261, -0.86671, 0.38339, -0.0472, 0.40021, -9e-05, 0.32445, -0.03132, -0.68131],
    ]
)
"""Object before (x, y, theta), tip before and after (x, y), object after: pushes of the square 'rect1' on ABS by the
MIT MCube lab (Yu et al., IROS 2016), as logged in github.com/robinzhoucmu/Pushing, Apache-2.0; units changed."""


FingerPush = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "finger_push.py"))["FingerPush"]


def square(fingers: FloatArray, friction: float = 0.225) -> Any:
    obj = PushedObject("square", SQUARE[::-1], 1.0, 0.3, UniformSupport(SQUARE), np.zeros(3))
    return FingerPush(obj, fingers, friction)


def along(begin: tuple[float, float], end: tuple[float, float], steps: int = 50) -> FloatArray:
    share = np.linspace(0.0, 1.0, steps + 1)[:, None]
    return np.column_stack([np.array(begin) + (np.array(end) - begin) * share, np.zeros(steps + 1)])


def test_a_push_through_the_centre_goes_straight_and_one_beside_it_turns() -> None:
    reach = 0.045 + 4.75e-3
    straight = square(TIP).push(np.zeros(3), along((-reach, 0.0), (0.05 - reach, 0.0)))
    assert straight[-1] == pytest.approx([0.05, 0.0, 0.0], abs=1e-6)
    aside = square(TIP).push(np.zeros(3), along((-reach, 0.02), (0.05 - reach, 0.02)))
    assert aside[-1, 2] < -0.3


def test_measured_pushes_are_predicted_to_a_few_millimetres() -> None:
    push = square(TIP)
    for row in REAL:
        predicted = push.push(row[:3], along(tuple(row[3:5]), tuple(row[5:7])))[-1]
        assert np.hypot(*(predicted - row[7:])[:2]) < 6e-3
        assert abs(se2.wrap_angle(predicted[2] - row[9])) < 0.2


# The slip simulator's solver: docs/will-it-hold.md has figures of a million steps.


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
        assert (trace.end == slip.CONVERGED).mean() > 0.95  # Newton's method, and seldom its fallback
        assert (trace.forces[:, :, :2] >= -1e-9).all()
        pressed = trace.forces[:, :, :2].sum(axis=2)
        mu_of = np.array([contact.friction for contact in chain.contacts])
        assert (np.abs(trace.forces[:, :, 2]) <= mu_of * pressed + 1e-6).all()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_force_of_the_plate_balances_floor_friction(count: int) -> None:
    """Floor friction follows from the feet's displacements, in the plate's frame in the middle of every step."""
    rng = np.random.default_rng(10 + count)
    for friction in (0.05, 0.8):  # slides, sticks
        chain = make.boxes(count, contact_friction=friction, pusher_friction=friction, support=on_feet)
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


@pytest.mark.parametrize(
    ("count", "twist"), [(1, (1.0, 0.5, 2.0)), (1, (1.0, -0.2, 14.0)), (2, (1.0, 0.4, 2.0)), (2, (1.0, 0.0, 8.0))]
)
def test_slipping_objects_end_at_the_poses_of_the_physics_engine(
    count: int, twist: tuple[float, float, float]
) -> None:
    """A small version of `benchmarks/slip_in_physics.py`."""
    pytest.importorskip("mujoco")
    chain = make.boxes(count, contact_friction=0.2, pusher_friction=0.3, support=on_feet)
    length = chain.characteristic_length
    travel = 0.15 * length
    way = np.linspace(0.0, travel / np.hypot(np.hypot(*twist[:2]), length * twist[2]), 60)
    mine = simulate_poses(way, se2.exp(np.array(twist) * way[:, None]), World.from_chain(chain))
    pushes = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "harada2006" / "pushes.py"))
    physics = pushes["simulate_twist"](chain, twist, travel, pushes["SLIPPING"], pushes["SLIPPING_STEP"])
    off = mine.objects[-1] - physics.objects[-1]
    assert not mine.kept
    assert not physics.kept
    assert np.hypot(off[:, 0], off[:, 1]).max() < 2e-4
    assert np.degrees(np.abs(off[:, 2])).max() < 0.2


def test_contacts_can_lose_nearly_all_of_their_friction() -> None:
    world = scattered(1).with_contact_friction(0.05)
    assert [c.friction for c in world.chain.contacts] == [
        pytest.approx(0.05 * c.friction) for c in scattered(1).chain.contacts
    ]
    assert world.other_friction == pytest.approx(0.05 * 0.15)
