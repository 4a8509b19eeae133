"""Rooms in series: easy ones that take many nodes, and narrow gaps, which searches never come through by chance."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import pushplan
from pushplan.core.collision import separations
from pushplan.planners.problem import build_problem
from pushplan.planners.search.bottlenecks import aligned_poses
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
