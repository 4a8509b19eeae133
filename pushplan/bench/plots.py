"""Plots of a benchmark's report: success and cost over the planning time, first paths, margins against costs."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from pushplan.bench.outcome import OK
from pushplan.bench.results import MISSING, Results
from pushplan.bench.statistics import percentiles
from pushplan.drawing.figure import axes_at, figure_for
from pushplan.drawing.palette import FAINT
from pushplan.util.arrays import FloatArray
from pushplan.util.printable import cut

COLOURS = ("#3b6ea8", "#d1762c", "#4d8f4a", "#a64d79", "#7a6a4f", "#4aa3a3", "#8a63b0", "#b03a48")

SHORTEST = 1e-5
"""Smallest drawn time, s; shorter times are drawn there."""

BEFORE = 0.8
"""Start of a time axis, as a multiple of the earliest first path."""

LEAST_SOLVED = 0.5
"""Share of runs with a path from which on costs are drawn: with fewer, the median is misleading."""


def plots_of(results: Results, folder: Path) -> list[tuple[str, str, str]]:
    """Write the plots as SVG and PDF; without a valid run, write none.

    Args:
        results: Results to plot.
        folder: Existing folder of the files.

    Returns:
        Title, file name without suffix, and image as data URI of each plot.
    """
    if not (results.runs.outcome == OK).any():
        return []
    width, height = 5.2, 3.3
    bottom, right, top = 0.5, 0.15, 0.3
    plots = []
    for name, title, left, draw in (
        ("success", "Success", 0.62, _draw_success),
        ("cost", "Cost: median and quartiles", 0.62, _draw_cost),
        ("first-path", "First path: quartiles, 5 to 95 %, runs", 1.2, _draw_first),  # room for twelve wide letters
        ("margin", "Margin against cost", 0.62, _draw_margins),
    ):
        for path in (folder / f"{name}.pdf", folder / f"{name}.svg"):
            with figure_for(path, width, height) as figure:
                axes = axes_at(figure, left, bottom, width - left - right, height - bottom - top)
                axes.set_title(title, loc="left")
                axes.grid(color=FAINT, alpha=0.25, linewidth=0.5)
                draw(axes, results)
                if axes.get_legend_handles_labels()[0]:
                    axes.legend(loc="best", frameon=True)  # a frame sets its markers apart from the plot's points
        plots.append((title, name, data_uri(path.read_bytes(), "svg+xml")))
    return plots


def _coloured(results: Results) -> Iterator[tuple[str, str, pd.DataFrame, pd.DataFrame]]:
    """Yield the name of each planner, its colour, its runs and its valid runs, for planners with results."""
    for i, planner in enumerate(results.planners):
        runs = results.of(planner)
        if (runs.outcome != MISSING).any():
            yield planner, COLOURS[i % len(COLOURS)], runs, runs[runs.outcome == OK]


def _span(results: Results) -> tuple[float, float]:
    """Return start and end (s) of an axis of planning time; it starts just before the earliest first path."""
    start = BEFORE * max(float(results.runs["first"].min()), SHORTEST)
    return start, max(results.time_limit, 2.0 * start)


def _draw_success(axes: Axes, results: Results) -> None:
    """Draw the share of runs with a valid path over the planning time."""
    start, end = _span(results)
    for planner, colour, runs, valid in _coloured(results):
        times = np.sort(valid["first"])
        steps = np.clip(np.concatenate([[start], times, [end]]), start, None)
        shares = np.concatenate([[0.0], np.arange(1, len(times) + 1), [len(times)]]) / max(len(runs), 1)
        axes.step(steps, shares, where="post", color=colour, label=planner)
    axes.set(xscale="log", xlim=(start, end), ylim=(0.0, 1.03))
    axes.set(xlabel="planning time [s]", ylabel="share of runs solved")


def _draw_cost(axes: Axes, results: Results) -> None:
    """Draw median and quartiles of the ratio of cost to the lowest known cost over the planning time."""
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
    """Return the quartiles (3, t) of costs over time, as multiples of the lowest known cost.

    They are infinite until enough runs have a path: half of them for the median, three quarters for the upper
    quartile. Problems that no planner solved are left out.
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
    axes.set_xlim(low / room, high * room)  # at least a decade: long numbers would touch on a shorter axis
    axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))  # more numbers in a decade would touch
    axes.set_yticks(range(len(shown)), [cut(planner, 12) for planner in shown], fontsize=7.0)
    axes.tick_params(axis="y", pad=2, length=0)


def _draw_margins(axes: Axes, results: Results) -> None:
    """Draw the smallest margin of each valid run against the ratio of its cost to the lowest known cost."""
    lowest = 0.0
    for planner, colour, _, valid in _coloured(results):
        axes.plot(valid.excess, valid.min_margin, "o", color=colour, markersize=3.0, alpha=0.6, label=planner)
        lowest = min(lowest, valid.min_margin.min())
    axes.margins(0.08)
    axes.set(xlabel="cost / lowest known", ylabel="smallest margin (slips at 0)")
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]) if lowest < 0.0 else 0.0)


def data_uri(image: bytes, kind: str) -> str:
    """Return an image as a data URI."""
    return f"data:image/{kind};base64,{base64.b64encode(image).decode()}"
