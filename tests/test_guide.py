"""Ways around the obstacles: free, as short as the grid allows, and through every passage in turn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from plain import load_plain, plain
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from pushplan.arrays import FloatArray
from pushplan.geometry import se2
from pushplan.planners.problem.posing import build_problem, sampling_box
from pushplan.planners.search.guide import BARE, Guide, find_way, make_guide
from pushplan.reading.scenario_file import scenario_from_text
from pushplan.scenario import Scenario
from pushplan.stable_sets.named import stable_set

TWO_PASSAGES = """
format: pushplan/1
floor: {friction: 0.3}
objects: [{name: box, shape: {box: [0.1, 0.1]}, mass: 1.0}]
contacts: {friction: 0.3}
pusher: {width: 0.2, friction: 0.5}
start: [0.0, 0.0, 0.0]
goal: {pose: [3.0, 0.0, 0.0]}
workspace: {x: [-0.5, 3.5], y: [-1.5, 1.5]}
obstacles: [{box: [0.5, 2.0], pose: [1.5, 0.0, 0.0]}]
"""


def _guide(scenario: Scenario) -> Guide:
    problem = build_problem(scenario, stable_set(scenario.chain, scenario.stability.set))
    return make_guide(problem, scenario.start, sampling_box(scenario))


def _way(guide: Guide, rough: float, tight: float, seed: int) -> FloatArray:
    way = np.empty((guide.space.size, 2))
    return way[: find_way(guide, rough, tight, np.array([seed], dtype=np.uint64), way)]


def _shortest(guide: Guide, way: FloatArray) -> float:
    """Length of the shortest way between a way's ends along the free cells and their diagonals, by Dijkstra."""
    free = guide.space + 0.71 * guide.cell >= BARE * guide.half_width
    ends = np.floor((way[[0, -1]] - guide.corner) / guide.cell).astype(int)
    free[tuple(ends.T)] = True
    cells = np.arange(free.size).reshape(free.shape)
    rows, columns, steps = [], [], []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = cells[: free.shape[0] - di, max(0, -dj) : free.shape[1] - max(0, dj)]
        there = cells[di:, max(0, dj) : free.shape[1] + min(0, dj)]
        both = free.ravel()[here] & free.ravel()[there]
        rows.append(here[both])
        columns.append(there[both])
        steps.append(np.full(both.sum(), guide.cell * np.hypot(di, dj)))
    graph = coo_array(
        (np.concatenate(steps), (np.concatenate(rows), np.concatenate(columns))), (free.size, free.size)
    )
    begin, end = (int(cells[tuple(cell)]) for cell in ends)
    distances: Any = dijkstra(graph.tocsr(), directed=False, indices=begin)  # type: ignore[call-overload]
    return float(distances[end])


@pytest.mark.parametrize("name", ["three-boxes-clutter", "narrow-gap", "two-crates"])
def test_on_a_flat_floor_the_way_is_the_shortest(name: str) -> None:
    guide = _guide(load_plain(name))
    way = _way(guide, 0.0, 0.0, 1)
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    assert length == pytest.approx(_shortest(guide, way), rel=1e-9)


def test_a_way_leads_the_middle_of_the_body_from_start_to_goal_past_the_obstacles() -> None:
    scenario = load_plain("three-boxes-clutter")
    guide = _guide(scenario)
    for seed in range(20):
        way = _way(guide, 1.5, 0.1, seed)
        for pose, end in ((scenario.start, way[0]), (scenario.goal.pose_chain, way[-1])):
            assert np.abs(se2.transform_points(pose, guide.center) - end).max() <= 0.5 * guide.cell + 1e-12
        steps = np.abs(np.diff(way, axis=0)).max(axis=1)
        np.testing.assert_allclose(steps, guide.cell, rtol=1e-9)
        cells = np.floor((way[1:-1] - guide.corner) / guide.cell).astype(int)
        assert (guide.space[tuple(cells.T)] + 0.71 * guide.cell >= BARE * guide.half_width).all()


def test_every_passage_has_its_turn() -> None:
    guide = _guide(plain(scenario_from_text(TWO_PASSAGES, "two-passages.yaml")))
    sides = [float(np.sign(way[np.argmin(np.abs(way[:, 0] - 1.5)), 1])) for way in
             (_way(guide, 0.5, 0.0, seed) for seed in range(12))]  # fmt: skip
    assert 3 <= sides.count(1.0) <= 9


def test_without_a_way_there_is_none() -> None:
    walled = TWO_PASSAGES.replace("[0.5, 2.0]", "[0.5, 2.98]")
    assert len(_way(_guide(plain(scenario_from_text(walled, "walled.yaml"))), 0.5, 0.0, 1)) == 0
