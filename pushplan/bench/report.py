"""The report of a benchmark: one page that holds everything it shows and asks the network for nothing."""

from __future__ import annotations

import base64
import json
import math
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import jinja2
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from pushplan.bench.outcome import INVALID, NO_PLAN, OK, STATUSES
from pushplan.bench.statistics import SOLVED, Comparison, compare_planners, median_interval, percentiles
from pushplan.bench.store import MISSING, Results, ranked_by_time
from pushplan.drawing.figure import axes_at, figure_for
from pushplan.drawing.palette import FAINT
from pushplan.errors import PushplanError
from pushplan.util.arrays import FloatArray
from pushplan.util.files import write_whole
from pushplan.util.printable import cut
from pushplan.util.wilson import wilson

NOTHING = "–"

MOST_PICTURES = 6

COLOURS = ("#3b6ea8", "#d1762c", "#4d8f4a", "#a64d79", "#7a6a4f", "#4aa3a3", "#8a63b0", "#b03a48")

SHORTEST = 1e-5
"""Times below this (s) are drawn there."""

BEFORE = 0.8
"""Where axes of time begin, by the earliest first path."""

LEAST_SOLVED = 0.5
"""Share of runs that must have a path before costs over time are drawn: of fewer, the median would mislead."""

_NUMBER = re.compile(rf"[+-]?\d|< \d|× [\d{NOTHING}]|{NOTHING}")
"""How the text of a number begins, whatever its unit."""


def write_report(results: Results, path: Path, with_pictures: bool = True) -> None:
    """Write the report.

    Args:
        results: What to report.
        path: HTML file to write, in the folder of the results, so that its links lead to the logs.
        with_pictures: Draw the runs most worth a look, which takes about a second each.
    """
    write_whole(path, render(results, with_pictures).encode())


def render(results: Results, with_pictures: bool = True) -> str:
    """Return the report as HTML."""
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined)
    template = environment.from_string((files("pushplan.bench") / "report.html.jinja").read_text("utf-8"))
    worst = worst_runs(results)
    failed = results.runs[~results.runs.outcome.isin((OK, NO_PLAN, MISSING))]
    source = results.about["source"]
    return template.render(
        about=results.about,
        counts=results.runs.outcome.value_counts(sort=False).to_dict(),
        planners=by_planner(results),
        outcomes=outcomes(results),
        plots=_plots(results),
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
        wrong: Numbers of the rows that are shown in red.
        note: What explains it.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    wrong: Sequence[int] = ()
    note: str = ""

    @property
    def numeric(self) -> list[bool]:
        """Which columns hold numbers, and so stand to the right."""
        columns = zip(*self.rows, strict=True) if self.rows else [("x",)] * len(self.head)
        return [all(_NUMBER.match(word) for word in column) for column in columns]

    def latex(self, caption: str, label: str) -> str:
        """Return it as a LaTeX table with its note in the caption; it takes the package booktabs."""
        columns = "".join("r" if numeric else "l" for numeric in self.numeric)
        lines = [" & ".join(map(_latex, row)) + r" \\" for row in (self.head, *self.rows)]
        above = [r"\begin{table}", r"\centering", rf"\caption{{{_latex(f'{caption}. {self.note}')}}}"]
        rules = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", lines[0], r"\midrule", *lines[1:]]
        below = [r"\bottomrule", r"\end{tabular}", r"\end{table}", ""]
        return "\n".join([*above, rf"\label{{tab:{label}}}", *rules, *below])


_LATEX = {
    **{letter: rf"\{letter}" for letter in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "×": r"$\times$",
    "<": "$<$",
    NOTHING: "--",
}


def _latex(text: str) -> str:
    return "".join(_LATEX.get(letter, letter) for letter in text)


def write_latex(results: Results, path: Path) -> None:
    """Write the tables by planner and by problem, and comparisons, for a paper, in LaTeX."""
    compared, name = comparisons(results), results.about["name"]
    tables = [
        by_planner(results).latex(f"Benchmark {name} by planner", "planners"),
        by_problem(results).latex(f"Benchmark {name} by problem", "problems"),
    ]
    tables += [] if compared is None else [compared.latex(f"Benchmark {name}: comparisons", "comparisons")]
    write_whole(path, "\n".join(tables).encode())


def number(value: float, digits: int = 3) -> str:
    """Return a number for people; a dash for none."""
    if not math.isfinite(value):
        return NOTHING
    return f"{value:.0f}" if abs(value) >= 10.0**digits - 0.5 else f"{value:.{digits}g}"


def fixed(value: float, decimals: int) -> str:
    """Return a number with the decimals that its column has; a dash for none."""
    return f"{value:.{decimals}f}" if math.isfinite(value) else NOTHING


def seconds(value: float) -> str:
    """Return a time for people."""
    if not math.isfinite(value):
        return NOTHING
    return f"{1e3 * value:.3g} ms" if value < 1.0 else f"{value:.3g} s"


Show = Callable[[float], str]


def by_planner(results: Results) -> Table:
    """Return how many runs each planner solved, how soon, and how well, with 95 % intervals."""
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
        rows.append(
            [planner, str(found), str(valid), str(len(runs)), share, *middles, *_arriving(results, runs)]
        )
    note = (
        "solved: the planner claims a path; valid: the executed path also stands up to the checks of collision, "
        "margin and goal. Times and costs: medians. In brackets 95 % intervals: Wilson's of shares; of "
        "medians by bootstrap over seeds, the problems being those of the suite. Runs without a valid path count as "
        "infinitely late and long; problems that nobody solved are left out of times and costs."
    )
    return Table([*head, *_arriving(results)], rows, _invalid(results), note + _ranking(results))


def _ranking(results: Results) -> str:
    """Return what a note says of costs beside durations, where durations are shown."""
    if not ranked_by_time(results.runs):
        return ""
    return " Cost is travel; the planners ranked plans by time, so they made the duration small."


def _arriving(results: Results, runs: pd.DataFrame | None = None) -> list[str]:
    """Return the cell of valid runs, or the title, of the column of trials; none where no trials ran."""
    if results.runs.trial_success.isna().all():
        return []
    if runs is None:
        return ["trials that arrive, %"]
    return [fixed(100.0 * runs[runs.outcome == OK].trial_success.mean(), 1)]


def _invalid(results: Results) -> list[int]:
    return [i for i, name in enumerate(results.planners) if (results.of(name).outcome == INVALID).any()]


def outcomes(results: Results) -> Table:
    """Return how the runs of each planner ended."""
    kinds = [*STATUSES, MISSING]
    counts = pd.crosstab(results.runs.planner, results.runs.outcome).reindex(
        index=results.planners, columns=kinds, fill_value=0
    )
    rows = [
        [str(name), *(str(count) for count in row)]
        for name, row in zip(counts.index, counts.to_numpy(), strict=True)
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
    ("extensions", "extensions", number),
    ("memory [MB]", "memory", number),
)


def spread(results: Results) -> Table:
    """Return percentiles of everything measured, over the runs with a valid path; what no run has is left out."""
    which, rows = (5, 25, 50, 75, 95), []
    for label, name, show in QUANTITIES:
        each = {planner: results.of(planner) for planner in results.planners}
        known = {planner: runs[runs.outcome == OK][name].dropna() for planner, runs in each.items()}
        if not any(len(values) for values in known.values()):
            continue
        for planner, values in known.items():
            shares = percentiles(values.to_numpy(), which)
            rows.append([label, planner, str(len(values)), *map(show, shares)])
    return Table(["", "planner", "runs", *(f"{p} %" for p in which)], rows, note="Runs with a valid path.")


def by_problem(results: Results) -> Table:
    """Return what each planner made of each problem."""
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
    note = "Costs: quartiles over seeds, and the lowest of all runs; times: medians. Unsolved runs count as infinite."
    head += ["duration, s"] if by_time else []
    return Table([*head, *_arriving(results)], rows, note=note + _ranking(results))


def comparisons(results: Results) -> Table | None:
    """Return what tests say about every two planners, or None when there is only one."""
    found = compare_planners(results)
    if not found:
        return None
    note = (
        "Runs of the same problem and seed in pairs. Second against first: in what is solved, the share of the "
        "second less that of the first, in percentage points; in all else, the median over the pairs of the second's "
        "value divided by the first's, so that below 1 the second is better. Solved: McNemar's exact test; all else: "
        "Wilcoxon's signed-rank test on ratios, an unsolved run being worse than any other. p-values are corrected "
        "for the number of tests in this table (Holm); where p < 0.05 the better one is named."
    )
    head = ("in", "first", "second", "pairs", "second against first", "p", "better")
    better = [
        (one.second if one.second_is_better else one.first) if one.significant else NOTHING for one in found
    ]
    rows = [
        [one.respect, one.first, one.second, str(one.pairs), effect_text(one), _p_text(one.p), name]
        for one, name in zip(found, better, strict=True)
    ]
    return Table(head, rows, note=note)


def effect_text(one: Comparison) -> str:
    """Return what has changed, for people."""
    return f"{100.0 * one.effect:+.1f} points" if one.respect == SOLVED else f"× {fixed(one.effect, 3)}"


def _p_text(p: float) -> str:
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def _setup(results: Results) -> Table:
    versions = json.loads(str(results.about["versions"]))
    hosts = sorted({host for host in results.done.host if host})
    rows = [
        ("machine", str(results.about["machine"])),
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


# --- runs worth a look ------------------------------------------------------------------------------------------


def worst_runs(results: Results, most: int = MOST_PICTURES) -> pd.DataFrame:
    """Return the runs most worth a look: invalid ones, other failures, then those without a plan and the costliest.

    At most one run of each problem, planner and outcome, so that a single hard problem does not fill the list.
    """
    runs = results.done
    rank = runs.outcome.map({INVALID: 0, NO_PLAN: 2, OK: 3}).fillna(1)
    excess = runs.excess.where(np.isfinite(runs.excess), 0.0)
    ranked = runs.assign(rank=rank, excess=excess).sort_values(
        ["rank", "excess"], ascending=[True, False], kind="stable"
    )
    return ranked.drop_duplicates(["problem", "planner", "outcome"])[:most]


def _pictures(results: Results, runs: pd.DataFrame) -> dict[str, str]:
    """Return pictures (data URIs) by key of those runs whose logs hold enough to draw one."""
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
                continue  # a log that was cut off is listed without a picture
            found[run.key] = _data_uri(path.read_bytes(), "png")
    return found


def _data_uri(image: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(image).decode()}"


# --- plots ------------------------------------------------------------------------------------------------------


def _plots(results: Results) -> list[tuple[str, str]]:
    """Return titles and images (data URIs) of the plots; none where no run is valid."""
    if not (results.runs.outcome == OK).any():
        return []
    width, height = 5.2, 3.3
    bottom, right, top = 0.5, 0.15, 0.3
    plots = []
    for title, left, draw in (
        ("Success", 0.62, _draw_success),
        ("Cost: median and quartiles", 0.62, _draw_cost),
        ("First path: quartiles, 5 to 95 %, runs", 1.2, _draw_first),  # twelve letters fit, however wide
        ("Margin against cost", 0.62, _draw_margins),
    ):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plot.svg"
            with figure_for(path, width, height) as figure:
                axes = axes_at(figure, left, bottom, width - left - right, height - bottom - top)
                axes.set_title(title, loc="left")
                axes.grid(color=FAINT, alpha=0.25, linewidth=0.5)
                draw(axes, results)
                if axes.get_legend_handles_labels()[0]:
                    axes.legend(loc="best", frameon=True)  # its markers are no points of the plot
            plots.append((title, _data_uri(path.read_bytes(), "svg+xml")))
    return plots


def _coloured(results: Results) -> Iterator[tuple[str, str, pd.DataFrame, pd.DataFrame]]:
    """Yield the name of each planner, its colour, its runs, and those of them that are valid."""
    for i, planner in enumerate(results.planners):
        runs = results.of(planner)
        yield planner, COLOURS[i % len(COLOURS)], runs, runs[runs.outcome == OK]


def _span(results: Results) -> tuple[float, float]:
    """Return where axes of planning time (s) begin, just before the earliest first path, and end."""
    start = BEFORE * max(float(results.runs["first"].min()), SHORTEST)
    return start, max(results.time_limit, 2.0 * start)


def _draw_success(axes: Axes, results: Results) -> None:
    """Draw the share of runs that have found a (valid) path over the planning time."""
    start, end = _span(results)
    for planner, colour, runs, valid in _coloured(results):
        times = np.sort(valid["first"])
        steps = np.clip(np.concatenate([[start], times, [end]]), start, None)
        shares = np.concatenate([[0.0], np.arange(1, len(times) + 1), [len(times)]]) / max(len(runs), 1)
        axes.step(steps, shares, where="post", color=colour, label=planner)
    axes.set(xscale="log", xlim=(start, end), ylim=(0.0, 1.03))
    axes.set(xlabel="planning time [s]", ylabel="share of runs solved")


def _draw_cost(axes: Axes, results: Results) -> None:
    """Draw the median and the quartiles of cost over the lowest known one, over the planning time."""
    times = np.geomspace(*_span(results), 200)
    for planner, colour, *_ in _coloured(results):
        low, middle, high = cost_quartiles(results, planner, times)
        seen = np.isfinite(middle)
        if not seen.any():
            continue
        axes.plot(times[seen], middle[seen], color=colour, label=planner)
        band = seen & np.isfinite(high)
        axes.fill_between(times[band], low[band], high[band], color=colour, alpha=0.2, linewidth=0.0)
    axes.set(xscale="log", xlim=(times[0], times[-1]))
    axes.set(xlabel="planning time [s]", ylabel="cost / lowest known")


def cost_quartiles(results: Results, planner: str, times: FloatArray) -> FloatArray:
    """Return the quartiles (3, t) of costs, as multiples of the lowest known, over time.

    Infinite where not enough runs have a path yet: half of them for the median, three quarters for the band. Problems
    that nobody solved are left out.
    """
    best = results.runs.groupby("problem").cost.min()
    runs = results.of(planner)
    runs = runs[np.isfinite(runs.problem.map(best).to_numpy(dtype=float))]
    if runs.empty:
        return np.full((3, len(times)), np.inf)
    curves = np.full((len(runs), len(times)), np.inf)
    points = dict(list(results.progress.groupby("key")))
    for curve, run in zip(curves, runs.itertuples(), strict=True):
        if run.outcome == OK and run.key in points:
            known = points[run.key]
            index = np.searchsorted(known.time, times, side="right") - 1
            costs = known.cost.to_numpy()[np.maximum(index, 0)] / best[run.problem]
            curve[:] = np.where(index >= 0, costs, np.inf)
    quartiles = np.array([percentiles(column, (25, 50, 75)) for column in curves.T]).T
    return np.where(np.isfinite(curves).mean(axis=0) >= LEAST_SOLVED, quartiles, np.inf)


def _draw_first(axes: Axes, results: Results) -> None:
    """Draw the times to the first path as boxes over their quartiles, whiskers from 5 to 95 %, and points."""
    rng, shown = np.random.default_rng(0), list[str]()
    for planner, colour, _, valid in _coloured(results):
        if valid.empty:
            continue
        i, times = len(shown), np.maximum(valid["first"].to_numpy(), SHORTEST)
        shown.append(planner)
        low, left, middle, right, high = percentiles(times, (5, 25, 50, 75, 95))
        axes.plot([low, high], [i, i], color=colour, linewidth=1.0)
        axes.barh(i, right - left, left=left, height=0.5, color=colour, alpha=0.3)
        axes.plot([middle, middle], [i - 0.25, i + 0.25], color=colour, linewidth=2.0)
        axes.plot(times, i + rng.uniform(-0.2, 0.2, len(times)), ".", color=colour, markersize=2.5, alpha=0.6)
    axes.set(xscale="log", xlabel="time to the first path [s]", ylim=(len(shown) - 0.4, -0.6))
    low, high = axes.get_xlim()
    room = max(1.0, math.sqrt(9.99 * low / high))
    axes.set_xlim(low / room, high * room)  # of less than a decade, numbers would be long and touch
    axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))  # within a decade more numbers would touch
    axes.set_yticks(range(len(shown)), [cut(planner, 12) for planner in shown], fontsize=7.0)
    axes.tick_params(axis="y", pad=2, length=0)


def _draw_margins(axes: Axes, results: Results) -> None:
    """Draw the smallest margin of each solved run against its cost over the lowest known one; contacts slip at 0."""
    lowest = 0.0
    for planner, colour, _, valid in _coloured(results):
        axes.plot(valid.excess, valid.min_margin, "o", color=colour, markersize=3.0, alpha=0.6, label=planner)
        lowest = min(lowest, valid.min_margin.min())
    axes.margins(0.08)
    axes.set(xlabel="cost / lowest known", ylabel="smallest margin (slips at 0)")
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]) if lowest < 0.0 else 0.0)
