"""Friction and loads from measured pushes: laws of the parts, truth inside intervals, the command."""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from conftest import ChainMaker, identify_roughly, there
from scipy.special import logsumexp

import pushplan
from pushplan.cli.main import main
from pushplan.errors import PushplanError, RunLogError
from pushplan.geometry import se2
from pushplan.identify import read_push
from pushplan.logging.writer import RunLogWriter
from pushplan.mechanics.support import FeetSupport
from pushplan.planner import plan
from pushplan.scenario.file import scenario_from_document
from pushplan.sim.identify.identify import _mean_force, identify_pushes
from pushplan.sim.identify.measured_push import Identification, MeasuredPush, piece_of, with_learned
from pushplan.sim.identify.posterior import NOISES, SPREADS, TAILS, USUAL, Likelihood, Near, sample
from pushplan.sim.identify.unknowns import PressedOutline, Unknowns, _broken_stick
from pushplan.sim.report import ContactReport
from pushplan.sim.slip import simulate_poses
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

SAMPLES = 41
"""Number of samples of a measured push."""

BOX = np.array([[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]])


def crates() -> pushplan.Scenario:
    scenario = pushplan.load_scenario("two-crates")
    return replace(scenario, obstacles=(), workspace=None)


def moved(world: World, twist: FloatArray) -> ContactReport:
    """Return a push with a constant body twist (3,), m and rad, as the simulator with slip has it."""
    shares = np.linspace(0.0, 1.0, SAMPLES)
    return simulate_poses(shares, se2.compose(world.start, se2.exp(shares[:, None] * twist)), world)


def pushed(
    world: World, twist: FloatArray, noise: float, seed: int, force_noise: float | None = None
) -> MeasuredPush:
    """Return what is measured of such a push; forces only with a noise (N)."""
    report = moved(world, twist)
    off = noise * np.random.default_rng(seed).standard_normal(report.objects.shape) * [1.0, 1.0, 5.0]
    if force_noise is None:
        return MeasuredPush(report.poses, report.objects + off)
    wrenches, size = there(report.wrenches), force_noise * np.array([1.0, 1.0, 0.05])
    noisy = wrenches + size * np.random.default_rng([seed, 1]).standard_normal(wrenches.shape)
    return MeasuredPush(report.poses, report.objects + off, wrenches=noisy)


@pytest.fixture(scope="module", autouse=True)
def _rougher() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        identify_roughly(patch)
        yield


@pytest.fixture(scope="module")
def found() -> tuple[FloatArray, Identification]:
    """True values, and what two short pushes tell of them."""
    stated = World.from_scenario(crates())
    unknowns = Unknowns.from_world(stated)
    parts = np.full(len(unknowns.each), 0.5)
    parts[:3] = 0.2, 0.15, 0.6
    truth = unknowns.values(parts)
    world = unknowns.world_for(truth)
    twists = np.array([[0.08, 0.05, 0.6], [0.08, -0.05, -0.5]])
    courses = [pushed(world, twist, 2e-4, k) for k, twist in enumerate(twists)]
    return truth, identify_pushes(stated, courses)


def test_a_border_moves_its_share_of_the_load_to_the_outline_and_tilts_move_the_centre() -> None:
    pressed = PressedOutline.from_outline(BOX)
    edge = pressed.edge > 0.0
    for border in (0.0, 0.3, 0.9):
        loads = pressed.loads(border, np.zeros(2))
        assert loads.sum() == pytest.approx(1.0)
        assert loads[edge].sum() == pytest.approx(border, abs=1e-4)
        assert loads @ pressed.points == pytest.approx(np.zeros(2), abs=1e-6)
    # Even pressure that grows by s over half the length h has its centre s h / 3 ahead.
    ahead = pressed.loads(0.0, np.array([0.4, 0.0])) @ pressed.points
    assert ahead == pytest.approx([0.4 * 0.05 / 3.0, 0.0], abs=1e-4)


def test_samples_follow_a_known_distribution(monkeypatch: pytest.MonkeyPatch) -> None:
    centre, size = np.array([0.3, 0.6, 0.5]), np.array([0.02, 0.05, np.inf])
    for name, value in {"MEMBERS": 80, "ROUNDS": 300, "ENOUGH": np.inf}.items():
        monkeypatch.setattr(f"pushplan.sim.identify.posterior.{name}", value)
    near = Near(centre, np.diag(1.0 / size**2))
    chains = sample(
        lambda places: -0.5 * (((places - centre) / size) ** 2).sum(axis=1), near, np.random.default_rng(3)
    )
    low, high = np.quantile(chains, [0.05, 0.95], axis=(0, 1))
    assert low == pytest.approx([0.3 - 1.645 * 0.02, 0.6 - 1.645 * 0.05, 0.05], abs=0.015)
    assert high == pytest.approx([0.3 + 1.645 * 0.02, 0.6 + 1.645 * 0.05, 0.95], abs=0.015)


def test_the_likelihood_is_that_of_dense_covariances() -> None:
    random = np.random.default_rng(5)
    groups, units = np.repeat([0, 1, 2], [4, 7, 2]), np.array([0.7, 0.2, 1.0])
    slopes, errors = random.normal(size=(13, 3)), random.normal(size=(2, 13))
    found = Likelihood.from_slopes(slopes, groups, units, 1.0)(errors)
    prior = np.log(np.gradient(SPREADS)) - SPREADS / USUAL
    for k, row in enumerate(errors):
        each = []
        for noise, (spread, before) in itertools.product(NOISES, zip(SPREADS, prior, strict=True)):
            value = before
            for g in range(3):
                e, slope = row[groups == g], slopes[groups == g] * units
                covariance = noise**2 * np.eye(len(e)) + spread**2 * slope @ slope.T
                square = e @ np.linalg.solve(covariance, e)
                value -= 0.5 * (np.linalg.slogdet(covariance)[1] + (TAILS + len(e)) * np.log1p(square / TAILS))
            each.append(value)
        assert found[k] == pytest.approx(logsumexp(each))


def test_the_truth_is_inside_and_friction_is_determined_where_contacts_slide(
    found: tuple[FloatArray, Identification],
) -> None:
    truth, identified = found
    plate, between, ratio = identified.estimates[:3]
    assert between.determined
    for value, one in zip(truth[:3], (plate, between, ratio), strict=True):
        assert one.low - 0.02 <= value <= one.high + 0.02, one
    assert between.high - between.low < 0.1
    assert identified.noise[0] == pytest.approx(2e-4, rel=0.15)


def test_a_plan_with_what_was_learned_holds_where_one_with_the_stated_numbers_slips(
    found: tuple[FloatArray, Identification],
) -> None:
    truth, identified = found
    stated = crates()
    piece = yaml.safe_load(yaml.safe_dump(piece_of(identified)))
    learned = scenario_from_document(with_learned(stated.resolved(), piece))
    possible = identified.samples[:: len(identified.samples) // 20]
    for scenario, holds in ((stated, False), (learned, True)):
        planned = plan(scenario, seed=1, first=True)
        real = pushplan.simulate(planned, identified.unknowns.world_for(truth))
        assert (real.kept, real.arrived(stated)) == (holds, holds)
        worlds = [identified.unknowns.world_for(values) for values in possible]
        kept = [pushplan.simulate(planned, world).kept for world in worlds]
        assert np.mean(kept) >= 0.9 if holds else not any(kept)


def test_poses_before_and_after_pushes_are_enough() -> None:
    """A camera that looks only while everything rests; contact friction is 0.25 instead of 0.55."""
    stated = World.from_chain(ChainMaker().boxes(1, pusher_friction=0.55))
    world = stated.with_contact_friction(0.25 / 0.55)
    pushes = []
    for k, twist in enumerate([[0.06, 0.05, 0.7], [0.06, -0.05, -0.6], [0.05, 0.06, 0.0], [0.05, -0.06, 0.2]]):
        whole = pushed(world, np.array(twist), 2e-4, k)
        rare = np.full_like(whole.object_poses, np.nan)
        rare[[0, -1]] = whole.object_poses[[0, -1]]
        pushes.append(MeasuredPush(whole.plate_poses, rare))
    one = identify_pushes(stated, pushes).estimates[0]
    assert one.determined
    assert one.low <= 0.25 <= one.high
    assert one.high - one.low < 0.1
    with pytest.raises(PushplanError, match="measured at 1 times; at least 2 are needed"):
        MeasuredPush(pushes[0].plate_poses, np.concatenate([rare[:1], np.full_like(rare[1:], np.nan)]))


def test_the_mean_force_is_that_of_all_pushes_in_any_direction() -> None:
    still, wrenches = np.zeros((3, 3)), np.array([[3.0, 4.0, 9.0], [0.0, -5.0, 1.0], [-5.0, 0.0, 2.0]])
    pushes = [MeasuredPush(still, np.zeros((3, 1, 3)), wrenches=force * wrenches) for force in (1.0, 2.0)]
    assert _mean_force(pushes) == pytest.approx(7.5)


def test_the_prior_of_loads_on_feet_is_uniform() -> None:
    """As of Dirichlet's distribution: equal means, and variances (k - 1) / (k^2 (k + 1))."""
    for k in (2, 3, 5):
        points = np.random.default_rng(k).random((4000, k - 1))
        loads = np.array([_broken_stick(one) for one in points])
        np.testing.assert_allclose(loads.sum(axis=1), 1.0)
        np.testing.assert_allclose(loads.mean(axis=0), 1.0 / k, atol=0.015)
        np.testing.assert_allclose(loads.var(axis=0), (k - 1) / (k**2 * (k + 1)), rtol=0.1)


def test_measured_forces_tell_the_size_of_floor_friction() -> None:
    """Stated floor friction is 0.3, in truth it is 0.48."""
    chain = ChainMaker().boxes(
        1, pusher_friction=0.5, support=lambda o: FeetSupport(0.9 * o, center_of_mass=np.zeros(2))
    )
    stated = World.from_chain(chain)
    unknowns = Unknowns.from_world(stated, absolute=True)
    parts = np.full(len(unknowns.each), 0.5)
    parts[0], parts[-1] = 0.3, np.log(0.48 / 0.3 / 0.25) / np.log(16.0)
    truth = unknowns.values(parts)
    world = unknowns.world_for(truth)
    assert world.chain.objects[0].floor_friction == pytest.approx(0.48)
    found = identify_pushes(stated, [pushed(world, np.array([0.08, 0.05, 0.6]), 2e-4, 0, 0.1)])
    size = found.estimates[-1]
    assert size.unknown.kind == "floor_friction"
    assert size.determined
    assert size.low <= 0.48 <= size.high
    assert size.median == pytest.approx(0.48, abs=0.02)
    low, high = piece_of(found)["objects"][0]["floor_friction"]
    assert low <= 0.48 <= high


def test_logs_with_slip_are_measured_pushes_and_logs_of_rigid_chains_are_not(tmp_path: Path) -> None:
    scenario = crates()
    course = moved(World.from_scenario(scenario), np.array([0.05, 0.02, 0.3]))
    with RunLogWriter.create(tmp_path / "slip.mcap", scenario, {}) as log:
        log.execution(course.execution)
        log.finish("arrived")
    _, read = read_push(tmp_path / "slip.mcap")
    np.testing.assert_array_equal(read.object_poses, course.objects)
    np.testing.assert_array_equal(there(read.wrenches), course.wrenches)
    with RunLogWriter.create(tmp_path / "none.mcap", scenario, {}) as log:
        log.finish("unsolved")
    with pytest.raises(RunLogError, match="the log holds no measured object poses"):
        pushplan.identify(tmp_path / "none.mcap")
    assert main(["identify", str(tmp_path / "none.mcap")]) == 2


def test_a_push_that_does_not_fit_the_world_is_refused() -> None:
    world = World.from_scenario(crates())
    still = np.zeros((5, 3))
    with pytest.raises(PushplanError, match="1 objects were measured; the chain has 2"):
        identify_pushes(world, [MeasuredPush(still, np.zeros((5, 1, 3)))])
    with pytest.raises(PushplanError, match="hardly moves"):
        identify_pushes(world, [MeasuredPush(still, np.zeros((5, 2, 3)))])
    with pytest.raises(PushplanError, match=r"wrenches of the plate has shape \(4, 3\)"):
        MeasuredPush(still, np.zeros((5, 2, 3)), wrenches=np.zeros((4, 3)))
    with pytest.raises(PushplanError, match="all measured forces are zero"):
        identify_pushes(world, [MeasuredPush(still, np.zeros((5, 2, 3)), wrenches=still)])
    with pytest.raises(PushplanError, match="at least 3 are needed"):
        MeasuredPush(still[:2], np.zeros((2, 2, 3)))
