"""Statistics against closed forms, against scipy, and against their own promises."""

import numpy as np
import pytest
from scipy import stats

from pushplan.bench.statistics import holm, median_interval, rank_test, success_test
from pushplan.util.wilson import wilson

INF = np.inf


def test_a_median_is_infinite_when_half_of_the_runs_are_unsolved() -> None:
    assert median_interval([np.array([1.0, 2.0]), np.array([INF])])[0] == 2.0
    assert median_interval([np.array([1.0, INF]), np.array([INF])])[0] == INF


def test_bootstrap_intervals_cover_the_truth_as_often_as_they_say() -> None:
    """Medians of 60 times: those of an exponential law are known; the seed is fixed."""
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        _, low, high = median_interval([rng.exponential(size=30), rng.exponential(size=30)])
        hits += low <= np.log(2.0) <= high
    assert 0.90 <= hits / 200 <= 0.99


@pytest.mark.parametrize(("successes", "count"), [(16, 16), (0, 16), (12, 16), (90, 240)])
def test_intervals_of_shares_are_where_the_score_test_does_not_refuse(successes: int, count: int) -> None:
    """At its ends p, and nowhere else, the share is 1.96 standard deviations of p away: Wilson's definition."""
    low, high = wilson(successes, count)
    assert 0.0 <= low < high <= 1.0
    share = successes / count
    for p in (low, high):
        if 0.0 < p < 1.0:
            assert abs(share - p) / np.sqrt(p * (1.0 - p) / count) == pytest.approx(1.959964, rel=1e-6)
    if successes == count:
        assert low == pytest.approx(1.0 / (1.0 + 1.959964**2 / count), rel=1e-6)
        assert high == 1.0


@pytest.mark.parametrize(("wins", "losses"), [(0, 0), (1, 0), (5, 0), (8, 2), (50, 30)])
def test_the_success_test_is_the_sign_test_on_the_pairs_that_differ(wins: int, losses: int) -> None:
    first = np.array([True] * wins + [False] * losses + [True] * 7 + [False] * 3)
    second = np.array([False] * wins + [True] * losses + [True] * 7 + [False] * 3)
    tail = stats.binom.cdf(min(wins, losses), wins + losses, 0.5)
    assert success_test(first, second) == pytest.approx(min(1.0, 2.0 * tail))


def test_the_rank_test_agrees_with_scipy_and_ignores_scale() -> None:
    rng = np.random.default_rng(2)
    first = rng.uniform(1.0, 2.0, 30)
    second = first * rng.uniform(0.9, 1.3, 30)
    expected = stats.wilcoxon(np.log(second / first)).pvalue
    scale = rng.uniform(0.1, 10.0, 30)
    assert rank_test(first, second) == pytest.approx(expected)
    assert rank_test(first * scale, second * scale) == pytest.approx(expected)
    assert rank_test(second, first) == pytest.approx(expected)


def test_unsolved_runs_count_as_worst() -> None:
    first = np.full(12, 1.0)
    assert rank_test(first, np.full(12, INF)) < 0.01
    assert rank_test(np.full(12, INF), np.full(12, INF)) == 1.0
    mixed = np.array([INF] * 6 + [0.5] * 6)
    assert rank_test(first, mixed) > 0.1


def test_rank_tests_of_equal_planners_are_significant_as_often_as_they_may() -> None:
    rng = np.random.default_rng(3)
    p = [rank_test(*rng.uniform(1.0, 2.0, (2, 25))) for _ in range(400)]
    assert 0.02 <= np.mean(np.array(p) < 0.05) <= 0.08


def test_holm_corrects_as_in_his_example() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []
