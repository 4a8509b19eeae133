"""What can be said about planners from few runs: percentiles, bootstrap intervals, rank tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from pushplan.util.arrays import BoolArray, FloatArray

RESAMPLES = 2_000
"""Bootstrap samples."""

CONFIDENCE = 0.95

SIGNIFICANT = 0.05
"""Probability of a wrong difference among all that are told together (Holm 1979)."""

EQUAL = 1e-6
"""Relative difference below which two values count as equal."""

Statistic = Callable[[FloatArray], FloatArray]
"""Takes values (..., n), returns a number for each row (...)."""


def percentiles(values: FloatArray, which: Sequence[float]) -> FloatArray:
    """Return percentiles (p,) of values (n,), of which some may be infinite; NaN of none.

    Unlike interpolating ones, these are values that occur, so a percentile beyond the finite values is infinite.
    """
    if len(values) == 0:
        return np.full(len(which), np.nan)
    return np.quantile(values, np.asarray(which) / 100.0, method="higher")


def median(values: FloatArray) -> FloatArray:
    """Return the (upper) median of each row; rows may have infinite values."""
    return np.asarray(np.sort(values, axis=-1)[..., values.shape[-1] // 2])


def interval(groups: Sequence[FloatArray], statistic: Statistic) -> tuple[float, float]:
    """Return the bootstrap percentile interval of a statistic of all values together.

    Values are drawn anew within each group: the groups (problems) are those of the suite, chance is in the seeds.

    Args:
        groups: Values (n,) of each problem.
        statistic: Of the pooled values.
    """
    rng = np.random.default_rng(0)
    drawn = [group[rng.integers(0, len(group), (RESAMPLES, len(group)))] for group in groups if len(group)]
    if not drawn:
        return (np.nan, np.nan)
    found = statistic(np.concatenate(drawn, axis=1))
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = percentiles(found, (tail, 100.0 - tail))
    return float(low), float(high)


def success_test(first: BoolArray, second: BoolArray) -> float:
    """Return the p-value of McNemar's exact test: whether paired runs (n,) succeed (True) equally often."""
    only_first, only_second = int((first & ~second).sum()), int((~first & second).sum())
    if only_first + only_second == 0:
        return 1.0
    return float(stats.binomtest(only_first, only_first + only_second).pvalue)


def rank_test(first: FloatArray, second: FloatArray) -> float:
    """Return the p-value of Wilcoxon's signed-rank test on the ratios of paired, positive values (n,).

    An infinite value (not solved) is worse than any other; two of them are equal. Equal pairs count half for either
    side.
    """
    change = log_ratios(first, second)
    if not change.any():
        return 1.0
    # Ranks are all that counts: infinite changes become the largest finite ones.
    finite = np.abs(change[np.isfinite(change)])
    most = 1.0 + finite.max(initial=0.0)
    return float(stats.wilcoxon(np.clip(change, -most, most), zero_method="zsplit").pvalue)


def log_ratios(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return log(second / first) of paired positive values (n,), 0 where both are infinite or hardly differ."""
    with np.errstate(invalid="ignore", divide="ignore"):
        change = np.log(second) - np.log(first)
    return np.where(np.isnan(change) | (np.abs(change) < EQUAL), 0.0, change)


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values corrected for their number (Holm 1979): each may be compared with the level as it is."""
    order = np.argsort(p_values, kind="stable")
    scaled = np.asarray(p_values)[order] * (len(p_values) - np.arange(len(p_values)))
    corrected = np.empty(len(p_values))
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return [float(p) for p in corrected]


@dataclass(frozen=True)
class Comparison:
    """Two planners, or two versions of one, compared in one respect.

    Attributes:
        respect: `solved`, `first path` or `cost`.
        first: Name of the one.
        second: Name of the other.
        pairs: Runs of the same problem and seed that both have.
        effect: Difference of the shares solved (second less first), or median ratio (second by first).
        p: Corrected p-value.
    """

    respect: str
    first: str
    second: str
    pairs: int
    effect: float
    p: float

    @property
    def significant(self) -> bool:
        """Whether the difference is more than chance."""
        return self.p < SIGNIFICANT

    @property
    def second_is_better(self) -> bool:
        """Which way the difference goes."""
        return self.effect > 0.0 if self.respect == SOLVED else self.effect < 1.0


SOLVED, FIRST_PATH, COST = "solved", "first path", "cost"
