"""Root finding and maximisation in many brackets at once."""

from __future__ import annotations

import numpy as np

import pushplan.core.boundary as boundary
from pushplan.sets.boundary_following import find_intervals, sampled
from pushplan.sets.meridians import inner_ends, maximise
from pushplan.util.arrays import FloatArray, IntArray


def test_ends_are_inside_and_within_tolerance_for_smooth_kinked_and_jumping_functions() -> None:
    """Ten members of each kind with known ends; the last inside point lies at most the tolerance before the end."""
    ends = np.linspace(0.1, 0.9, 10)
    calls = 0

    def family(member: IntArray, x: FloatArray) -> FloatArray:
        nonlocal calls
        calls += len(x)
        gap = np.tile(ends, 4)[member] - x
        kinds = np.stack([np.sinh(3.0 * gap), np.minimum(gap, 0.01 * gap + 0.3), np.sign(gap), gap**9])
        return np.asarray(kinds[member // 10, np.arange(len(x))], dtype=np.float64)

    zeros, ones, members = np.zeros(40), np.ones(40), np.arange(40)
    brackets = np.column_stack([zeros, ones, family(members, zeros), family(members, ones)])
    found = inner_ends(family, brackets)
    short = np.tile(ends, 4) - found
    assert (short > 0.0).all()
    assert (short[:30] <= boundary.TOLERANCE).all()
    assert (short <= 2.0 * boundary.TOLERANCE).all()
    assert calls < 40 * 45


def test_brackets_may_run_backwards() -> None:
    def family(member: IntArray, x: FloatArray) -> FloatArray:
        return np.asarray(x + 0.25, dtype=np.float64)

    found = inner_ends(family, np.array([[1.0, -1.0, 1.25, -0.75]]))
    assert -0.25 < found[0] <= -0.25 + boundary.TOLERANCE


def test_maximum_is_found_and_search_stops_at_the_goal() -> None:
    peaks = np.array([0.2, 0.5, 0.71])
    calls = np.zeros(3, dtype=np.int64)

    def family(member: IntArray, x: FloatArray) -> FloatArray:
        np.add.at(calls, member, 1)
        return np.asarray(1.0 - np.abs(x - peaks[member]), dtype=np.float64)

    x, value = maximise(family, np.zeros(3), np.ones(3), 2.0, 40)
    np.testing.assert_allclose(x, peaks, atol=1e-8)
    np.testing.assert_allclose(value, 1.0, atol=1e-8)
    calls[:] = 0
    maximise(family, np.zeros(3), np.ones(3), 0.5, 40)
    assert (calls <= 3).all()


def test_intervals_between_samples_are_found_from_peaks_dips_and_double_edges() -> None:
    """By member: a peak between samples, a dip, a gap right before an edge, positive everywhere, nowhere."""

    def family(member: IntArray, x: FloatArray) -> FloatArray:
        kinds = np.stack(
            [
                0.01 - np.abs(x - 0.33),
                np.abs(x - 0.66) - 0.01,
                np.where(x < 0.53, 0.53 - x, np.minimum(x - 0.55, 0.58 - x)),
                np.ones_like(x),
                -np.ones_like(x),
            ]
        )
        return np.asarray(kinds[member, np.arange(len(x))], dtype=np.float64)

    grid = np.linspace(0.0, 1.0, 11)
    found = find_intervals(family, sampled(family, np.repeat(np.arange(5), 11), np.tile(grid, 5)))
    assert found.member.tolist() == [0, 1, 1, 2, 2, 3]
    lower, upper = found.narrowed(family).T
    np.testing.assert_allclose(lower, [0.32, 0.0, 0.67, 0.0, 0.55, 0.0], atol=2e-12)
    np.testing.assert_allclose(upper, [0.34, 0.65, 1.0, 0.53, 0.58, 1.0], atol=2e-12)
