"""The flooding trees keep their promises: free arcs, one node in a cell, and paths that end at the goal."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from plain import load_plain

from pushplan.geometry import se2
from pushplan.planners.collision.separation import sweep_is_free
from pushplan.planners.improve.budget import Budget
from pushplan.planners.improve.session import Session
from pushplan.planners.problem.posing import build_problem, sampling_box
from pushplan.planners.problem.problem import NODE, Problem
from pushplan.planners.search import cell_rounds
from pushplan.planners.search.cell_kernel import (
    ANGLE,
    FINER,
    MOST_FINER,
    NODES,
    SIDE,
    TRIED,
    CellTrees,
    flood,
)
from pushplan.planners.search.cell_rounds import CellRounds, planted
from pushplan.scenario import Scenario

SIDE_M, HEADINGS = 0.2, 24


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_plain("three-boxes-clutter")


@pytest.fixture(scope="module")
def problem(scenario: Scenario) -> Problem:
    return build_problem(scenario, scenario.stable_set())


def _planted(problem: Problem, scenario: Scenario, room: int, seed: int = 1) -> CellTrees:
    session = Session(problem, scenario.start, Budget(60.0), seed)
    sizes = (SIDE_M, 2.0 * math.pi / HEADINGS, 1.5 * SIDE_M)
    return planted(session, np.array(sampling_box(scenario)), room, sizes)


@pytest.fixture(scope="module")
def trees(problem: Problem, scenario: Scenario) -> CellTrees:
    """Return trees grown until they are full, what joins them left unused."""
    trees = _planted(problem, scenario, 1_500)
    path = np.empty((4_000, 4))
    for _ in range(10_000):
        if flood(problem, trees, 500, path) < 0:
            return trees
    raise AssertionError("flooding does not end")


@pytest.mark.parametrize("which", [0, 1])
def test_every_branch_is_a_free_stable_arc(
    problem: Problem, scenario: Scenario, trees: CellTrees, which: int
) -> None:
    nodes = trees.nodes[which, : trees.counts[which, NODES]]
    assert len(nodes) > 1_000
    for node in nodes[1:]:
        parent = nodes[int(node[4])]
        first, last = (parent, node) if which == 0 else (node, parent)
        end = se2.compose(first[:3], se2.exp(node[5:8] * node[8]))
        np.testing.assert_allclose(last[:2], end[:2], atol=1e-9)
        assert abs(se2.wrap_angle(last[2] - end[2])) < 1e-9
        assert sweep_is_free(problem.scene, *[*parent[:3], *((1 - 2 * which) * node[5:8]), node[8]])
        assert node[3] == pytest.approx(parent[3] + node[8], abs=1e-9)
    assert scenario.stable_set().margin(nodes[1:, 5:8]).min() > 0.0


@pytest.mark.parametrize("which", [0, 1])
def test_a_cell_holds_one_node(trees: CellTrees, which: int) -> None:
    nodes = trees.nodes[which, 1 : trees.counts[which, NODES]]
    cells = np.floor((nodes[:, :2] - trees.box[:2]) / trees.sizes[which, SIDE])
    headings = np.floor(nodes[:, 2] % (2.0 * np.pi) / trees.sizes[which, ANGLE])
    assert len(np.unique(np.column_stack([cells, headings]), axis=0)) == len(nodes)
    assert (nodes[:, :2] >= trees.box[:2]).all()
    assert (nodes[:, :2] <= trees.box[2:]).all()


def test_the_path_is_free_and_ends_at_the_goal(problem: Problem, scenario: Scenario) -> None:
    trees, path = _planted(problem, scenario, 1_500, seed=3), np.empty((4_000, 4))
    arcs = 0
    while arcs == 0:
        arcs = flood(problem, trees, 100, path)
    assert arcs > 0
    pose = np.array(scenario.start)
    for twist, length in zip(path[:arcs, :3], path[:arcs, 3], strict=True):
        assert sweep_is_free(problem.scene, *[*pose, *twist, length])
        pose = se2.compose(pose, se2.exp(twist * length))
    np.testing.assert_allclose(pose[:2], problem.goal[:2], atol=1e-9)
    assert abs(se2.wrap_angle(pose[2] - problem.goal[2])) < 1e-9


def test_it_ends_where_nothing_can_move(problem: Problem, scenario: Scenario) -> None:
    walls = np.array([*scenario.start[:2], *scenario.start[:2]]) + 0.01 * np.array([-1.0, -1.0, 1.0, 1.0])
    shut = problem._replace(scene=problem.scene._replace(walls=walls))
    trees = _planted(problem, scenario, 100)
    assert flood(shut, trees, 10**6, np.empty((300, 4))) == -1
    assert trees.counts[:, NODES].tolist() == [1, 1]
    assert trees.counts[:, FINER].tolist() == [MOST_FINER, MOST_FINER]
    assert 0 < trees.counts[:, TRIED].sum() < 1_000


def test_a_tree_that_is_shut_in_goes_on_in_smaller_cells(problem: Problem, scenario: Scenario) -> None:
    near, shut = scenario.start[:2], 0.6
    walls = np.array([near[0] - shut, near[1] - shut, near[0] + shut, near[1] + shut])
    boxed = problem._replace(scene=problem.scene._replace(walls=walls))
    trees = _planted(boxed, scenario, 2_000)
    while trees.counts[0, FINER] == 0:
        assert flood(boxed, trees, 100, np.empty((4_003, 4))) == 0
    before = int(trees.counts[0, NODES])
    assert before < 500
    while flood(boxed, trees, 100, np.empty((4_003, 4))) == 0:
        pass
    assert trees.counts[0, NODES] > 3 * before
    assert trees.sizes[0, SIDE] < 0.8 * SIDE_M


def test_same_seed_same_path(problem: Problem, scenario: Scenario) -> None:
    paths = []
    for _ in range(2):
        session = Session(problem, scenario.start, Budget(60.0, first=True, iterations=200_000), seed=5)
        rounds = CellRounds(session, sampling_box(scenario))
        while not session.finished:
            rounds.run_next(lambda session=session: session.finished)  # type: ignore[misc]
        assert session.solved
        paths.append(session.best.arcs)
    np.testing.assert_array_equal(paths[0], paths[1])


def test_memory_of_a_round_has_a_limit() -> None:
    nodes = cell_rounds.FIRST_ROOM * cell_rounds.GROWTH**cell_rounds.HIGHEST
    table = 2 ** math.ceil(math.log2(2 * nodes))
    assert 2 * 8 * (NODE * nodes + table) + 2 * 32 * nodes < 100e6


def test_flooding_is_compiled_before_a_plan_begins() -> None:
    code = (
        "from pushplan.kernels import compile_search; from pushplan.planners.search.cell_kernel import flood; "
        "compile_search('auto'); raise SystemExit(0 if flood.signatures else 9)"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
