"""The tables of a report, as rows of texts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pushplan.bench.processes.outcome import INVALID, STATUSES
from pushplan.bench.reports.comparison import compare_planners
from pushplan.bench.reports.statistics import SOLVED, Comparison, interval, median, percentiles
from pushplan.bench.storage.results import MISSING, Results, RunRow
from pushplan.util.wilson import wilson

PERCENTILES = (5, 25, 50, 75, 95)

NOTHING = "–"


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Attributes:
        head: Titles of the columns.
        rows: Texts of the rows; those of a wrong row are shown in red.
        wrong: Numbers of the rows that are.
        note: What explains it.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    wrong: Sequence[int] = ()
    note: str = ""


def number(value: float, digits: int = 3) -> str:
    """Return a number for people; a dash for none."""
    if not math.isfinite(value):
        return NOTHING
    return f"{value:.0f}" if abs(value) >= 10.0**digits - 0.5 else f"{value:.{digits}g}"


def seconds(value: float) -> str:
    """Return a time for people."""
    if not math.isfinite(value):
        return NOTHING
    return f"{1e3 * value:.3g} ms" if value < 1.0 else f"{value:.3g} s"


def percent(value: float) -> str:
    """Return a share for people."""
    return f"{100.0 * value:.1f} %" if math.isfinite(value) else NOTHING


Show = Callable[[float], str]


def by_planner(results: Results) -> Table:
    """Return how many runs each planner solved, how soon, and how well, with bootstrap intervals."""
    head = [
        "planner",
        "solved",
        "valid",
        "total",
        "share solved",
        "first path, median",
        "cost / lowest, median",
    ]
    rows, wrong = [], []
    for i, planner in enumerate(results.planners):
        runs = results.of(planner)
        found = [run for run in runs if run.solved or run.outcome == INVALID]
        groups = [[run for run in runs if run.problem == problem] for problem in results.problems]
        reachable = [
            group for group in groups if group and math.isfinite(results.best_costs[group[0].problem])
        ]
        rows.append(
            [
                planner,
                str(len(found)),
                str(sum(run.solved for run in runs)),
                str(len(runs)),
                _share_solved(runs),
                _with_interval(reachable, lambda run: run.first_time, seconds),
                _with_interval(reachable, results.excess, lambda value: number(value, 4)),
            ]
        )
        if any(run.outcome == INVALID for run in runs):
            wrong.append(i)
    note = (
        "solved: the planner claims a path; valid: the executed path also stands up to the checks of collision, "
        "margin and goal. In brackets 95 % intervals: Wilson's of shares; of medians by bootstrap over seeds, the "
        "problems being those of the suite. Runs without a valid path count as infinitely late and long; problems "
        "that nobody solved are left out of times and costs."
    )
    return Table(head, rows, wrong, note)


def _share_solved(runs: Sequence[RunRow]) -> str:
    if not runs:
        return NOTHING
    count = sum(run.solved for run in runs)
    low, high = wilson(count, len(runs))
    return f"{percent(count / len(runs))} [{percent(low)}, {percent(high)}]"


def _with_interval(groups: Sequence[Sequence[RunRow]], value: Callable[[RunRow], float], show: Show) -> str:
    values = [np.array([value(run) for run in group]) for group in groups if group]
    if not values:
        return NOTHING
    low, high = interval(values, median)
    return f"{show(float(median(np.concatenate(values))))} [{show(low)}, {show(high)}]"


def outcomes(results: Results) -> Table:
    """Return how the runs of each planner ended."""
    kinds = [*STATUSES, MISSING]
    rows, wrong = [], []
    for i, planner in enumerate(results.planners):
        counts = dict.fromkeys(kinds, 0)
        for run in results.runs:
            counts[run.outcome] += run.planner == planner
        rows.append([planner, *(str(counts[kind]) for kind in kinds)])
        if counts[INVALID]:
            wrong.append(i)
    return Table(["planner", *kinds], rows, wrong)


QUANTITIES: tuple[tuple[str, str, Show], ...] = (
    ("time to the first path", "first_solution_time", seconds),
    ("searching", "time", seconds),
    ("posing", "posing_time", seconds),
    ("timing the path (smoothing)", "timing_time", seconds),
    ("executing", "execution_time", seconds),
    ("logging", "logging_time", seconds),
    ("validating", "validation_time", seconds),
    ("trials", "trials_time", seconds),
    ("cost [m]", "solution_length", number),
    ("lower bound [m]", "lower_bound", number),
    ("arcs", "solution_segments", number),
    ("clearance [m]", "solution_clearance", number),
    ("margin kept", "margin", number),
    ("smallest margin", "min_margin", number),
    ("smallest margin with inertia", "min_dynamic_margin", number),
    ("trials that arrive", "trial_success", number),
    ("duration [s]", "duration", number),
    ("goal error [m]", "solution_difference", number),
    ("goal error [rad]", "goal_angle_error", number),
    ("extensions", "extensions", number),
    ("memory [MB]", "memory", number),
)


def spread(results: Results) -> Table:
    """Return percentiles of everything measured, over the runs with a valid path."""
    rows = []
    for label, name, show in QUANTITIES:
        for planner in results.planners:
            values = np.array([run.values[name] for run in results.of(planner) if run.solved])
            known = values[~np.isnan(values)]
            rows.append(
                [label, planner, str(len(known)), *(show(v) for v in percentiles(known, PERCENTILES))]
            )
    return Table(
        ["", "planner", "runs", *(f"{p} %" for p in PERCENTILES)], rows, note="Runs with a valid path."
    )


def by_problem(results: Results) -> Table:
    """Return what each planner made of each problem."""
    rows = []
    for problem in results.problems:
        for planner in results.planners:
            runs = [run for run in results.of(planner) if run.problem == problem]
            if not runs:
                continue
            costs = percentiles(np.array([run.cost for run in runs]), (25, 50, 75))
            first = percentiles(np.array([run.first_time for run in runs]), (50,))
            solved = f"{sum(run.solved for run in runs)} / {len(runs)}"
            best = number(results.best_costs[problem], 5)
            rows.append([problem, planner, solved, seconds(first[0]), *(number(c, 5) for c in costs), best])
    head = ["problem", "planner", "solved", "first path, median", "cost 25 %", "50 %", "75 %", "lowest known"]
    return Table(head, rows)


def comparisons(results: Results) -> Table | None:
    """Return what tests say about every two planners, or None when there is only one."""
    found = compare_planners(results)
    if not found:
        return None
    note = (
        "Runs of the same problem and seed in pairs. Solved: McNemar's exact test; first path and cost: Wilcoxon's "
        "signed-rank test on ratios, an unsolved run being worse than any other. p-values are corrected for the "
        "number of tests in this table (Holm); differences with p < 0.05 are named."
    )
    return Table(COMPARISON_HEAD, [comparison_row(one) for one in found], note=note)


COMPARISON_HEAD = ("in", "first", "second", "pairs", "second against first", "p", "better")


def comparison_row(one: Comparison) -> list[str]:
    """Return a comparison as texts."""
    effect = f"{100.0 * one.effect:+.1f} points" if one.respect == SOLVED else f"x {number(one.effect, 4)}"
    better = (one.second if one.second_is_better else one.first) if one.significant else NOTHING
    return [one.respect, one.first, one.second, str(one.pairs), effect, f"{one.p:.2g}", better]
