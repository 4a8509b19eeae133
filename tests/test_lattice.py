"""Best-first search over cells keeps its promises: free arcs, the cheapest node in a cell, bounds, true distances."""

import math
from typing import Any

import numpy as np
import pytest
from plain import load_plain, plain
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from pushplan.core.collision import sweep_is_free
from pushplan.core.problem import Problem, poses_along
from pushplan.core.search import Lattice
from pushplan.geometry import se2
from pushplan.planners.problem import build_problem, sampling_box
from pushplan.planners.search.planners import LatticeRounds, distances_to, middle_of
from pushplan.planners.search.session import Budget, Session, path_from
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

TWO_PASSAGES = """
format: pushplan/1
floor: {friction: 0.3}
objects: [{name: box, shape: {box: [0.1, 0.1]}, mass: 1.0}]
contacts: {friction: 0.3}
pusher: {width: 0.2, friction: 0.5}
start: [0.0, 0.0, 0.0]
goal: {pose: [3.0, 0.0, 0.0]}
workspace: {x: [-0.5, 3.5], y: [-1.5, 1.5]}
obstacles: [{box: [0.5, 2.0], pose: [1.5, LOWER, 0.0]}]
"""


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_plain("three-boxes-clutter")


@pytest.fixture(scope="module")
def problem(scenario: Scenario) -> Problem:
    return build_problem(scenario, scenario.stable_set())


def _session(problem: Problem, scenario: Scenario, seed: int = 1) -> Session:
    return Session(problem, scenario.start, Budget(60.0, stall=10**9), seed)


def _searched(
    problem: Problem, scenario: Scenario, back: int, bound: float = math.inf
) -> tuple[Lattice, float]:
    """Return a search that is over, and its bound then."""
    session = _session(problem, scenario)
    lattice, over = LatticeRounds(session, sampling_box(scenario)).planted(2, back), False
    while not over:
        bound, over = lattice.expand(session.random, bound, 500)
    return lattice, bound


@pytest.mark.parametrize("back", [0, 1])
def test_every_branch_is_a_free_stable_arc(problem: Problem, scenario: Scenario, back: int) -> None:
    nodes = _searched(problem, scenario, back)[0].nodes
    assert len(nodes) > 100
    for node in nodes[1:]:
        parent = nodes[int(node[4])]
        first, last = (node, parent) if back else (parent, node)
        end = se2.compose(first[:3], se2.exp(node[5:8] * node[8]))
        np.testing.assert_allclose(last[:2], end[:2], atol=1e-9)
        assert abs(se2.wrap_angle(last[2] - end[2])) < 1e-9
        assert sweep_is_free(problem.scene, *[*parent[:3], *((1 - 2 * back) * node[5:8]), node[8]])
        assert node[3] == pytest.approx(parent[3] + node[8], abs=1e-9)
    assert scenario.stable_set().margin(nodes[1:, 5:8]).min() > 0.0


@pytest.mark.parametrize("back", [0, 1])
def test_a_path_leads_free_from_start_to_goal_at_the_cost_that_is_said(
    problem: Problem, scenario: Scenario, back: int
) -> None:
    lattice, bound = _searched(problem, scenario, back)
    arcs = lattice.path
    assert arcs is not None
    poses, free = poses_along(problem.scene, scenario.start, arcs)
    assert free == len(arcs)
    np.testing.assert_allclose(se2.relative(poses[-1], problem.goal), 0.0, atol=1e-9)
    assert arcs[:, 3].sum() == pytest.approx(bound, abs=1e-9)


@pytest.mark.parametrize(("lower", "side"), [(-0.2, 1.0), (0.2, -1.0)])
def test_the_shorter_of_two_passages_is_found(lower: float, side: float) -> None:
    text = TWO_PASSAGES.replace("LOWER", str(lower))
    scenario = plain(scenario_from_text(text, "two-passages.yaml"))
    session = _session(build_problem(scenario, scenario.stable_set()), scenario)
    LatticeRounds(session, sampling_box(scenario)).run(20_000)
    assert session.best.arcs is not None
    poses = path_from(scenario.start, session.best.arcs).sampled(0.01)
    passed = poses[np.argmin(np.abs(poses[:, 0] - 1.5)), 1]
    assert np.sign(passed) == side


@pytest.mark.parametrize("name", ["three-boxes-clutter", "narrow-gap", "two-crates"])
def test_distances_on_the_floor_are_those_of_dijkstra(name: str) -> None:
    scenario = load_plain(name)
    problem = build_problem(scenario, scenario.stable_set())
    away, grid = distances_to(problem.goal, problem, sampling_box(scenario))
    there = se2.transform_points(problem.goal, middle_of(problem)[:2])
    goal = np.floor((there - grid[:2]) / grid[2]).astype(int)
    expected = _dijkstra(np.isfinite(away), grid[2], goal)
    np.testing.assert_allclose(away, expected, rtol=1e-9)
    assert np.isfinite(away).mean() > 0.3


def _dijkstra(free: np.ndarray[Any, Any], cell: float, goal: np.ndarray[Any, Any]) -> FloatArray:
    """Lengths of the shortest ways to a cell along free cells and their diagonals."""
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
