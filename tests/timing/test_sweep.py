"""Touches of a timed motion against dense sampling with shapely."""

import numpy as np
import shapely
from conftest import ChainMaker

from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain, Limits
from pushplan.planners.scene import build_scene
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.planners.timing.sweep import Touches, find_touches, nudges
from pushplan.plans.path import PushPath, cost_rate
from pushplan.plans.trajectory import Trajectory
from pushplan.util.arrays import FloatArray

FREE = (-np.inf, -np.inf, np.inf, np.inf)
CLEARANCE = 1e-3


def _motion(seed: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(12, 3, 3)) * [0.3, 0.1, 1.0] * [[1.0], [1.0], [0.5]]
    return Trajectory(rng.normal(size=3), np.linspace(0.0, 2.4, 13), coefficients, np.zeros(12))


def _distances(chain: Chain, discs: FloatArray, trajectory: Trajectory, times: FloatArray) -> FloatArray:
    """Distance (m,) of the chain from the discs at times."""
    body = shapely.union_all([shapely.Polygon(moving.outline) for moving in chain.bodies])
    corners = shapely.get_coordinates(body)
    poses = trajectory.poses_at(times)
    placed = shapely.polygons(poses[:, None, :2] + se2.rotate(poses[:, 2:3], corners[None]))
    apart = [shapely.distance(placed, shapely.Point(x, y)) - r for x, y, r in discs]
    return np.asarray(np.min(apart, axis=0))


def test_touches_are_found_exactly_where_the_clearance_is_not_kept(make_chain: ChainMaker) -> None:
    chain, times, touched = make_chain.boxes(2), np.linspace(0.0, 2.4, 4001), 0
    for seed in range(20):
        rng, trajectory = np.random.default_rng(seed), _motion(seed)
        along = trajectory.poses_at(rng.uniform(0.0, 2.4, 3))
        discs = np.column_stack([along[:, :2] + rng.normal(size=(3, 2)) * 0.35, rng.uniform(0.02, 0.1, 3)])
        scene = build_scene(chain, [], [tuple(disc) for disc in discs], FREE, CLEARANCE)
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
    assert 4 < touched < 16


def test_a_thin_wall_between_two_samples_is_not_missed(make_chain: ChainMaker) -> None:
    """A needle that only the corner of the body passes over for a millimetre of the way."""
    chain = make_chain.boxes(1)
    straight = PushPath(np.zeros(3), np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
    trajectory = time_path(straight, Bounds(Limits()))
    needle = np.array([[0.5377, 0.0997], [0.53771, 0.3], [0.53769, 0.3]])
    scene = build_scene(chain, [needle], [], FREE, 1e-4)
    touches = find_touches(scene, trajectory, chain.reach)
    assert len(touches.times)
    np.testing.assert_allclose(trajectory.poses_at(touches.times)[:, 0] - 0.5377, 0.0, atol=0.04)


def test_nudges_move_the_pose_that_touches_by_what_is_missing(make_chain: ChainMaker) -> None:
    chain = make_chain.boxes(1)
    twists = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    path = PushPath(np.zeros(3), twists / cost_rate(twists)[:, None], np.array([0.3, 0.3, 0.3, 0.4]))
    scene = build_scene(chain, [], [(*path.poses_at([1.1])[0, :2] + [0.05, 0.1475], 0.05)], FREE, CLEARANCE)

    def touches_of(lengths: FloatArray) -> tuple[Trajectory, Touches]:
        trajectory = time_path(PushPath(path.start, path.twists, lengths), Bounds(Limits()))
        return trajectory, find_touches(scene, trajectory, chain.reach)

    trajectory, touches = touches_of(path.lengths)
    assert touches.gaps.min() < 0.0
    rows = nudges(scene, path, trajectory, path.lengths, touches, chain.reach)
    assert rows.matrix.shape == (1, 4)
    assert rows.matrix[0, 3] == 0.0
    change = np.linalg.pinv(rows.matrix) @ (rows.values - rows.matrix @ path.lengths)
    assert not len(touches_of(path.lengths + change)[1].times)
