"""Worlds that differ from what a plan believes: what changes, what stays, and how the physics engine counts."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import ChainMaker
from plans_of import push_of

from pushplan.geometry.se2 import compose, relative, transform_points
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.mechanics.perturb import turned_places
from pushplan.mechanics.support import FeetSupport, Support
from pushplan.plans.trajectory import Trajectory
from pushplan.sim.physics import simulate as physics
from pushplan.sim.physics.chains import simulate_trajectory
from pushplan.sim.physics.simulate import HARD, STEPS, simulate_in_physics
from pushplan.sim.report import ContactReport
from pushplan.sim.world import World
from pushplan.util.arrays import FloatArray


def on_corners(outline: FloatArray) -> Support:
    return FeetSupport(0.8 * outline, np.full(4, 0.25))


@pytest.fixture
def chain(make_chain: ChainMaker) -> Chain:
    return make_chain.boxes(3, support=on_corners)


def ahead(speed: float, braking: float) -> Trajectory:
    """Straight ahead for 0.5 s with the top speed, m/s, and a given braking, m/s^2."""
    breaks = np.array([0.0, 0.25, 0.5, 0.5 + speed / braking, 0.6 + speed / braking])
    coefficients = np.zeros((4, 3, 3))
    coefficients[:, 0, 0] = [0.0, speed, speed, 0.0]
    coefficients[:, 1, 0] = [speed / 0.25, 0.0, -braking, 0.0]
    return Trajectory(np.array([1.0, 2.0, 0.5]), breaks, coefficients, np.zeros(4))


def body(chain: Chain, index: int, placed: FloatArray) -> shapely.Polygon:
    if index == PLATE:
        return shapely.Polygon(chain.pusher.outline)
    return shapely.Polygon(transform_points(placed[index], chain.objects[index].outline_chain))


@pytest.mark.parametrize("index", [0, 1, 2])
@pytest.mark.parametrize("angle", [0.01, -0.01])
def test_a_turned_object_touches_with_a_corner_and_overlaps_nothing(
    chain: Chain, index: int, angle: float
) -> None:
    placed = turned_places(chain, index, angle)
    np.testing.assert_allclose(placed[:, 2], angle * (np.arange(3) == index))
    for contact in chain.contacts:
        pusher, pushed = body(chain, contact.pusher, placed), body(chain, contact.pushed, placed)
        assert pusher.intersection(pushed).area < 1e-12
        assert pusher.distance(pushed) < 2.0 * angle**2 * 0.1  # what nothing overlaps by may be left as a gap
    own = chain.contacts[index]
    far = own.right if angle > 0.0 else own.left
    gap = (transform_points(placed[index], far) - far) @ own.normal
    assert gap == pytest.approx(abs(angle) * own.length, rel=1e-3)


@pytest.fixture
def _engine() -> None:
    pytest.importorskip("mujoco", reason="MuJoCo is not installed; the extra pushplan[physics] brings it")


def executed(chain: Chain, trajectory: Trajectory, placed: FloatArray | None = None) -> ContactReport:
    """Execute at full speed, the objects moved as frames (n, 3) of the chain."""
    plan = push_of(chain, trajectory)
    world = World.from_scenario(plan.scenario)
    if placed is not None:
        world = world.with_object_poses(compose(compose(trajectory.start, placed), chain.places))
    return simulate_in_physics(plan, world)


@pytest.mark.usefixtures("_engine")
def test_a_turned_object_closes_and_counts_from_there_on(chain: Chain) -> None:
    report = executed(chain, ahead(0.2, 1.0), turned_places(chain, 1, -0.01))
    assert report.kept
    begin = report.t[np.flatnonzero(report.slide.any(axis=1))[0]]
    assert 0.01 < begin < 0.2
    start, end = (relative(report.objects[k, 0], report.objects[k, 1]) for k in (0, -1))
    assert start[2] == pytest.approx(-0.01)
    assert abs(end[2]) < 1e-5


@pytest.mark.usefixtures("_engine")
@pytest.mark.parametrize(("braking", "kept"), [(2.5, True), (4.0, False)])
def test_verdicts_at_full_speed_are_those_worked_out_by_hand(
    make_chain: ChainMaker, braking: float, kept: bool
) -> None:
    """Friction stops a box with mu g = 2.94 m/s^2, no harder; whoever asks for it is told early."""
    chain, told = make_chain.boxes(1, support=on_corners), list[float]()
    trajectory = ahead(0.3, braking)
    report = simulate_in_physics(push_of(chain, trajectory), until_moved=True, progress=told.append)
    assert report.kept == kept
    assert (report.t[-1] == pytest.approx(trajectory.duration)) == kept
    assert told.count(0.0) == (1 if kept else 2)
    assert (told[-1] == 1.0) == kept


def curve(duration: float) -> Trajectory:
    """A wide left turn at 0.1 m/s with half a second of speeding up, long enough for friction to creep."""
    breaks = np.array([0.0, 0.5, duration])
    coefficients = np.zeros((2, 3, 3))
    coefficients[:, 0, 0], coefficients[:, 0, 2] = [0.0, 0.1], [0.0, 0.05]
    coefficients[0, 1] = [0.2, 0.0, 0.1]
    return Trajectory(np.zeros(3), breaks, coefficients, np.zeros(2))


@pytest.mark.usefixtures("_engine")
def test_creep_of_the_engine_is_not_a_slip(chain: Chain, monkeypatch: pytest.MonkeyPatch) -> None:
    """What passes for a slip in long time steps and not in short ones is looked at in short ones."""
    trajectory = curve(2.0)
    long, short = (
        simulate_trajectory(chain, trajectory, settings=replace(HARD, time_step=share * HARD.time_step))
        for share in STEPS[1:]
    )
    most = [float(report.displacement.max()) for report in (long, short)]
    assert most[1] < 0.8 * most[0]
    monkeypatch.setattr(physics, "HARD", replace(HARD, tolerance=0.5 * sum(most)))
    report = simulate_in_physics(push_of(chain, trajectory))
    assert report.kept
    assert report.displacement.max() == pytest.approx(most[1])
