"""Parts of the searches: controls, exact connections, lattice, bidirectional trees, and stopping conditions."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from conftest import there
from ompl import base as ob
from plans_of import load_plain
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.distance import cdist

from pushplan.core.collision import separations, sweep_is_free
from pushplan.core.problem import LEFT, RIGHT, Problem, find_words
from pushplan.core.search import Lattice, Tree
from pushplan.errors import EmptyStableSetError
from pushplan.geometry import se2
from pushplan.geometry.convex import flatten
from pushplan.mechanics.chain import Drive
from pushplan.planner import plan
from pushplan.planners.clearance import find_collision
from pushplan.planners.controls import control_segments, segment_ends, steering_families
from pushplan.planners.problem import build_problem, sampling_box
from pushplan.planners.search.bottlenecks import Extent
from pushplan.planners.search.planners import LatticeRounds, floor_of, middle_of
from pushplan.planners.search.session import Session, StopRule
from pushplan.plans.path import PushPath, cost_rate
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_plain("three-boxes-clutter")


@pytest.fixture(scope="module")
def problem(scenario: Scenario) -> Problem:
    return build_problem(scenario, scenario.stable_set())


def _session(problem: Problem, scenario: Scenario, seed: int = 1) -> Session:
    return Session(problem, scenario.start, StopRule(60.0, stall=10**9), seed)


def _searched(problem: Problem, scenario: Scenario, bound: float = math.inf) -> tuple[Lattice, float]:
    """Return a finished search and its bound."""
    session = _session(problem, scenario)
    lattice, over = LatticeRounds(session, sampling_box(scenario)).planted(2), False
    while not over:
        bound, over = lattice.expand(session.random, bound, 500)
    return lattice, bound


def check_branches(problem: Problem, nodes: FloatArray, rows: Iterable[int], back: int = 0) -> None:
    """Check that free arcs of the right cost join some nodes to their parents, forwards or backwards."""
    for node in nodes[list(rows)]:
        parent = nodes[int(node[4])]
        first, last = (node, parent) if back else (parent, node)
        assert max(se2.pose_error(se2.compose(first[:3], se2.exp(node[5:8] * node[8])), last[:3])) < 1e-9
        assert sweep_is_free(problem.scene, parent[:3], (1 - 2 * back) * node[5:8], node[8])
        assert node[3] == pytest.approx(parent[3] + node[8], abs=1e-9)


def test_every_branch_is_a_free_stable_arc(problem: Problem, scenario: Scenario) -> None:
    nodes = _searched(problem, scenario)[0].nodes
    assert len(nodes) > 50
    check_branches(problem, nodes, range(1, len(nodes)))
    assert scenario.stable_set().margin(nodes[1:, 5:8]).min() > 0.0


@pytest.mark.parametrize("name", ["three-boxes-clutter", "narrow-gap", "two-crates"])
def test_distances_on_the_floor_are_those_of_dijkstra(name: str) -> None:
    scenario = load_plain(name)
    problem = build_problem(scenario, scenario.stable_set())
    grid, away = floor_of(problem, sampling_box(scenario))
    shape = away.shape
    cells = np.indices(shape).reshape(2, -1).T
    point = problem.scene.with_body(flatten([1e-7 * np.array([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]])]), np.zeros(3))
    middles = np.column_stack([grid[:2] + grid[2] * (cells + 0.5), np.zeros(len(cells))])
    least = max(0.25 * Extent.of(problem).width, 0.71 * grid[2])
    room = separations(point, middles, 4.0 * least).reshape(shape)  # at least; near ones can have more
    floor = grid[2] * sum(shape)
    goal = se2.transform_points(problem.goal, middle_of(problem)[:2])
    free = away < floor  # no step to it is blocked
    expected = _dijkstra(free, grid[2], np.floor((goal - grid[:2]) / grid[2]).astype(int))
    np.testing.assert_allclose(away[free], expected[free], rtol=1e-9)
    assert free[room >= 2.0 * least].mean() > 0.98
    assert not free[room < 0.0].any()
    assert 0.3 < free.mean() < 1.0
    assert np.isfinite(away).all()


def _dijkstra(free: np.ndarray[Any, Any], cell: float, goal: np.ndarray[Any, Any]) -> FloatArray:
    """Return the lengths of the shortest paths to a cell along free cells and their diagonals."""
    cells = np.arange(free.size).reshape(free.shape)
    rows, columns, steps = [], [], []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = cells[: free.shape[0] - di, max(0, -dj) : free.shape[1] - max(0, dj)]
        there = cells[di:, max(0, dj) : free.shape[1] + min(0, dj)]
        both = free.ravel()[here] & free.ravel()[there]
        rows.append(here[both])
        columns.append(there[both])
        steps.append(np.full(both.sum(), cell * np.hypot(di, dj)))
    graph = coo_array(
        (np.concatenate(steps), (np.concatenate(rows), np.concatenate(columns))), (free.size, free.size)
    )
    found: Any = dijkstra(graph.tocsr(), directed=False, indices=int(cells[tuple(goal)]))  # type: ignore[call-overload]
    return np.asarray(found.reshape(free.shape))


@pytest.mark.parametrize("back", [False, True])
def test_trees_with_external_sampling_grow_by_free_arcs_and_join_exactly(back: bool) -> None:
    """Forwards or backwards; the joined path is free and stable from start to goal."""
    scenario = load_plain("narrow-gap")
    problem = build_problem(scenario, scenario.stable_set())
    rng, ends = np.random.default_rng(4), (scenario.start, problem.goal)
    tree, other = Tree(problem, ends[back], 0.3, back), Tree(problem, ends[not back], 0.3, not back)
    joined = 0
    for _ in range(1500):
        one, towards = (tree, other) if rng.random() < 0.7 else (other, tree)
        row, controls = int(rng.integers(len(one))), tuple(rng.random(3).tolist())
        size, before = len(one), one.path
        kept, cost, promise, *pose = one.extend(row, (0.0, 0.0, 0.0), controls, 12.0, towards)
        assert len(one) == size + kept
        if not kept or not cost < 12.0:
            assert (one.path is None) if before is None else np.array_equal(there(one.path), before)
            continue
        joined, path = joined + 1, there(one.path)
        np.testing.assert_allclose(one.nodes[-1, :3], pose, atol=1e-12)
        assert path[:, 3].sum() == pytest.approx(cost)
        assert promise <= cost
        whole = PushPath.of_arcs(scenario.start, path)
        assert max(se2.pose_error(whole.end, problem.goal)) < 1e-9
        assert find_collision(scenario, whole.sampled(0.01)) is None
        assert scenario.stable_set().margin(path[:, :3]).min() > 0.0
    assert joined > 5
    check_branches(problem, tree.nodes, range(1, len(tree)), back)
    with pytest.raises(ValueError, match="must grow back"):
        tree.extend(0, (0.0, 0.0, 0.0), (0.5, 0.5, 0.5), 1.0, Tree(problem, problem.goal, 0.3, back))


def _turning(cor: tuple[float, float], sense: float) -> FloatArray:
    twist = np.array([cor[1], -cor[0], 1.0]) * sense
    return np.asarray(twist / cost_rate(twist))


def _end(family: FloatArray, word: FloatArray, start: FloatArray) -> FloatArray:
    pose = start
    for letter, length in zip(word[1:4], word[4:7], strict=True):
        pose = se2.compose(pose, se2.exp(family[int(letter)] * length))
    return pose


@pytest.mark.parametrize("lean", [0.0, 0.3])
def test_every_steering_path_ends_on_the_goal(lean: float) -> None:
    rng = np.random.default_rng(4)
    checked = 0
    for _ in range(300):
        left = (rng.uniform(-0.2, 0.1), rng.uniform(0.2, 1.0))
        right = (rng.uniform(-0.2, 0.1), rng.uniform(-1.0, -0.2))
        family = np.array([_turning(left, 1.0), [np.cos(lean), np.sin(lean), 0.0], _turning(right, -1.0)])
        start, goal = rng.uniform(-2.0, 2.0, (2, 3))
        for word in find_words(family, start, goal):
            end = _end(family, word, start)
            assert np.abs(end[:2] - goal[:2]).max() < 1e-9
            assert abs(se2.wrap_angle(end[2] - goal[2])) < 1e-9
            assert (word[4:7] >= 0.0).all()
            checked += 1
    assert checked > 1000


def test_one_sided_turns_are_steered_by_wide_and_tight_arcs() -> None:
    rng, aside = np.random.default_rng(9), box("box", 0.2, 0.2, 1.0, offset=0.14)
    for goal in rng.uniform([-1.0, -1.0, -3.0], [2.0, 2.0, 3.0], (4, 3)):
        scenario = build_scenario("aside", [aside], plate(0.2, 0.3), np.round(goal, 3), floor_friction=0.3)
        found = plan(scenario, first=True, iterations=200_000, time_limit=600.0)
        assert found.path is not None
        assert found.path.twists[:, 2].min() > 0.0


def test_the_shortest_steering_path_of_a_symmetric_car_is_dubins_path() -> None:
    """The oracle is OMPL's Dubins space; with CORs at (0, +-R) turning costs (R + 0.1) per radian here."""
    rng = np.random.default_rng(5)
    radius = 0.7
    family = np.array([_turning((0.0, radius), 1.0), [1.0, 0.0, 0.0], _turning((0.0, -radius), -1.0)])
    travel = np.array([radius / (radius + 0.1), 1.0, radius / (radius + 0.1)])
    space = ob.DubinsStateSpace(radius)
    bounds = ob.RealVectorBounds(2)
    bounds.setLow(-10.0)
    bounds.setHigh(10.0)
    space.setBounds(bounds)
    a, b = space.allocState(), space.allocState()
    for _ in range(300):
        start, goal = rng.uniform(-3.0, 3.0, (2, 3))
        for state, pose in ((a, start), (b, goal)):
            state.setX(pose[0])
            state.setY(pose[1])
            state.setYaw(float(se2.wrap_angle(pose[2])))
        words = find_words(family, start, goal)
        shortest = min(word[4:7] @ travel[word[1:4].astype(int)] for word in words)
        assert shortest == pytest.approx(space.distance(a, b), abs=1e-7)


AXLE = np.array([-0.25, 0.02, 0.0])
DRIVES = [Drive(), Drive("differential", AXLE), Drive("car", AXLE, min_radius=0.8)]


@pytest.fixture(scope="module")
def stable(make_chain: Any) -> StableSet:
    return stable_set(make_chain.boxes(3, size=(0.1, 0.2)), "ecof")


def _sideways(twists: FloatArray) -> FloatArray:
    """Return the lateral speed (k,) of the axle's midpoint per unit of its forward speed."""
    ahead = twists[:, 0] - twists[:, 2] * AXLE[1]
    return np.asarray((twists[:, 1] + twists[:, 2] * AXLE[0]) / ahead)


def _check_drive(drive: Drive, twists: FloatArray) -> None:
    if drive.kind != "omnidirectional":
        assert np.abs(_sideways(twists)).max() < 1e-12
        assert (twists[:, 0] - twists[:, 2] * AXLE[1] > 0.0).all()
    if drive.kind == "car":
        ahead = twists[:, 0] - twists[:, 2] * AXLE[1]
        assert (np.abs(twists[:, 2]) * drive.min_radius <= ahead * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("drive", DRIVES, ids=lambda drive: drive.kind)
@pytest.mark.parametrize("margin", [1e-6, 0.05])
def test_all_twists_of_a_segment_are_stable_and_drivable(stable: StableSet, drive: Drive, margin: float) -> None:
    segments = control_segments(stable, drive, margin)
    rng = np.random.default_rng(0)
    for b in (0.0, 1.0, rng.uniform(0.0, 1.0, (len(segments), 1))):
        twists = (1.0 - b) * segments[:, :3] + b * segments[:, 3:]
        assert stable.margin(twists).min() > margin * (1.0 - 1e-6)
        _check_drive(drive, twists)


def test_a_drive_that_cannot_push_stably_is_refused_with_the_reason(stable: StableSet) -> None:
    sideways = Drive("differential", np.array([-0.25, 0.0, np.pi / 2]))
    with pytest.raises(
        EmptyStableSetError, match="the differential cannot push the chain: its best push keeps 'box2' on 'box1'"
    ):
        control_segments(stable, sideways, 1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_twist_families_use_the_two_closest_centres(seed: int) -> None:
    """Of all pairs of a left and a right turn, for any centres."""
    segments = np.random.default_rng(seed).normal(size=(60, 6)) * [1.0, 0.3, 1.0, 1.0, 0.3, 1.0]
    turns = segment_ends(segments)
    centres = np.stack([-turns[:, 1], turns[:, 0]], axis=1) / turns[:, 2:]
    sides = [centres[sign * turns[:, 2] > 0.0] for sign in (1.0, -1.0)]
    left, right = steering_families(segments)[0, [LEFT, RIGHT]]
    apart = [-left[1] / left[2] + right[1] / right[2], left[0] / left[2] - right[0] / right[2]]
    assert np.hypot(*apart) == pytest.approx(cdist(sides[0], sides[1]).min(), rel=1e-12)
