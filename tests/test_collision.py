"""Collisions: distances and sweeps of the core, the independent checker and the clearance, against shapely."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import there

from pushplan.core import collision, problem
from pushplan.core.collision import SLACK, Scene, separations, sweep_is_free
from pushplan.geometry import se2
from pushplan.geometry.convex import convex_pieces
from pushplan.planner import plan
from pushplan.planners.clearance import SPACING, Motion, Moving, Room, Standing, find_collision, find_collisions
from pushplan.planners.problem import scenario_scene
from pushplan.planners.scene import scene_of
from pushplan.plans.path import TURN_WEIGHT
from pushplan.scenario.file import load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle, PolygonObstacle
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

INFINITE = np.array([-np.inf, -np.inf, np.inf, np.inf])


def _convex(rng: np.random.Generator, size: float) -> FloatArray:
    points = rng.normal(size=(rng.integers(3, 9), 2)) * size * rng.uniform(0.05, 1.0, 2)
    hull = shapely.orient_polygons(shapely.MultiPoint(points).convex_hull)
    return shapely.get_coordinates(hull)[:-1]


def _scene(body: list[FloatArray], obstacles: list[FloatArray], circles: Sequence[list[float]] = ()) -> Scene:
    return scene_of(body, obstacles, np.array(circles, dtype=np.float64).reshape(-1, 3), INFINITE, 5e-4)


def _distance(body: list[FloatArray], standing: Sequence[shapely.Geometry], poses: FloatArray) -> float:
    """Return the smallest distance of a body at the poses (..., 3)."""
    at = poses.reshape(-1, 1, 3)
    placed = [shapely.polygons(at[..., :2] + se2.rotate(at[..., 2], piece[None])) for piece in body]
    return min(float(shapely.distance(some, other).min()) for some in placed for other in standing)


def test_separation_is_a_lower_bound_and_exact_when_near() -> None:
    rng = np.random.default_rng(1)
    near = overlaps = 0
    for _ in range(200):
        body = [_convex(rng, 0.1), _convex(rng, 0.1) + 0.1]
        obstacles = [_convex(rng, 0.2) + rng.uniform(-0.6, 0.6, 2) for _ in range(3)]
        disc = [*rng.uniform(-0.6, 0.6, 2), rng.uniform(0.01, 0.2)]
        pose = rng.uniform(-0.5, 0.5, 3) * [1, 1, 6]
        standing = [*map(shapely.Polygon, obstacles)]
        exact = _distance(body, standing, pose)
        exact = min(exact, _distance(body, [shapely.Point(disc[:2])], pose) - disc[2])
        found = separations(_scene(body, obstacles, [disc]), pose[None], 10.0)[0]
        if exact > 0.0:
            assert found <= exact + 1e-12
            if found < 0.01:
                assert found == pytest.approx(exact, abs=1e-12)
                near += 1
        else:
            assert found <= 1e-12
            overlaps += 1
    assert near > 1
    assert overlaps > 20


def test_the_core_uses_the_same_constants() -> None:
    assert collision.CLEARANCE_ROOM == CLEARANCE_ROOM
    assert problem.TURN_WEIGHT == TURN_WEIGHT


def test_free_sweeps_keep_the_clearance_and_refused_ones_do_not() -> None:
    rng = np.random.default_rng(2)
    free = refused = 0
    for _ in range(70):
        body = [_convex(rng, 0.08), _convex(rng, 0.08) + np.array([0.1, 0.0])]
        obstacles = [_convex(rng, 0.1) + rng.uniform(-0.6, 0.6, 2) for _ in range(2)]
        twist = np.append(rng.normal(size=2), rng.normal() * 3.0)
        pose = rng.uniform(-0.5, 0.5, 3) * [1, 1, 6]
        length = rng.uniform(0.0, 0.5)
        standing = [*map(shapely.Polygon, obstacles)]
        along = se2.compose(pose, se2.exp(twist * np.linspace(0.0, length, 300)[:, None]))
        nearest = _distance(body, standing, along)
        if sweep_is_free(_scene(body, obstacles), pose, twist, length):
            assert nearest >= 5e-4 - 1e-9
            free += 1
        else:
            assert nearest < 5e-4 + 2e-3 * np.linalg.norm(twist)
            refused += 1
    assert min(free, refused) > 10


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


SQUARE = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
BODY = [np.array([0.3, 0.2]) * SQUARE, np.array([0.3, 0.0]) + 0.2 * SQUARE]
WALLS = np.array([0.0, 0.0, 20.0, 20.0])


def _world(rng: np.random.Generator, count: int) -> tuple[list[FloatArray], FloatArray]:
    """Return quadrangles and discs of very different sizes, with a long wall."""
    n = count // 2
    places, sizes = rng.uniform(0.0, 20.0, (count, 2)), rng.uniform(0.05, 0.3, (count, 2))
    polygons = [SQUARE * size + place for size, place in zip(sizes[:n], places[:n], strict=True)]
    polygons[0] = SQUARE * [0.05, 12.0] + 10.0
    return polygons, np.column_stack([places[n:], 0.5 * sizes[n:, 0]])


@pytest.mark.parametrize("count", [2, 9, 40, 1000])
def test_the_tree_does_not_change_results(count: int) -> None:
    rng = np.random.default_rng(count)
    scene = scene_of(BODY, *_world(rng, count), WALLS, 5e-4)
    leaf = np.array([[*scene.tree[0, :4], 1, 0, len(scene.obstacles.bounds), 0, len(scene.circles)]])
    brute = scene.with_obstacles(scene.obstacles, scene.circles, leaf, WALLS)
    free = blocked = 0
    for _ in range(800):
        pose = rng.uniform(0.3, 19.7, 3)
        ours, theirs = (float(separations(world, pose[None], 1.0)[0]) for world in (scene, brute))
        assert (ours <= 0.0) == (theirs <= 0.0)
        if 0.0 < min(ours, theirs) < 0.01:
            assert ours == pytest.approx(theirs, abs=1e-12)
        twist = rng.normal(size=3)
        sweeps = [sweep_is_free(world, pose, twist, 0.3) for world in (scene, brute)]
        assert sweeps[0] == sweeps[1]
        free, blocked = free + sweeps[0], blocked + (not sweeps[0])
    assert min(free, blocked) > 5


TEXT = """
format: pushplan/1
name: lane
floor: {friction: 0.3}
objects:
  - {name: box, shape: {box: [0.1, 0.1]}, mass: 1.0, support: uniform}
contacts: {friction: 0.3}
pusher: {width: 0.3, thickness: 0.02, friction: 0.4}
start: [0.0, 0.0, 0.0]
goal: {pose: [1.0, 0.0, 0.0]}
workspace: {x: [-0.5, 1.5], y: [-0.5, 0.5]}
obstacles:
  - {box: [0.002, 0.1], pose: [0.5, 0.17, 0.0]}
  - {circle: 0.05, center: [0.8, -0.11]}
"""


@pytest.fixture
def lane() -> Scenario:
    return scenario_from_text(TEXT, "lane.yaml")


def test_a_violated_clearance_is_a_collision_with_its_gap(lane: Scenario) -> None:
    poses = np.array([[0.6, -0.008, 0.0], [0.7, -0.008, 0.0]])
    assert find_collision(lane, poses) is None
    found = there(find_collision(replace(lane, clearance=0.003), poses))
    assert (found.body, found.obstacle) == ("box", lane.obstacles[1])
    assert found.gap == pytest.approx(0.003, abs=SPACING)
    assert "'box' is 2" in str(found)
    assert f"mm from {lane.obstacles[1]} with the chain frame at (0." in str(found)


def test_few_poses_find_the_same_collisions_as_many(lane: Scenario) -> None:
    """A motion that the distances prove free is free at poses every half millimetre."""
    rng = np.random.default_rng(4)
    free = blocked = 0
    for _ in range(60):
        poses = np.cumsum(rng.normal(size=(6, 3)) * [0.08, 0.05, 0.2], axis=0)
        poses[:, 0] += 0.3
        found = find_collision(lane, poses)
        motion = Motion.through(poses, lane.chain.reach)
        dense = motion.at(np.append(np.arange(0.0, motion.travel[-1], 5e-4), motion.travel[-1]))
        gaps = Room.of(lane).gaps(dense, 0.1)
        near = np.flatnonzero(gaps < lane.clearance - CLEARANCE_ROOM)
        if found is None:
            assert not len(near) or gaps.min() > lane.clearance - CLEARANCE_ROOM - SPACING
            free += 1
        else:
            travel = Motion.through(dense, lane.chain.reach).travel
            at = travel[np.argmin(np.abs(dense - found.pose).sum(axis=1))]
            assert travel[near[0]] - 1e-3 <= at <= travel[near[0]] + SPACING + 1e-3
            blocked += 1
    assert min(free, blocked) > 10


def test_motions_checked_together_collide_as_each_alone(lane: Scenario) -> None:
    """Some bodies rest in some motions only, and the moving bodies differ."""
    rng, hits = np.random.default_rng(7), 0
    square = 0.03 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for _ in range(20):
        resting = tuple(PolygonObstacle(square + rng.uniform([-0.2, -0.3], [1.2, 0.3])) for _ in range(4))
        rests = rng.random((5, 4)) < 0.5
        bodies = [lane.chain.bodies if moving else lane.chain.carried for moving in rng.random(5) < 0.5]
        starts, steps = rng.uniform([-0.2, -0.3, -3.0], [1.2, 0.3, 3.0], (5, 3)), rng.normal(size=(5, 4, 3))
        paths = [start + 0.1 * np.cumsum(step, axis=0) for start, step in zip(starts, steps, strict=True)]
        motions = [Motion.through(path, lane.chain.reach) for path in paths]
        room = Room(
            tuple(Moving.of(moving) for moving in bodies),
            lane.workspace,
            Standing.of(lane.obstacles),
            Standing.of(resting),
            rests,
        )
        for k, found in enumerate(find_collisions(room, motions, lane.clearance)):
            around = (*lane.obstacles, *(one for one, there in zip(resting, rests[k], strict=True) if there))
            alone = Room((Moving.of(bodies[k]),), lane.workspace, Standing.of(around))
            (expected,) = find_collisions(alone, motions[k : k + 1], lane.clearance)
            assert (found is None) == (expected is None)
            if found is not None and expected is not None:
                assert found.pose == pytest.approx(expected.pose, abs=3.0 * SPACING)
                assert found.obstacle in (None, *around)
                hits += found.obstacle in resting
    assert hits > 10


def gaps_of(scenario: Scenario, poses: FloatArray) -> FloatArray:
    """Return the distance (m,) of the nearest obstacle at each pose (m, 3), m."""
    gaps = np.full(len(poses), np.inf)
    for body in scenario.chain.bodies:
        placed = shapely.polygons(poses[:, None, :2] + se2.rotate(poses[:, 2:3], body.outline[None]))
        for one in scenario.obstacles:
            if isinstance(one, CircleObstacle):
                apart = shapely.distance(placed, shapely.Point(one.center)) - one.radius
            else:
                apart = shapely.distance(placed, shapely.Polygon(one.outline))
            gaps = np.minimum(gaps, apart)
    return gaps


@pytest.mark.parametrize("name", ["three-boxes-clutter", "asymmetric", "carts", "hook"])
def test_gaps_are_the_distances_of_all_bodies_up_to_a_limit(name: str) -> None:
    scenario, enough = load_scenario(name), 0.3
    walls = there(scenario.workspace)
    low, high = np.array([walls.xmin, walls.ymin]), np.array([walls.xmax, walls.ymax])
    poses = np.random.default_rng(2).uniform([*low, -4.0], [*high, 4.0], (40, 3))
    outlines = np.concatenate([body.outline for body in scenario.chain.bodies])
    corners = poses[:, None, :2] + se2.rotate(poses[:, 2:3], outlines[None])
    room = np.minimum(corners - low, high - corners).min(axis=(1, 2))
    expected = np.clip(np.minimum(gaps_of(scenario, poses), room), 0.0, enough)
    np.testing.assert_allclose(Room.of(scenario).gaps(poses, enough), expected, atol=1e-12)


@pytest.mark.parametrize(("clearance", "trajectory"), [(0.0005, "exact"), (0.006, "blended")])
def test_paths_keep_the_clearance_and_reach_it(clearance: float, trajectory: str) -> None:
    scenario = replace(load_scenario("narrow-gap"), clearance=clearance, trajectory=trajectory)
    result = plan(scenario, time_limit=60.0, iterations=2_000)
    assert result.solved, result.reason
    poses = np.concatenate([there(result.path).sampled(1e-4), there(result.trajectory).poses])
    gap = float(gaps_of(scenario, poses).min())
    assert gap >= clearance - 1e-9
    assert gap < clearance + 0.02


def test_a_start_exactly_at_the_clearance_can_be_left(lane: Scenario) -> None:
    """The plate's end passes along the obstacle: the first half of the straight push keeps the same distance."""
    for gap in (0.01, 0.01 + 5e-5, 0.02):
        wall = PolygonObstacle(SQUARE * [0.4, 0.1] + [0.2, 0.2 + gap])
        scenario = replace(lane, clearance=0.01, obstacles=(wall,))
        scene = scenario_scene(scenario)
        assert 0.01 - CLEARANCE_ROOM - 1e-8 <= scene.kept <= 0.01
        assert scene.clearance == pytest.approx(min(gap, 0.01 + SLACK), abs=1e-8)
        result = plan(scenario, time_limit=60.0, first=True)
        assert result.solved, result.reason
        assert gaps_of(scenario, there(result.path).sampled(1e-4)).min() >= 0.01 - CLEARANCE_ROOM - 1e-8
