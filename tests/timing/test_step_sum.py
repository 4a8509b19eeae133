"""The sum of smooth steps: what it is by definition, and that it never leaves the hull of its levels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import pushplan.core.timing as timing
from pushplan.geometry.se2 import chained
from pushplan.planners.timing.exact_timing import Pieces
from pushplan.plans.trajectory import Trajectory, advance
from pushplan.util.arrays import FloatArray


def _at(pieces: Pieces, times: FloatArray) -> FloatArray:
    """Values (m, 3) of the twist at times from its beginning."""
    begins = np.concatenate([[0.0], np.cumsum(pieces.durations)])
    index = np.clip(np.searchsorted(begins, times, side="right") - 1, 0, len(pieces.durations) - 1)
    tau = (times - begins[index])[:, None]
    c = pieces.coefficients[index]
    return np.asarray(c[:, 0] + tau * (c[:, 1] + tau * c[:, 2]))


def _random(seed: int, steps: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    levels = np.concatenate([np.zeros((1, 3)), rng.normal(size=(steps - 1, 3)), np.zeros((1, 3))])
    centers = np.cumsum(rng.exponential(0.3, steps))
    long = rng.uniform(0.05, 0.6, steps)
    widths = np.column_stack([long, long * rng.uniform(0.1, 1.0, steps)])
    return levels, centers, timing.ordered_widths(centers, widths)


@pytest.mark.parametrize("seed", range(5))
def test_equal_windows_average_the_jumping_twist_twice(seed: int) -> None:
    """With the same windows for all steps the sum is the jumping twist, convolved with both."""
    levels, centers, _ = _random(seed, 6)
    long, short = 0.4, 0.1
    pieces = Pieces.through(levels, centers, np.tile([long, short], (6, 1)))
    begin = centers[0] - (long + short) / 2.0
    share = (np.arange(400) + 0.5) / 400 - 0.5
    shifts = (long * share[:, None] + short * share[None, :]).ravel()
    for time in np.linspace(0.01, pieces.durations.sum() - 0.01, 15):
        jumped = levels[np.searchsorted(centers, begin + time + shifts)]
        np.testing.assert_allclose(_at(pieces, np.array([time]))[0], jumped.mean(axis=0), atol=5e-3)


@pytest.mark.parametrize("seed", range(10))
def test_the_sum_and_its_rate_are_continuous(seed: int) -> None:
    pieces = Pieces.through(*_random(seed, 8))
    h = pieces.durations[:, None]
    c0, c1, c2 = (pieces.coefficients[:, j] for j in range(3))
    np.testing.assert_allclose((c0 + h * (c1 + h * c2))[:-1], c0[1:], atol=1e-9)
    np.testing.assert_allclose((c1 + 2.0 * h * c2)[:-1], c1[1:], atol=1e-6)
    np.testing.assert_allclose([c0[0], c1[0]], 0.0, atol=1e-12)
    np.testing.assert_allclose((c0 + h * (c1 + h * c2))[-1], 0.0, atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_every_level_counts_for_the_time_between_its_centres(seed: int) -> None:
    levels, centers, widths = _random(seed, 8)
    pieces = Pieces.through(levels, centers, widths)
    powers = pieces.durations[:, None] ** np.arange(1, 4) / np.arange(1, 4)
    total = np.einsum("qj,qjd->d", powers, pieces.coefficients)
    np.testing.assert_allclose(total, np.diff(centers) @ levels[1:-1], atol=1e-9)


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(2, 12))
def test_the_sum_stays_in_the_hull_of_its_levels(seed: int, steps: int) -> None:
    levels, centers, widths = _random(seed, steps)
    pieces = Pieces.through(levels, centers, widths)
    values = _at(pieces, np.linspace(0.0, float(pieces.durations.sum()), 400))
    directions = np.random.default_rng(seed).normal(size=(30, 3))
    assert ((values @ directions.T) <= (levels @ directions.T).max(axis=0) + 1e-9).all()


@pytest.mark.parametrize("seed", range(20))
def test_ordered_widths_are_the_least_that_change_no_faster_than_the_centres(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centers, widths = np.sort(rng.uniform(0.0, 3.0, 9)), rng.uniform(0.0, 1.0, (9, 2))
    found = timing.ordered_widths(centers, widths)
    assert (found >= widths).all()
    apart = np.diff(centers)[:, None]
    assert (np.abs(np.diff(found, axis=0)) <= apart + 1e-12).all()
    raised = found > widths + 1e-12
    held = np.zeros_like(raised)
    held[1:] |= np.abs(found[1:] - (found[:-1] - apart)) < 1e-12
    held[:-1] |= np.abs(found[:-1] - (found[1:] - apart)) < 1e-12
    assert (held | ~raised).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_motion_agrees_with_an_ode_solver(seed: int) -> None:
    pieces = Pieces.through(*_random(seed, 5))

    def rate(t: float, pose: FloatArray) -> list[float]:
        vx, vy, omega = _at(pieces, np.array([t]))[0]
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return [c * vx - s * vy, s * vx + c * vy, omega]

    end = float(pieces.durations.sum())
    solved = solve_ivp(rate, (0.0, end), np.zeros(3), rtol=1e-10, atol=1e-11, max_step=0.02)
    np.testing.assert_allclose(pieces.motion, solved.y[:, -1], atol=2e-7)


@pytest.mark.parametrize("slower", [1.0, 100.0])
def test_slow_steps_have_few_pieces_and_are_as_exact(slower: float) -> None:
    """The same turns, a hundred times slower, in a tenth of the pieces: each is cut into ten and integrated again."""
    levels, centers, widths = _random(3, 6)
    pieces = Pieces.through(levels / slower, centers * 10.0 * slower, widths * 10.0 * slower)
    assert len(pieces.durations) <= 4 * 6 * timing.MOST_OF_PHASE
    breaks = np.concatenate([[0.0], np.cumsum(pieces.durations)])
    whole = Trajectory(np.zeros(3), breaks, pieces.coefficients, pieces.level.astype(np.float64))
    tau = (np.arange(10) / 10.0 * pieces.durations[:, None]).ravel()
    piece = np.repeat(np.arange(len(pieces.durations)), 10)
    steps = advance(whole.columns.take(piece, axis=2), tau, tau + pieces.durations[piece] / 10.0)
    np.testing.assert_allclose(chained(np.zeros(3), steps)[-1], pieces.motion, atol=1e-9)
