"""The sum of smooth steps, bounds on its motion, and the area that it sweeps over."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import ChainMaker, there
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from timing.conftest import use_by_differences

import pushplan.core.timing as timing
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain, Limits
from pushplan.planner import plan
from pushplan.planners.scene import build_scene
from pushplan.planners.timing.exact_timing import Pieces, limit_use
from pushplan.planners.timing.profiles import step_windows
from pushplan.planners.timing.sweep import find_touches, off_chords
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import load_scenario
from pushplan.util.arrays import FloatArray


def _at(pieces: Pieces, times: FloatArray) -> FloatArray:
    """Return the values (m, 3) of the twist at times from its beginning."""
    begins = np.concatenate([[0.0], np.cumsum(pieces.durations)])
    index = np.clip(np.searchsorted(begins, times, side="right") - 1, 0, len(pieces.durations) - 1)
    tau = (times - begins[index])[:, None]
    c = pieces.coefficients[index]
    return np.asarray(c[:, 0] + tau * (c[:, 1] + tau * c[:, 2]))


def _random(seed: int, steps: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    levels = np.concatenate([np.zeros((1, 3)), rng.normal(size=(steps - 1, 3)), np.zeros((1, 3))])
    centers = np.cumsum(rng.exponential(0.3, steps))
    long = rng.uniform(0.05, 0.6, steps)
    widths = np.column_stack([long, long * rng.uniform(0.1, 1.0, steps)])
    which, bounds = timing.wider_steps(centers, widths)
    widths[which] = step_windows(bounds)
    return levels, centers, widths


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.integers(2, 12))
def test_the_sum_stays_in_the_hull_of_its_levels(seed: int, steps: int) -> None:
    levels, centers, widths = _random(seed, steps)
    pieces = Pieces.through(levels, centers, widths)
    values = _at(pieces, np.linspace(0.0, float(pieces.durations.sum()), 400))
    directions = np.random.default_rng(seed).normal(size=(30, 3))
    assert ((values @ directions.T) <= (levels @ directions.T).max(axis=0) + 1e-9).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_step_between_equal_levels_changes_nothing(seed: int) -> None:
    levels, centers, widths = _random(seed, 6)
    k = 2 + seed
    pieces = Pieces.through(levels, centers, widths)
    more = np.insert(levels, k, levels[k], axis=0), np.insert(centers, k, centers[k - 1 : k + 1].mean())
    same = Pieces.through(*more, np.insert(widths, k, 0.1, axis=0))
    times = np.linspace(0.0, float(pieces.durations.sum()), 400)
    assert float(same.durations.sum()) == pytest.approx(times[-1])
    np.testing.assert_allclose(_at(same, times), _at(pieces, times), atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_the_motion_agrees_with_an_ode_solver(seed: int) -> None:
    pieces = Pieces.through(*_random(seed, 5))

    def rate(t: float, pose: FloatArray) -> list[float]:
        vx, vy, omega = _at(pieces, np.array([t]))[0]
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return [c * vx - s * vy, s * vx + c * vy, omega]

    end = float(pieces.durations.sum())
    solved = solve_ivp(rate, (0.0, end), np.zeros(3), rtol=1e-10, atol=1e-11, max_step=0.02)
    np.testing.assert_allclose(pieces.motion, solved.y[:, -1], atol=2e-7)


LIMITS = Limits(0.3, 0.7, 3.0, 1.5, 2.5, 30.0)


@pytest.mark.parametrize("seed", range(8))
def test_bounds_hold_and_are_tight_on_short_pieces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(1, 3, 3)) * [[1.0, 1.0, 3.0]] * [[1.0], [2.0], [5.0]]
    duration = 0.02
    trajectory = Trajectory(np.zeros(3), np.array([0.0, duration]), coefficients, np.zeros(1))
    pieces = Pieces(np.array([duration]), coefficients, np.zeros(1, dtype=np.int64))
    share = use_by_differences(trajectory, LIMITS, 1e-3) / limit_use(pieces, LIMITS)[0]
    assert (share <= 1.0 + 1e-3).all()
    assert (share >= 0.9).all()


@pytest.fixture(scope="module")
def motion() -> Trajectory:
    return there(plan(load_scenario("two-crates"), first=True, time_limit=600.0).trajectory)


def _away(share: float, begin: FloatArray, end: FloatArray, points: FloatArray, placed: FloatArray) -> float:
    pose = se2.between(begin, end, share)
    return float(np.hypot(*(se2.transform_points(pose, points) - placed).T).max())


def test_between_samples_the_body_stays_near_the_constant_twist(motion: Trajectory) -> None:
    reach, rate = 0.4, 20.0
    trajectory = replace(motion, rate=rate)
    turn = 2.0 * np.pi * np.arange(8) / 8
    points = np.vstack([[0.0, 0.0], reach * np.stack([np.cos(turn), np.sin(turn)], axis=1)])
    poses, between = trajectory.poses, trajectory.poses_at(trajectory.t[:-1] + 0.5 / rate)
    worst = 0.0
    for begin, middle, end in zip(poses[:-2], between, poses[1:-1], strict=False):
        placed = se2.transform_points(middle, points)
        found = minimize_scalar(
            _away, args=(begin, end, points, placed), bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-7}
        )
        worst = max(worst, float(found.fun))
    assert 1e-6 < worst < off_chords(trajectory, reach)


FREE = (-np.inf, -np.inf, np.inf, np.inf)
CLEARANCE = 1e-3


def _motion(seed: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(12, 3, 3)) * [0.3, 0.1, 1.0] * [[1.0], [1.0], [0.5]]
    return Trajectory(rng.normal(size=3), np.linspace(0.0, 2.4, 13), coefficients, np.zeros(12))


def _distances(chain: Chain, discs: FloatArray, trajectory: Trajectory, times: FloatArray) -> FloatArray:
    """Return the distances (m,) of the chain from the discs at some times."""
    body = shapely.union_all([shapely.Polygon(moving.outline) for moving in chain.bodies])
    corners = shapely.get_coordinates(body)
    poses = trajectory.poses_at(times)
    placed = shapely.polygons(poses[:, None, :2] + se2.rotate(poses[:, 2:3], corners[None]))
    apart = [shapely.distance(placed, shapely.Point(x, y)) - r for x, y, r in discs]
    return np.asarray(np.min(apart, axis=0))


def test_touches_are_found_exactly_where_the_clearance_is_not_kept(make_chain: ChainMaker) -> None:
    chain, times, touched = make_chain.boxes(2), np.linspace(0.0, 2.4, 4001), 0
    for seed in range(10):
        rng, trajectory = np.random.default_rng(seed), _motion(seed)
        along = trajectory.poses_at(rng.uniform(0.0, 2.4, 3))
        discs = np.column_stack([along[:, :2] + rng.normal(size=(3, 2)) * 0.35, rng.uniform(0.02, 0.1, 3)])
        scene = build_scene(chain, [], np.asarray(discs), FREE, CLEARANCE)
        touches = find_touches(scene, trajectory, chain.reach)
        least = _distances(chain, discs, trajectory, times).min()
        if not 0.9 * CLEARANCE < least < 1.1 * CLEARANCE:
            assert bool(len(touches.times)) == (least < CLEARANCE), seed
        found = _distances(chain, discs, trajectory, touches.times) if len(touches.times) else np.zeros(0)
        assert (found < CLEARANCE + 1e-9).all()
        outside = touches.gaps > 0.0
        np.testing.assert_allclose(touches.gaps[outside], found[outside], atol=1e-9)
        assert (np.diff(touches.times) >= 0.0).all()
        touched += bool(len(touches.times))
    assert 1 < touched < 9


def test_tables_of_another_shape_are_refused() -> None:
    levels, centers, widths = np.zeros((3, 3)), np.array([0.5, 1.0]), np.full((2, 2), 0.1)
    timing.step_sum(levels, centers, widths)
    for wrong in (widths[:1], widths[:, :1], np.full((2, 3), 0.1)):
        with pytest.raises(ValueError, match=r"widths must be \(m, 2\)"):
            timing.step_sum(levels, centers, wrong)
    for other in (levels[:2], levels[:, :2]):
        with pytest.raises(ValueError, match=r"levels must be \(m \+ 1, 3\)"):
            timing.step_sum(other, centers, widths)
