"""Compare two benchmarks, of two versions as a rule: what has become better or worse, beyond chance."""

from __future__ import annotations

from dataclasses import dataclass

from pushplan.bench.processes.outcome import INVALID
from pushplan.bench.reports.comparison import compare, corrected
from pushplan.bench.reports.statistics import SOLVED, Comparison
from pushplan.bench.storage.results import Results, RunRow
from pushplan.bench.storage.store import StoreError

THRESHOLD = 0.05
"""Change that matters by default: of the share solved, or of times and costs as a share of the old ones."""


@dataclass(frozen=True)
class VersionComparison:
    """What has changed from old results to new ones.

    Attributes:
        comparisons: For each planner that both have, in every respect, old against new.
        newly_invalid: Runs of the new ones that are invalid and were not in the old ones.
        threshold: Change that matters.
    """

    comparisons: tuple[Comparison, ...]
    newly_invalid: tuple[RunRow, ...]
    threshold: float

    @property
    def better(self) -> list[Comparison]:
        """What has become better, beyond chance."""
        return [one for one in self.comparisons if one.significant and one.second_is_better]

    @property
    def worse(self) -> list[Comparison]:
        """What has become worse, beyond chance."""
        return [one for one in self.comparisons if one.significant and not one.second_is_better]

    @property
    def regressions(self) -> list[Comparison]:
        """What has become worse by more than the threshold."""
        return [one for one in self.worse if _change(one) > self.threshold]

    @property
    def is_regression(self) -> bool:
        """Whether the new version is worse than may be."""
        return bool(self.regressions or self.newly_invalid)


def compare_versions(old: Results, new: Results, threshold: float = THRESHOLD) -> VersionComparison:
    """Compare runs of the same planner, problem and seed.

    Args:
        old: Results of the one version.
        new: Results of the other.
        threshold: Change that matters; see `THRESHOLD`.

    Raises:
        StoreError: When they have no runs in common.
    """
    found: list[Comparison] = []
    for planner in new.planners:
        found += compare((planner, old.of(planner)), (planner, new.of(planner)))
    if not found:
        raise StoreError(
            f"{old.path} and {new.path} have no runs in common: of the same planner, problem and seed; planners are "
            f"{', '.join(old.planners)} and {', '.join(new.planners)}"
        )
    return VersionComparison(tuple(corrected(found)), tuple(_newly_invalid(old, new)), threshold)


def _newly_invalid(old: Results, new: Results) -> list[RunRow]:
    before = {(run.planner, run.problem, run.seed) for run in old.runs if run.outcome == INVALID}
    invalid = (run for run in new.runs if run.outcome == INVALID)
    return [run for run in invalid if (run.planner, run.problem, run.seed) not in before]


def _change(one: Comparison) -> float:
    """Return by how much the second is worse: difference of shares, or relative change."""
    return -one.effect if one.respect == SOLVED else one.effect - 1.0
