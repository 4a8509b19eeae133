"""Statistics of planners from few runs: percentiles, bootstrap intervals, paired rank tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pandas as pd
from scipy import stats

from pushplan.bench.outcome import INVALID, OK
from pushplan.bench.results import Results, ranked_by_time
from pushplan.bench.store import StoreError
from pushplan.util.arrays import BoolArray, FloatArray

RESAMPLES = 2_000
"""Number of bootstrap samples."""

TAIL = 2.5
"""Tail probability on each side of a bootstrap interval, %."""

SIGNIFICANT = 0.05
"""Family-wise significance level of all comparisons in a table (Holm 1979)."""

EQUAL = 1e-6
"""Relative difference below which two values count as equal."""

THRESHOLD = 0.05
"""Smallest deterioration that counts: of the share of solved runs, or relative, of times and costs."""

SOLVED, FIRST_PATH, COST, DURATION = "solved", "first path", "cost", "duration"


def percentiles(values: FloatArray, which: Sequence[float]) -> FloatArray:
    """Return percentiles (p,) of values (n,), interpolated linearly; NaN without values.

    Values can be infinite: a percentile between a finite and an infinite value is infinite.
    """
    if len(values) == 0:
        return np.full(len(which), np.nan)
    shares, infinite = np.asarray(which) / 100.0, np.isposinf(values)
    # Interpolation with infinity gives NaN, so finite percentiles are computed without infinite values.
    finite = np.where(infinite, values[~infinite].max(initial=0.0), values)
    is_infinite = np.isposinf(np.quantile(values, shares, method="higher"))
    return np.where(is_infinite, np.inf, np.quantile(finite, shares))


def _medians(rows: FloatArray) -> FloatArray:
    """Return the medians (...) of rows (..., n); values can be infinite."""
    rows, count = np.sort(rows), rows.shape[-1]
    middles: FloatArray = (rows[..., (count - 1) // 2] + rows[..., count // 2]) / 2.0
    return middles


def median_interval(groups: Sequence[FloatArray]) -> tuple[float, float, float]:
    """Return the median of all values together and its bootstrap percentile interval.

    The bootstrap resamples within each group (problem): the problems are fixed, only the seeds are random.
    """
    groups = [group for group in groups if len(group)]
    if not groups:
        return np.nan, np.nan, np.nan
    rng = np.random.default_rng(0)
    drawn = [group[rng.integers(0, len(group), (RESAMPLES, len(group)))] for group in groups]
    low, high = percentiles(_medians(np.concatenate(drawn, axis=1)), (TAIL, 100.0 - TAIL))
    return float(_medians(np.concatenate(groups))), float(low), float(high)


def success_test(first: BoolArray, second: BoolArray) -> float:
    """Return the p-value of McNemar's exact test that paired runs (n,) succeed (True) equally often."""
    only_first, only_second = int((first & ~second).sum()), int((~first & second).sum())
    if only_first + only_second == 0:
        return 1.0
    return float(stats.binomtest(only_first, only_first + only_second).pvalue)


def log_ratios(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return log(second / first) of paired positive values (n,), 0 if both are infinite or nearly equal."""
    with np.errstate(invalid="ignore", divide="ignore"):
        change = np.log(second) - np.log(first)
    return np.where(np.isnan(change) | (np.abs(change) < EQUAL), 0.0, change)


def rank_test(first: FloatArray, second: FloatArray) -> float:
    """Return the p-value of Wilcoxon's signed-rank test on the ratios of paired, positive values (n,).

    An infinite value (not solved) is worse than any other, and two infinite values are equal. Equal pairs count half
    for each side.
    """
    change = log_ratios(first, second)
    if not change.any():
        return 1.0
    # Only ranks count, so infinite changes are clipped to just above the largest finite one.
    most = 1.0 + np.abs(change[np.isfinite(change)]).max(initial=0.0)
    return float(stats.wilcoxon(np.clip(change, -most, most), zero_method="zsplit").pvalue)


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values corrected for their number (Holm 1979), for comparison with the family-wise level."""
    order = np.argsort(p_values, kind="stable")
    scaled = np.asarray(p_values)[order] * (len(p_values) - np.arange(len(p_values)))
    corrected = np.empty(len(p_values))
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return [float(p) for p in corrected]


# --- comparisons ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Comparison:
    """Comparison of two planners, or of two versions of one, in one quantity.

    Attributes:
        respect: `solved`, `first path`, `cost`, or `duration` if time ranked all plans of both.
        first: Name of the first planner.
        second: Name of the second planner.
        pairs: Number of pairs of runs with the same problem and seed.
        effect: Difference of the shares solved (second minus first), or median ratio (second by first).
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
        """Whether the difference is significant."""
        return self.p < SIGNIFICANT

    @property
    def second_is_better(self) -> bool:
        """Whether the effect favours the second planner."""
        return self.effect > 0.0 if self.respect == SOLVED else self.effect < 1.0

    @property
    def loss(self) -> float:
        """Deterioration from first to second: difference of shares, or relative change."""
        return -self.effect if self.respect == SOLVED else self.effect - 1.0


def compare_planners(results: Results) -> list[Comparison]:
    """Compare every two planners of a suite in every quantity; p-values are corrected for all comparisons."""
    pairs = combinations(results.planners, 2)
    return _corrected([one for a, b in pairs for one in _compare(a, results.of(a), b, results.of(b))])


def _compare(first: str, one: pd.DataFrame, second: str, other: pd.DataFrame) -> list[Comparison]:
    """Compare runs of the same problem and seed in every quantity; p-values are not corrected."""
    pairs = one.merge(other, on=["problem", "seed"], suffixes=("1", "2"))
    if pairs.empty:
        return []
    solved = [(pairs[f"outcome{i}"] == OK).to_numpy() for i in (1, 2)]
    found = [(SOLVED, float(solved[1].mean() - solved[0].mean()), success_test(*solved))]
    columns = {FIRST_PATH: "first", COST: "cost"}
    if ranked_by_time(pd.concat([one, other])):
        columns[DURATION] = "valid_duration"
    for respect, column in columns.items():
        values = [pairs[f"{column}{i}"].to_numpy() for i in (1, 2)]
        found.append((respect, float(np.exp(np.median(log_ratios(*values)))), rank_test(*values)))
    return [Comparison(respect, first, second, len(pairs), effect, p) for respect, effect, p in found]


def _corrected(comparisons: Sequence[Comparison]) -> list[Comparison]:
    p_values = holm([one.p for one in comparisons])
    return [replace(one, p=p) for one, p in zip(comparisons, p_values, strict=True)]


@dataclass(frozen=True)
class VersionComparison:
    """Changes from old results to new results.

    Attributes:
        comparisons: Comparisons of old with new, for each common planner and every quantity.
        newly_invalid: Runs that are invalid in the new results but not in the old ones.
        threshold: Smallest deterioration that counts.
    """

    comparisons: tuple[Comparison, ...]
    newly_invalid: pd.DataFrame
    threshold: float

    @property
    def better(self) -> list[Comparison]:
        """Significant improvements."""
        return [one for one in self.comparisons if one.significant and one.second_is_better]

    @property
    def worse(self) -> list[Comparison]:
        """Significant deteriorations."""
        return [one for one in self.comparisons if one.significant and not one.second_is_better]

    @property
    def is_regression(self) -> bool:
        """Whether the new version is worse by more than the threshold, or has newly invalid runs."""
        return any(one.loss > self.threshold for one in self.worse) or not self.newly_invalid.empty


def compare_versions(old: Results, new: Results, threshold: float = THRESHOLD) -> VersionComparison:
    """Compare runs of the same planner, problem and seed.

    Args:
        old: Results of the old version.
        new: Results of the new version.
        threshold: Smallest deterioration that counts; see `THRESHOLD`.

    Raises:
        StoreError: If they have no runs in common.
    """
    found = [one for name in new.planners for one in _compare(name, old.of(name), name, new.of(name))]
    if not found:
        raise StoreError(
            f"{old.path} and {new.path} have no runs of the same planner, problem and seed; their planners are "
            f"{', '.join(old.planners)} and {', '.join(new.planners)}"
        )
    keys = ["planner", "problem", "seed"]
    before, now = (one.runs[one.runs.outcome == INVALID] for one in (old, new))
    newly = ~now.set_index(keys).index.isin(before.set_index(keys).index)
    return VersionComparison(tuple(_corrected(found)), now[newly], threshold)
