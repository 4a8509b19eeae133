"""Arc lengths that end on a pose, and the effect that a length has."""

from __future__ import annotations

import numpy as np
import pytest

from pushplan.geometry import se2
from pushplan.planners.timing.parts import NoFitError, fit_lengths
from pushplan.planners.timing.sweep import LengthRows, effects_on, no_rows
from pushplan.plans.path import PushPath, cost_rate
from pushplan.util.arrays import FloatArray


def _path(seed: int, arcs: int) -> PushPath:
    rng = np.random.default_rng(seed)
    twists = rng.normal(size=(arcs, 3)) * [0.3, 0.3, 2.0] + [1.0, 0.0, 0.0]
    return PushPath(rng.normal(size=3), twists / cost_rate(twists)[:, None], rng.uniform(0.1, 0.5, arcs))


def _end(path: PushPath, lengths: FloatArray) -> FloatArray:
    return PushPath(path.start, path.twists, lengths).end


@pytest.mark.parametrize("seed", range(5))
def test_effects_are_the_differences_of_a_later_pose(seed: int) -> None:
    path, h = _path(seed, 6), 1e-7
    found = effects_on(path.end, path)
    for i in range(6):
        step = h * np.eye(6)[i]
        ahead, behind = (_end(path, path.lengths + sign * step) for sign in (1.0, -1.0))
        np.testing.assert_allclose(se2.relative(behind, ahead) / (2.0 * h), found[:, i], atol=1e-5)


@pytest.mark.parametrize("arcs", [3, 4, 9])
def test_a_pose_nearby_is_reached_exactly_with_small_changes(arcs: int) -> None:
    path = _path(5, arcs)
    goal = se2.compose(path.end, np.array([0.003, -0.002, 0.004]))
    found = fit_lengths(lambda x: _end(path, x), goal, path, path.lengths, no_rows(arcs))
    np.testing.assert_allclose(_end(path, found), goal, atol=1e-10)
    assert np.abs(found - path.lengths).max() < 0.05


def test_other_conditions_are_met_as_well() -> None:
    path = _path(1, 6)
    rows = LengthRows(np.array([[1.0, 1.0, 0.0, 0.0, 0.0, 0.0]]), path.lengths[:2].sum(keepdims=True) + 0.01)
    found = fit_lengths(lambda x: _end(path, x), path.end, path, path.lengths, rows)
    np.testing.assert_allclose(_end(path, found), path.end, atol=1e-10)
    more = found[:2].sum() - path.lengths[:2].sum()
    assert 0.01 - 1e-9 < more < 0.0101


def test_what_two_arcs_cannot_reach_is_said() -> None:
    path = _path(2, 2)
    goal = se2.compose(path.end, np.array([0.0, 0.01, 0.02]))
    with pytest.raises(NoFitError, match="no arc lengths found"):
        fit_lengths(lambda x: _end(path, x), goal, path, path.lengths, no_rows(2))


def test_no_length_becomes_negative() -> None:
    path = _path(3, 3)
    goal = se2.compose(_end(path, path.lengths * [1.0, 0.0, 1.0]), se2.exp(-0.05 * path.twists[1]))
    with pytest.raises(NoFitError):
        fit_lengths(lambda x: _end(path, x), goal, path, path.lengths, no_rows(3))
