"""Rooms in series: easy ones that take many nodes, and narrow gaps, which searches never come through by chance."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import pushplan
from pushplan.core.collision import Scene, separations
from pushplan.planners.problem import build_problem
from pushplan.planners.scene import scene_of
from pushplan.planners.search.bottlenecks import aligned_poses, gaps_in
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set


def _series() -> ModuleType:
    path = Path(__file__).parent.parent / "benchmarks" / "series.py"
    spec = importlib.util.spec_from_file_location("series", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("scenario", list(_series().scenes(quick=True)), ids=lambda scenario: scenario.name)
def test_rooms_in_series_are_passed(scenario: Scenario) -> None:
    found = pushplan.plan(scenario, first=True, seed=1, iterations=100_000, time_limit=600.0)
    assert found.solved, found.reason


def _room(outlines: list[list[tuple[float, float]]], circles: list[tuple[float, float, float]]) -> Scene:
    body = [np.array([(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)])]
    discs = np.array(circles, dtype=np.float64).reshape(-1, 3)
    return scene_of(
        body, [np.array(outline) for outline in outlines], discs, np.array([0.0, 0.0, 4.0, 4.0]), 1e-3
    )


def _box(xmin: float, ymin: float, xmax: float, ymax: float) -> list[tuple[float, float]]:
    return [(xmin, ymin), (xmax, ymin), (xmax, ymax), (xmin, ymax)]


def test_a_gap_between_faces_is_as_long_as_both_lie_side_by_side() -> None:
    (gap,) = gaps_in(_room([_box(1, 1, 2, 2), _box(1.4, 2.25, 3, 3)], []), 0.2, 0.3, 0.01)
    assert gap.middle[1] == pytest.approx(2.125)
    assert abs(gap.through[0]) == pytest.approx(1.0)
    ends = gap.middle[0] + np.array([gap.begin, gap.end]) * gap.through[0]
    np.testing.assert_allclose(np.sort(ends), [1.4, 2.0], atol=1e-12)


def test_gaps_between_pillars_and_walls_count_unless_something_stands_in_them() -> None:
    pillar = (0.5, 2.0, 0.25)
    (gap,) = gaps_in(_room([], [pillar]), 0.2, 0.3, 0.01)
    np.testing.assert_allclose(gap.middle, [0.125, 2.0], atol=1e-12)
    assert gap.begin == pytest.approx(0.0, abs=1e-12)
    assert gap.end == pytest.approx(0.0, abs=1e-12)
    assert not gaps_in(_room([], [pillar, (0.125, 2.0, 0.02)]), 0.2, 0.3, 0.01)


def test_rooms_without_obstacles_have_no_gaps() -> None:
    assert not gaps_in(_room([], []), 0.2, 0.3, 0.01)


def test_aligned_poses_are_free_before_and_behind_each_gap_in_both_senses() -> None:
    scenario = _series().three_walls(0.003).with_margin(0.0)
    problem = build_problem(scenario, stable_set(scenario.chain))
    pairs = aligned_poses(problem)
    assert len(pairs) == 6
    free = separations(problem.scene, pairs.reshape(-1, 3), 1.0)
    assert (free >= problem.scene.clearance).all()
    for before, behind in pairs:
        ahead = (behind - before)[:2]
        assert abs(ahead[1]) < 1e-9
        assert abs(ahead[0]) > 0.19 + 0.1  # the body's length and the wall's
        assert np.cos(before[2]) * ahead[0] > 0.0
