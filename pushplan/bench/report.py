"""Report of a benchmark: one self-contained HTML page."""

from __future__ import annotations

import json
import math
import re
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pandas as pd

from pushplan.bench.outcome import INVALID, NO_PLAN, OK, STATUSES
from pushplan.bench.plots import data_uri, plots_of
from pushplan.bench.results import MISSING, Results, ranked_by_time
from pushplan.bench.statistics import SOLVED, Comparison, compare_planners, median_interval, percentiles
from pushplan.errors import PushplanError
from pushplan.plans.execution import wilson
from pushplan.util.files import write_whole

NOTHING = "–"

FIGURES = "figures"
"""Folder of the plots, beside the report."""

MOST_PICTURES = 6

_NUMBER = re.compile(rf"[+-]?\d|< \d|× [\d{NOTHING}]|{NOTHING}")
"""Start of the text of a number, with any unit."""


def write_report(results: Results, path: Path, with_pictures: bool = True) -> None:
    """Write the report.

    Args:
        results: Results to report.
        path: HTML file to write, in the folder of the results because its links lead to the logs.
        with_pictures: Whether to draw the most interesting runs, which takes about a second each.
    """
    (path.parent / FIGURES).mkdir(exist_ok=True)
    write_whole(path, render(results, path.parent / FIGURES, with_pictures).encode())


def render(results: Results, figures: Path, with_pictures: bool = True) -> str:
    """Return the report as HTML."""
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined)
    template = environment.from_string((files("pushplan.bench") / "report.html.jinja").read_text("utf-8"))
    worst = worst_runs(results)
    failed = results.runs[~results.runs.outcome.isin((OK, NO_PLAN, MISSING))]
    source = results.about["source"]
    return template.render(
        about=results.about,
        processors=results.processors,
        counts=results.runs.outcome.value_counts(sort=False).to_dict(),
        planners=by_planner(results),
        outcomes=outcomes(results),
        plots=plots_of(results, figures),
        figures=figures.name,
        comparisons=comparisons(results),
        spread=spread(results),
        problems=by_problem(results),
        failures=failed.to_dict("records"),
        worst=worst.to_dict("records"),
        pictures=_pictures(results, worst) if with_pictures else {},
        setup=_setup(results),
        source=source.decode("utf-8") if isinstance(source, bytes) else source,
    )


# --- tables -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Attributes:
        head: Titles of the columns.
        rows: Texts of the rows.
        wrong: Indices of the red rows.
        note: Explanation below the table.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    wrong: Sequence[int] = ()
    note: str = ""

    @property
    def numeric(self) -> list[bool]:
        """Whether each column holds only numbers; such columns are right-aligned."""
        columns = zip(*self.rows, strict=True) if self.rows else [("x",)] * len(self.head)
        return [all(_NUMBER.match(word) for word in column) for column in columns]

    def latex(self, caption: str, label: str) -> str:
        """Return the table in LaTeX (package booktabs), with its note in the caption."""
        escaped = re.sub(r"([&%$#_{}])", r"\\\1", f"{caption}. {self.note}")
        columns = "".join("r" if numeric else "l" for numeric in self.numeric)
        frame = pd.DataFrame(self.rows, columns=list(self.head))
        form: Any = {"index": False, "escape": True, "column_format": columns}
        return str(frame.to_latex(**form, caption=escaped, label=f"tab:{label}"))


def write_latex(results: Results, path: Path) -> None:
    """Write the tables by planner, by problem and of comparisons in LaTeX, for papers."""
    compared, name = comparisons(results), results.about["name"]
    how = f"({limits(results)}; {results.about['machine']})"
    tables = [
        by_planner(results).latex(f"Benchmark {name} by planner {how}", "planners"),
        by_problem(results).latex(f"Benchmark {name} by problem {how}", "problems"),
    ]
    tables += [] if compared is None else [compared.latex(f"Benchmark {name}: comparisons {how}", "comparisons")]
    write_whole(path, "\n".join(tables).encode())


def limits(results: Results) -> str:
    """Return the time limit of the planners as text."""
    each = results.done.groupby("planner", sort=False).limit.first().to_dict()
    if len(set(each.values())) == 1:
        return f"planning limit {next(iter(each.values()))}"
    return "planning limits: " + ", ".join(f"{planner} {limit}" for planner, limit in each.items())


def number(value: float) -> str:
    """Return a number as text; a dash if it is not finite."""
    if not math.isfinite(value):
        return NOTHING
    return f"{value:.0f}" if abs(value) >= 999.5 else f"{value:.3g}"


def fixed(value: float, decimals: int) -> str:
    """Return a number with fixed decimals; a dash if it is not finite."""
    return f"{value:.{decimals}f}" if math.isfinite(value) else NOTHING


def seconds(value: float) -> str:
    """Return a time as text; a dash if it is not finite."""
    if not math.isfinite(value):
        return NOTHING
    return f"{1e3 * value:.3g} ms" if value < 1.0 else f"{value:.3g} s"


Show = Callable[[float], str]


def by_planner(results: Results) -> Table:
    """Return the table of solved runs, times and costs by planner, with 95 % intervals."""
    medians: list[tuple[str, str, float, int]]
    medians = [("first path, ms", "first", 1e3, 1), ("cost / lowest", "excess", 1.0, 3)]
    medians += [("duration, s", "valid_duration", 1.0, 2)] if ranked_by_time(results.runs) else []
    head = ["planner", "solved", "valid", "total", "share solved, %", *(title for title, *_ in medians)]
    reachable = results.runs.groupby("problem").cost.transform("min") < math.inf

    def middle(planner: str, column: str, unit: float, decimals: int) -> str:
        runs = results.runs[reachable & (results.runs.planner == planner) & (results.runs.outcome != MISSING)]
        groups = [unit * group.to_numpy() for _, group in runs.groupby("problem", sort=False)[column]]
        value, low, high = (fixed(one, decimals) for one in median_interval(groups))
        return f"{value} [{low}, {high}]" if groups else NOTHING

    rows = []
    for planner in results.planners:
        runs = results.of(planner)
        valid = int((runs.outcome == OK).sum())
        low, high = wilson(valid, len(runs))
        shares = (f"{100.0 * share:.1f}" for share in (valid / max(len(runs), 1), low, high))
        share = "{} [{}, {}]".format(*shares) if len(runs) else NOTHING
        found = valid + int((runs.outcome == INVALID).sum())
        middles = (middle(planner, *what[1:]) for what in medians)
        rows.append([planner, str(found), str(valid), str(len(runs)), share, *middles, *_arriving(results, runs)])
    note = (
        "solved: the planner returns a path; valid: its execution also passes the checks of collision, margin and "
        "goal. Times and costs are medians over the runs of all problems together. Brackets hold 95 % intervals: "
        "Wilson's for shares, and a bootstrap over seeds for medians. Runs without a valid path count as infinite in "
        "time and cost. Times and costs leave out problems that no planner solved."
    )
    return Table([*head, *_arriving(results)], rows, _invalid(results), note + _ranking(results))


def _ranking(results: Results) -> str:
    """Return the note on costs if the table has durations."""
    if not ranked_by_time(results.runs):
        return ""
    return " Cost is the path cost; the planners minimised the duration."


def _arriving(results: Results, runs: pd.DataFrame | None = None) -> list[str]:
    """Return the cell of the trials column for some runs, or its title; an empty list without trials."""
    if results.runs.trial_success.isna().all():
        return []
    if runs is None:
        return ["trials that arrive, %"]
    return [fixed(100.0 * runs[runs.outcome == OK].trial_success.mean(), 1)]


def _invalid(results: Results) -> list[int]:
    return [i for i, name in enumerate(results.planners) if (results.of(name).outcome == INVALID).any()]


def outcomes(results: Results) -> Table:
    """Return the table of outcomes by planner."""
    kinds = [*STATUSES, MISSING]
    counts = pd.crosstab(results.runs.planner, results.runs.outcome).reindex(
        index=results.planners, columns=kinds, fill_value=0
    )
    rows = [
        [str(name), *(str(count) for count in row)] for name, row in zip(counts.index, counts.to_numpy(), strict=True)
    ]
    return Table(["planner", *kinds], rows, _invalid(results))


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
    ("lower bound of the cost [m]", "cost_bound", number),
    ("arcs", "solution_segments", number),
    ("clearance [m]", "solution_clearance", number),
    ("margin kept", "margin", number),
    ("smallest margin", "min_margin", number),
    ("smallest margin with inertia", "min_dynamic_margin", number),
    ("trials that arrive", "trial_success", number),
    ("duration [s]", "duration", number),
    ("lower bound of the duration [s]", "duration_bound", number),
    ("goal error [m]", "solution_difference", number),
    ("goal error [rad]", "goal_angle_error", number),
    ("iterations", "extensions", number),
    ("memory [MB]", "memory", number),
)


def spread(results: Results) -> Table:
    """Return percentiles of all measured quantities over the runs with a valid path."""
    which, rows = (5, 25, 50, 75, 95), []
    for label, name, show in QUANTITIES:
        each = {planner: results.of(planner) for planner in results.planners}
        known = {planner: runs[runs.outcome == OK][name].dropna() for planner, runs in each.items()}
        if not any(len(values) for values in known.values()):
            continue
        for planner, values in known.items():
            if values.empty:
                continue
            shares = percentiles(values.to_numpy(), which)
            rows.append([label, planner, str(len(values)), *map(show, shares)])
    return Table(["", "planner", "runs", *(f"{p} %" for p in which)], rows, note="Runs with a valid path.")


def by_problem(results: Results) -> Table:
    """Return the table of results by problem and planner."""
    best = results.runs.groupby("problem").cost.min()
    by_time, rows = ranked_by_time(results.runs), []
    for (problem, planner), runs in results.done.groupby(["problem", "planner"], sort=False):
        costs = percentiles(runs.cost.to_numpy(), (25, 50, 75))
        (first,) = percentiles(runs["first"].to_numpy(), (50,))
        solved = f"{(runs.outcome == OK).sum()} / {len(runs)}"
        numbers = [fixed(1e3 * first, 1), *(fixed(cost, 3) for cost in (*costs, best[problem]))]
        numbers += [fixed(percentiles(runs.valid_duration.to_numpy(), (50,))[0], 2)] if by_time else []
        rows.append([problem, planner, solved, *numbers, *_arriving(results, runs)])
    head = ["problem", "planner", "solved", "first path, ms", "cost, m: 25 %", "50 %", "75 %", "lowest known"]
    note = "Costs: quartiles over seeds, and the lowest of all runs. Times: medians. Unsolved runs count as infinite."
    head += ["duration, s"] if by_time else []
    return Table([*head, *_arriving(results)], rows, note=note + _ranking(results))


def comparisons(results: Results) -> Table | None:
    """Return the table of tests between every two planners, or None for a single planner."""
    found = compare_planners(results)
    if not found:
        return None
    note = (
        "Pairs are runs of the same problem and seed. Second against first: for solved, the difference of the "
        "shares (second minus first) in percentage points; for other rows, the median ratio over the pairs (second "
        "by first), so below 1 the second is better. Tests: McNemar's exact test for solved, Wilcoxon's signed-rank "
        "test on ratios for other rows; an unsolved run is worse than any other. p-values are corrected for the "
        "number of tests in this table (Holm). If p < 0.05, the last column names the better planner."
    )
    head = ("in", "first", "second", "pairs", "second against first", "p", "better")
    chances = ["< 0.001" if one.p < 0.001 else f"{one.p:.3f}" for one in found]
    better = [(one.second if one.second_is_better else one.first) if one.significant else NOTHING for one in found]
    rows = [
        [one.respect, one.first, one.second, str(one.pairs), effect_text(one), p, name]
        for one, p, name in zip(found, chances, better, strict=True)
    ]
    return Table(head, rows, note=note)


def effect_text(one: Comparison) -> str:
    """Return the effect of a comparison as text."""
    return f"{100.0 * one.effect:+.1f} points" if one.respect == SOLVED else f"× {fixed(one.effect, 3)}"


def _setup(results: Results) -> Table:
    versions = json.loads(str(results.about["versions"]))
    hosts = sorted({host for host in results.done.host if host})
    rows = [
        ("machine", str(results.about["machine"])),
        ("limit", limits(results)),
        ("runs done on", ", ".join(hosts) or NOTHING),
        ("versions", ", ".join(f"{name} {version}" for name, version in versions.items())),
        ("seeds", _ranges(sorted(set(results.runs.seed)))),
    ]
    return Table(("", ""), rows)


def _ranges(numbers: Sequence[int]) -> str:
    """Return increasing numbers as ranges, e.g. `1-10, 12`."""
    parts: list[list[int]] = []
    for n in numbers:
        if parts and n == parts[-1][1] + 1:
            parts[-1][1] = n
        else:
            parts.append([n, n])
    return ", ".join(str(low) if low == high else f"{low}-{high}" for low, high in parts)


# --- interesting runs -------------------------------------------------------------------------------------------


def worst_runs(results: Results) -> pd.DataFrame:
    """Return the most interesting runs: invalid runs, other failures, runs without a plan, then the highest costs.

    Each problem, planner and outcome has at most one run, so that a single hard problem does not fill the list.
    """
    runs = results.done
    rank = runs.outcome.map({INVALID: 0, NO_PLAN: 2, OK: 3}).fillna(1)
    excess = runs.excess.where(np.isfinite(runs.excess), 0.0)
    ranked = runs.assign(rank=rank, excess=excess).sort_values(
        ["rank", "excess"], ascending=[True, False], kind="stable"
    )
    return ranked.drop_duplicates(["problem", "planner", "outcome"])[:MOST_PICTURES]


def _pictures(results: Results, runs: pd.DataFrame) -> dict[str, str]:
    """Return pictures (data URIs) by key of the runs whose logs hold a plan."""
    from pushplan.drawing.plans import plot_plan
    from pushplan.logging.reader import load_run

    found = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.png"
        for run in runs[runs.log.notna()].itertuples():
            try:
                recorded = load_run(results.path.parent / run.log)
                if recorded.plan is None:
                    continue
                plot_plan(recorded.plan, path, recorded.execution)
            except PushplanError:
                continue  # the report lists an incomplete log without a picture
            found[run.key] = data_uri(path.read_bytes(), "png")
    return found
