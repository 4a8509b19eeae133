"""The physics engine as an independent check: first against calculations by hand, then against predictions."""

import json
import runpy
import sys
from dataclasses import replace
from functools import reduce
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from conftest import Captured, ChainMaker, Patch
from plans_of import push_of

from pushplan.cli.main import main
from pushplan.geometry.se2 import compose, exp, relative, transform_points
from pushplan.mechanics.chain import GRAVITY, Chain
from pushplan.mechanics.contacts import friction_wrench
from pushplan.mechanics.sphere import twists_about
from pushplan.mechanics.support import FeetSupport, Support
from pushplan.plans.trajectory import Trajectory
from pushplan.sets.named import stable_set
from pushplan.sim import report as reports
from pushplan.sim.physics import simulate as physics
from pushplan.sim.physics.engine import PhysicsSettings
from pushplan.sim.physics.model import build_model, joint_coordinates
from pushplan.sim.physics.simulate import STEPS, simulate_in_physics
from pushplan.sim.physics.simulator import PhysicsSimulator, sliding_speed
from pushplan.sim.report import ContactReport
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray
from pushplan.util.naming import MissingExtraError

needs_engine = pytest.mark.skipif(
    find_spec("mujoco") is None, reason="MuJoCo is not installed; the extra pushplan[physics] brings it"
)
ROOT = Path(__file__).parents[1]
for folder in ("examples/harada2006", "benchmarks"):
    sys.path.insert(0, str(ROOT / folder))
agreement = runpy.run_path(str(ROOT / "examples" / "harada2006" / "agreement.py"))
turned_places = runpy.run_path(str(ROOT / "benchmarks" / "corner_places.py"))["turned_places"]
random_chains = runpy.run_path(str(ROOT / "benchmarks" / "random_chains.py"))
simulate_twist, simulate_trajectory = (
    sys.modules["pushes"].__dict__[name] for name in ("simulate_twist", "simulate_trajectory")
)
BAND = np.radians(0.5), 0.02
SAFE_BAND = np.radians(0.1), 0.005


def on_corners(outline: FloatArray) -> Support:
    return FeetSupport(0.8 * outline, np.full(4, 0.25))


def straight(speeds: list[float], times: list[float]) -> Trajectory:
    """Return a straight motion with a piecewise linear speed."""
    breaks = np.array(times)
    slopes = np.diff(speeds) / np.diff(times)
    coefficients = np.zeros((len(slopes), 3, 3))
    coefficients[:, 0, 0], coefficients[:, 1, 0] = speeds[:-1], slopes
    return Trajectory(np.array([1.0, 2.0, 0.5]), breaks, coefficients, np.zeros(len(slopes)))


@needs_engine
@pytest.mark.parametrize(
    ("beyond", "error", "turn"), [(0.1, 0.02, 1e-8), (0.5, 0.02, 1e-8), (2.0, 0.02, 1e-8), (10.0, 0.2, 1e-3)]
)
def test_a_box_slides_along_the_plate_as_computed_by_hand(
    make_chain: ChainMaker, beyond: float, error: float, turn: float
) -> None:
    """Pushed beyond the friction angle, a box moves along the edge of the friction cone. Fast slides are up to a
    fifth too long, because the contact model repeatedly lifts the corners. The corners do not land at the same
    time, which turns the box by 0.0004 rad; slow slides turn it only by rounding errors.
    """
    chain = make_chain.boxes(1, pusher_friction=0.25)
    cone = np.arctan(0.25)
    heading = cone + np.radians(beyond)
    report = simulate_twist(chain, [np.cos(heading), np.sin(heading), 0.0], travel=0.01)
    way = np.linalg.norm(report.poses[-1, :2] - report.poses[100, :2])
    slide = -way * (np.sin(heading) - np.cos(heading) * np.tan(cone))
    assert report.slide[-1, 0] - report.slide[100, 0] == pytest.approx(slide, rel=error)
    assert np.abs(report.rotation[:, 0]).max() < turn


@needs_engine
@pytest.mark.parametrize(("braking", "kept"), [(2.5, True), (4.0, False)])
def test_a_box_leaves_a_plate_that_brakes_harder_than_friction(
    make_chain: ChainMaker, braking: float, kept: bool
) -> None:
    """It slides on by v^2 / 2 (1 / (mu g) - 1 / a), and an early stop is available."""
    chain, speed, told = make_chain.boxes(1, support=on_corners), 0.3, list[float]()
    trajectory = straight([0.0, speed, 0.0, 0.0], [0.0, 0.3, 0.3 + speed / braking, 0.6])
    report = simulate_trajectory(chain, trajectory)
    gap = max(0.5 * speed**2 * (1.0 / (0.3 * GRAVITY) - 1.0 / braking), 0.0)
    assert report.moved[:, 0].any() != kept
    assert report.opening[-1, 0] == pytest.approx(gap, rel=0.02, abs=1e-6)
    assert kept or report.moved_at[0] > 0.3
    assert simulate_trajectory(chain, trajectory, slow=True).kept
    judged = simulate_in_physics(push_of(chain, trajectory), until_moved=True, progress=told.append)
    assert judged.kept == kept
    assert (judged.t[-1] == pytest.approx(trajectory.duration)) == kept
    assert told.count(0.0) == (1 if kept else 2)
    assert (told[-1] == 1.0) == kept


@needs_engine
@pytest.mark.parametrize("height", [0.0, 0.03])
@pytest.mark.parametrize("cor", [[0.05, 0.25], [1e6, 0.0]])
def test_floor_friction_of_the_engine_is_coulomb_friction(
    make_chain: ChainMaker, height: float, cor: list[float]
) -> None:
    """Objects carried along by force feel the friction of the closed form, also with shifted loads."""
    chain = make_chain.boxes(2, contact_height=height)
    twist = twists_about(np.array(cor), +1)
    twist *= 1e-3 / np.hypot(*twist[:2])
    places = np.vstack([chain.places, chain.pusher.plate_pose])
    model = build_model(World.from_chain(chain), places, 2e-3, PhysicsSettings(time_step=0.01))
    joints = model.dofs[:, None] + np.arange(3)
    model.model.dof_armature[joints] = 1e8  # so heavy that contacts do not slow them down
    for _ in range(100):
        model.data.qpos[joints] = 0.0
        model.data.qvel[joints] = joint_coordinates(model.anchors, twist * 0.01) / 0.01
        model.step()
    want = [friction_wrench(obj, twist[None], height)[0, :2] for obj in chain.objects]
    np.testing.assert_allclose(model.floor_forces(), want, rtol=2e-3, atol=2e-3)


@needs_engine
def test_predictions_and_simulations_agree() -> None:
    """Chains and a tree, on feet and on polygons; a third of the pushes is close to the boundary."""
    results = []
    for seed in (0, 1, 4):
        rng = np.random.default_rng(seed)
        chain = random_chains["random_tree" if seed == 4 else "random_chain"](rng)
        pushes = agreement["sample_pushes"](stable_set(chain), 6, rng)
        results.append(agreement["compare"](chain, pushes))
    result = reduce(agreement["Agreement"].joined, results)
    assert min(result.predicted.sum(), (~result.predicted).sum()) >= 4
    clear = (np.abs(result.depth(*BAND)) > 1.0) & ~result.footprint
    assert result.agreed[clear].all()
    assert result.kept[result.depth(*SAFE_BAND) > 1.0].all()


def test_a_missing_engine_is_named_with_its_extra(make_chain: ChainMaker, monkeypatch: Patch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'pushplan\[physics\]'"):
        simulate_twist(make_chain.boxes(1), [1.0, 0.0, 0.0])


@pytest.fixture
def chain(make_chain: ChainMaker) -> Chain:
    return make_chain.boxes(3, support=on_corners)


def executed(chain: Chain, trajectory: Trajectory, placed: FloatArray) -> ContactReport:
    """Execute at full speed with objects that follow frames (n, 3) of the chain."""
    plan = push_of(chain, trajectory)
    poses = compose(compose(trajectory.start, placed), chain.places)
    return simulate_in_physics(plan, World.from_scenario(plan.scenario).with_object_poses(poses))


@needs_engine
def test_a_turned_object_closes_and_its_contact_counts_from_then_on(chain: Chain) -> None:
    trajectory = straight([0.0, 0.2, 0.2, 0.0, 0.0], [0.0, 0.25, 0.5, 0.7, 0.8])
    report = executed(chain, trajectory, turned_places(chain, 1, -0.01))
    assert report.kept
    begin = report.t[np.flatnonzero(report.slide.any(axis=1))[0]]
    assert 0.01 < begin < 0.2
    start, end = (relative(report.objects[k, 0], report.objects[k, 1]) for k in (0, -1))
    assert start[2] == pytest.approx(-0.01)
    assert abs(end[2]) < 1e-5


def curve(duration: float) -> Trajectory:
    """Return a wide left turn at 0.1 m/s with half a second of acceleration, long enough for friction to creep."""
    breaks = np.array([0.0, 0.5, duration])
    coefficients = np.zeros((2, 3, 3))
    coefficients[:, 0, 0], coefficients[:, 0, 2] = [0.0, 0.1], [0.0, 0.05]
    coefficients[0, 1] = [0.2, 0.0, 0.1]
    return Trajectory(np.zeros(3), breaks, coefficients, np.zeros(2))


@needs_engine
def test_creep_of_the_engine_does_not_count_as_slip(chain: Chain, monkeypatch: Patch) -> None:
    """A slip in long time steps only is checked again in short ones."""
    trajectory = curve(1.0)
    plan, most = push_of(chain, trajectory), []
    for share in STEPS[1:]:
        monkeypatch.setattr(physics, "STEPS", (share,))
        most.append(float(simulate_in_physics(plan).displacement.max()))
    assert most[1] < 0.8 * most[0]
    monkeypatch.setattr(physics, "STEPS", STEPS)
    for module in (physics, reports):
        monkeypatch.setattr(module, "TOLERANCE", 0.5 * sum(most))
    report = simulate_in_physics(plan)
    assert report.kept
    assert report.displacement.max() == pytest.approx(most[1])


SCENARIO = """\
format: pushplan/1
floor: {friction: 0.3}
objects:
  - name: box
    shape: {box: [0.1, 0.1]}
    mass: 1.0
    support: {feet: [[-0.04, -0.04, 0.25], [0.04, -0.04, 0.25], [0.04, 0.04, 0.25], [-0.04, 0.04, 0.25]]}
pusher:
  width: 0.2
  friction: 0.5
  limits: {speed: 0.8, acceleration: 0.5, jerk: 1000, contact: quasi-static}
goal: {pose: [0.2, 0, 0]}
stability: {margin: 0}
"""


def written(folder: Path, acceleration: str = "0.5") -> str:
    path = folder / "scenario.yaml"
    path.write_text(SCENARIO.replace("acceleration: 0.5", f"acceleration: {acceleration}"), "utf-8")
    return str(path)


@needs_engine
def test_a_gentle_push_holds_in_plan_and_in_replay(tmp_path: Path, capsys: Captured) -> None:
    log = str(tmp_path / "run.mcap")
    assert main(["plan", written(tmp_path), "--first", "--physics", "--json", "-o", log]) == 0
    planned = capsys.readouterr()
    physics = json.loads(planned.out)["physics"]
    assert physics["kept"] is True
    (contact,) = physics["contacts"]
    assert (contact["contact"], contact["moved"], contact["moved_at"]) == ("pusher-box", False, None)
    assert contact["slide"] < 1e-4
    assert "in the physics engine, at full speed: every contact held" in planned.err
    assert main(["replay", log, "--physics", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["physics"] == physics


@needs_engine
def test_a_push_that_brakes_too_hard_is_a_mismatch(tmp_path: Path, capsys: Captured) -> None:
    """It brakes with 6 m/s^2 although friction allows 2.94."""
    code = main(["plan", written(tmp_path, "6.0"), "--first", "--physics"])
    out = capsys.readouterr().out
    assert code == 4, out
    assert "in the physics engine, at full speed: a contact moved" in out
    assert "pusher-box  moved from 0." in out


def test_the_sliding_speed_is_that_of_the_fastest_corner() -> None:
    chain, dt = ChainMaker().random(2, 3), 1e-4
    twist = np.array([0.1, -0.3, 2.0])
    frames = compose([1.0, -2.0, 2.5], exp(dt * np.arange(5)[:, None] * twist))
    corners = [transform_points(pose, obj.outline_chain) for pose in frames[:2] for obj in chain.objects]
    apart = np.concatenate(corners[:3]) - np.concatenate(corners[3:])
    assert sliding_speed(chain, frames, dt) == pytest.approx(np.hypot(*apart.T).max() / dt, rel=1e-3)


@needs_engine
def test_wrenches_are_about_the_moved_frame(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(2)
    aside = replace(chain, pusher=replace(chain.pusher, outline=np.add(chain.pusher.outline, [0.0, 0.02])))
    plate = aside.pusher.plate_pose
    np.testing.assert_allclose(plate, [0.0, 0.02, 0.0], atol=1e-12)
    ways, found = exp(np.linspace(0.0, 0.02, 201)[:, None] * [1.0, 0.05, 0.4]), []
    for held, frames in ((aside, ways), (None, compose(ways, plate))):
        simulator = PhysicsSimulator(World.from_chain(aside))
        simulator.hold(held)
        found.append(simulator.move_along(frames))
    about_frame, about_plate = found
    np.testing.assert_allclose(about_frame[:, :2], about_plate[:, :2], atol=1e-9)
    moment = about_plate[:, 2] - plate[1] * about_plate[:, 0]
    np.testing.assert_allclose(about_frame[:, 2], moment, atol=1e-9)
    assert np.abs(about_plate[-1, :2]).min() > 0.01
