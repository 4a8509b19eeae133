"""The collision check against shapely: distances, overlaps, sweeps."""

import time
from collections.abc import Sequence

import numpy as np
import pytest
import shapely

from pushplan.core import collision, problem
from pushplan.core.collision import Scene, separation, sweep_is_free
from pushplan.errors import OutOfTimeError
from pushplan.geometry import se2
from pushplan.planners.scene import convex_pieces, scene_of
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

INFINITE = np.array([-np.inf, -np.inf, np.inf, np.inf])


def _convex(rng: np.random.Generator, size: float) -> FloatArray:
    points = rng.normal(size=(rng.integers(3, 9), 2)) * size * rng.uniform(0.05, 1.0, 2)
    hull = shapely.orient_polygons(shapely.MultiPoint(points).convex_hull)
    return shapely.get_coordinates(hull)[:-1]


def _scene(
    body: list[FloatArray],
    obstacles: list[FloatArray],
    circles: list[list[float]] | None = None,
    walls: FloatArray = INFINITE,
) -> Scene:
    discs = np.array(circles or [], dtype=np.float64).reshape(-1, 3)
    return scene_of(body, obstacles, discs, walls, 5e-4)


def _distance(body: list[FloatArray], standing: Sequence[shapely.Geometry], poses: FloatArray) -> float:
    """Return the least distance of a body at any of the poses (..., 3)."""
    at = poses.reshape(-1, 1, 3)
    placed = [shapely.polygons(at[..., :2] + se2.rotate(at[..., 2], piece[None])) for piece in body]
    return min(float(shapely.distance(some, other).min()) for some in placed for other in standing)


def _separation(scene: Scene, pose: FloatArray) -> float:
    return float(separation(scene, pose[0], pose[1], pose[2], 10.0))


def test_separation_is_a_lower_bound_and_exact_when_near() -> None:
    rng = np.random.default_rng(1)
    near = overlaps = 0
    for _ in range(500):
        body = [_convex(rng, 0.1), _convex(rng, 0.1) + 0.1]
        obstacles = [_convex(rng, 0.2) + rng.uniform(-0.6, 0.6, 2) for _ in range(3)]
        disc = [*rng.uniform(-0.6, 0.6, 2), rng.uniform(0.01, 0.2)]
        pose = rng.uniform(-0.5, 0.5, 3) * [1, 1, 6]
        standing = [*map(shapely.Polygon, obstacles)]
        exact = _distance(body, standing, pose)
        exact = min(exact, _distance(body, [shapely.Point(disc[:2])], pose) - disc[2])
        found = _separation(_scene(body, obstacles, [disc]), pose)
        if exact > 0.0:
            assert found <= exact + 1e-12
            if found < 0.01:
                assert found == pytest.approx(exact, abs=1e-12)
                near += 1
        else:
            assert found <= 1e-12
            overlaps += 1
    assert near > 5
    assert overlaps > 60


def test_the_core_counts_as_the_rest_does() -> None:
    assert collision.CLEARANCE_ROOM == CLEARANCE_ROOM
    assert problem.TURN_WEIGHT == TURN_WEIGHT


def test_walls_bound_the_body() -> None:
    square = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.0, 0.1]])
    scene = _scene([square], [], walls=np.array([0.0, 0.0, 1.0, 1.0]))
    assert separation(scene, 0.3, 0.05, 0.0, 10.0) == pytest.approx(0.05)
    assert separation(scene, 0.9, 0.5, 0.0, 10.0) == pytest.approx(-0.1)
    assert separation(scene, 0.5, 0.5, np.pi / 2, 10.0) == pytest.approx(0.3)


def test_a_free_sweep_never_comes_close_and_a_refused_one_does() -> None:
    rng = np.random.default_rng(2)
    free = refused = 0
    for _ in range(150):
        body = [_convex(rng, 0.08), _convex(rng, 0.08) + np.array([0.1, 0.0])]
        obstacles = [_convex(rng, 0.1) + rng.uniform(-0.6, 0.6, 2) for _ in range(2)]
        twist = np.append(rng.normal(size=2), rng.normal() * 3.0)
        pose = rng.uniform(-0.5, 0.5, 3) * [1, 1, 6]
        length = rng.uniform(0.0, 0.5)
        standing = [*map(shapely.Polygon, obstacles)]
        along = se2.compose(pose, se2.exp(twist * np.linspace(0.0, length, 300)[:, None]))
        nearest = _distance(body, standing, along)
        x, y, theta, vx, vy, omega = np.concatenate([pose, twist])
        if sweep_is_free(_scene(body, obstacles), x, y, theta, vx, vy, omega, length):
            assert nearest >= 5e-4 - 1e-9
            free += 1
        else:
            assert nearest < 5e-4 + 2e-3 * np.linalg.norm(twist)
            refused += 1
    assert min(free, refused) > 20


def test_a_ragged_polygon_is_cut_into_convex_pieces_that_cover_it_exactly() -> None:
    rng = np.random.default_rng(6)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 3000))
    radii = 3.0 + 0.1 * rng.normal(size=3000)
    outline = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)[::-1]
    pieces = [shapely.Polygon(piece) for piece in convex_pieces([outline])]
    assert shapely.union_all(pieces).symmetric_difference(shapely.Polygon(outline)).area < 1e-12
    assert sum(piece.area for piece in pieces) == pytest.approx(shapely.Polygon(outline).area, rel=1e-12)
    assert all(piece.convex_hull.area <= piece.area * (1.0 + 1e-9) for piece in pieces)
    assert all(piece.exterior.is_ccw for piece in pieces)


def test_cutting_up_stops_when_the_time_is_over() -> None:
    concave = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]])
    with pytest.raises(OutOfTimeError, match="the time limit ended while the problem was posed"):
        list(convex_pieces([concave], until=time.perf_counter()))
