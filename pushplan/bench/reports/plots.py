"""The pictures of a report: what share is solved, and how good paths are, over time; margins against costs."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from pushplan.bench.reports.statistics import percentiles
from pushplan.bench.storage.results import Results, RunRow
from pushplan.drawing.figure import axes_at, figure_for
from pushplan.drawing.palette import FAINT
from pushplan.util.arrays import FloatArray
from pushplan.util.printable import cut

COLOURS = ("#3b6ea8", "#d1762c", "#4d8f4a", "#a64d79", "#7a6a4f", "#4aa3a3", "#8a63b0", "#b03a48")

SHORTEST = 1e-5
"""Times below this (s) are drawn there."""

GRID = 200
"""Points in time at which curves are drawn."""

LEAST_SOLVED = 0.5
"""Share of runs that must have a path before costs over time are drawn: of fewer, the median would mislead."""

_WIDTH, _HEIGHT = 5.2, 3.3
_LEFT, _BOTTOM, _RIGHT, _TOP = 0.62, 0.5, 0.15, 0.3

_NAME = 12
"""Letters of a planner's name that fit beside a plot."""

Draw = Callable[[Axes, Results], None]


def picture(draw: Draw, results: Results, title: str) -> str:
    """Return a picture as the address of an image that holds itself (a data URI)."""

    def whole(figure: Figure) -> None:
        axes = axes_at(figure, _LEFT, _BOTTOM, _WIDTH - _LEFT - _RIGHT, _HEIGHT - _BOTTOM - _TOP)
        axes.set_title(title, loc="left")
        axes.grid(color=FAINT, alpha=0.25, linewidth=0.5)
        draw(axes, results)
        handles, _ = axes.get_legend_handles_labels()
        if handles:
            axes.legend(loc="best")

    return embedded(whole, _WIDTH, _HEIGHT)


def embedded(draw: Callable[[Figure], None], width: float, height: float) -> str:
    """Return a figure of so many inches as a data URI."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.svg"
        with figure_for(path, width, height) as figure:
            draw(figure)
        return data_uri(path.read_bytes(), "svg+xml")


def data_uri(image: bytes, kind: str) -> str:
    """Return the address of an image that holds itself."""
    return f"data:image/{kind};base64,{base64.b64encode(image).decode()}"


def _colour(results: Results, planner: str) -> str:
    return COLOURS[results.planners.index(planner) % len(COLOURS)]


def draw_success(axes: Axes, results: Results) -> None:
    """Draw the share of runs that have found a (valid) path over the planning time."""
    end = results.time_limit
    for planner in results.planners:
        runs = results.of(planner)
        times = np.sort([run.first_time for run in runs if run.solved])
        steps = np.clip(np.concatenate([[SHORTEST], times, [max(end, SHORTEST)]]), SHORTEST, None)
        shares = np.concatenate([[0.0], np.arange(1, len(times) + 1), [len(times)]]) / max(len(runs), 1)
        axes.step(steps, shares, where="post", color=_colour(results, planner), label=planner)
    axes.set(xscale="log", xlim=(SHORTEST, end), ylim=(0.0, 1.03))
    axes.set(xlabel="planning time [s]", ylabel="share of runs solved")


def draw_cost(axes: Axes, results: Results) -> None:
    """Draw the median and the quartiles of cost over the lowest known one, over the planning time."""
    times = np.geomspace(SHORTEST, max(results.time_limit, 2.0 * SHORTEST), GRID)
    for planner in results.planners:
        quartiles = cost_quartiles(results, results.of(planner), times)
        colour = _colour(results, planner)
        seen = np.isfinite(quartiles[1])
        if not seen.any():
            continue
        axes.plot(times[seen], quartiles[1, seen], color=colour, label=planner)
        band = seen & np.isfinite(quartiles[2])
        axes.fill_between(
            times[band], quartiles[0, band], quartiles[2, band], color=colour, alpha=0.2, linewidth=0.0
        )
    axes.set(xscale="log", xlim=(times[0], times[-1]))
    axes.set(xlabel="planning time [s]", ylabel="cost / lowest known")


def cost_quartiles(results: Results, runs: list[RunRow], times: FloatArray) -> FloatArray:
    """Return the quartiles (3, t) of costs, as multiples of the lowest known, over time.

    Infinite where not enough runs have a path yet: half of them for the median, three quarters for the band.
    """
    some = [run for run in runs if np.isfinite(results.best_costs[run.problem])]  # the others say nothing
    curves = np.array([_best_over_time(run, times) / results.best_costs[run.problem] for run in some])
    if len(curves) == 0:
        return np.full((3, len(times)), np.inf)
    quartiles = np.array([percentiles(curve, (25, 50, 75)) for curve in curves.T]).T
    enough = np.isfinite(curves).mean(axis=0) >= LEAST_SOLVED
    return np.where(enough, quartiles, np.inf)


def _best_over_time(run: RunRow, times: FloatArray) -> FloatArray:
    """Return the cost (t,) of the best path known at each time; infinite before the first and of unsolved runs."""
    if not run.solved or len(run.progress) == 0:
        return np.full(len(times), np.inf)
    index = np.searchsorted(run.progress[:, 0], times, side="right") - 1
    return np.where(index >= 0, run.progress[np.maximum(index, 0), 1], np.inf)


def draw_first_times(axes: Axes, results: Results) -> None:
    """Draw the times to the first path as boxes over their quartiles, whiskers from 5 to 95 %, and points."""
    shown = [planner for planner in results.planners if any(run.solved for run in results.of(planner))]
    rng = np.random.default_rng(0)
    for i, planner in enumerate(shown):
        times = np.maximum([run.first_time for run in results.of(planner) if run.solved], SHORTEST)
        colour = _colour(results, planner)
        low, left, middle, right, high = percentiles(times, (5, 25, 50, 75, 95))
        axes.plot([low, high], [i, i], color=colour, linewidth=1.0)
        axes.barh(i, right - left, left=left, height=0.5, color=colour, alpha=0.3)
        axes.plot([middle, middle], [i - 0.25, i + 0.25], color=colour, linewidth=2.0)
        axes.plot(times, i + rng.uniform(-0.2, 0.2, len(times)), ".", color=colour, markersize=2.5, alpha=0.6)
    axes.set(xscale="log", xlabel="time to the first path [s]", ylim=(len(shown) - 0.4, -0.6))
    axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))  # within a decade more numbers would touch
    axes.set_yticks(range(len(shown)), [cut(planner, _NAME) for planner in shown], fontsize=7.0)
    axes.tick_params(axis="y", pad=2, length=0)


def draw_margins(axes: Axes, results: Results) -> None:
    """Draw the smallest margin of each solved run against its cost over the lowest known one; contacts slip at 0."""
    for planner in results.planners:
        runs = [run for run in results.of(planner) if run.solved]
        costs = [results.excess(run) for run in runs]
        margins = [run.values["min_margin"] for run in runs]
        axes.plot(
            costs, margins, "o", color=_colour(results, planner), markersize=3.0, alpha=0.6, label=planner
        )
    axes.margins(0.08)
    axes.set(xlabel="cost / lowest known", ylabel="smallest margin (slips at 0)")
    negative = any(run.solved and run.values["min_margin"] < 0.0 for run in results.runs)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]) if negative else 0.0)
