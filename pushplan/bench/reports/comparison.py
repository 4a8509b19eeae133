"""Compare planners run by run: the same problem, the same seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from pushplan.bench.reports.statistics import (
    COST,
    FIRST_PATH,
    SOLVED,
    Comparison,
    holm,
    log_ratios,
    rank_test,
    success_test,
)
from pushplan.bench.storage.results import Results, RunRow
from pushplan.util.arrays import BoolArray, FloatArray

Named = tuple[str, Sequence[RunRow]]


def compare_planners(results: Results) -> list[Comparison]:
    """Compare every two planners of a suite in every respect; p-values are corrected for all of that."""
    named = [(planner, results.of(planner)) for planner in results.planners]
    return corrected([one for pair in combinations(named, 2) for one in compare(*pair)])


def corrected(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Return comparisons with p-values corrected for their number."""
    p_values = holm([comparison.p for comparison in comparisons])
    return [replace(comparison, p=p) for comparison, p in zip(comparisons, p_values, strict=True)]


def compare(first: Named, second: Named) -> list[Comparison]:
    """Compare paired runs in every respect; p-values are not corrected yet."""
    pairs = _pairs(first[1], second[1])
    if not pairs:
        return []
    found = [
        _success(np.array([[run.solved for run in pair] for pair in pairs])),
        _ratio(np.array([[run.first_time for run in pair] for pair in pairs])),
        _ratio(np.array([[run.cost for run in pair] for pair in pairs])),
    ]
    return [
        Comparison(respect, first[0], second[0], len(pairs), effect, p)
        for respect, (effect, p) in zip((SOLVED, FIRST_PATH, COST), found, strict=True)
    ]


def _pairs(first: Sequence[RunRow], second: Sequence[RunRow]) -> list[tuple[RunRow, RunRow]]:
    known = {(run.problem, run.seed): run for run in second}
    return [(run, known[run.problem, run.seed]) for run in first if (run.problem, run.seed) in known]


def _success(solved: BoolArray) -> tuple[float, float]:
    effect = float(solved[:, 1].mean() - solved[:, 0].mean())
    return effect, success_test(solved[:, 0], solved[:, 1])


def _ratio(values: FloatArray) -> tuple[float, float]:
    change = log_ratios(values[:, 0], values[:, 1])
    return float(np.exp(np.median(change))), rank_test(values[:, 0], values[:, 1])
