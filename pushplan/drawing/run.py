"""The picture of a planned push: the floor with the swept chain, the stable set, the margin over time."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from pushplan.drawing.chain import GOAL_COLOUR, draw_chain, outline_width
from pushplan.drawing.figure import FAINT, INK, axes_at, equal_ticks, figure_for, letters_across
from pushplan.drawing.footer import chain_keys, draw_footer, turn_keys
from pushplan.drawing.palette import ALONE, NEAREST
from pushplan.drawing.segments import PUSHED_COLOUR, draw_ends, draw_robot, draw_segments
from pushplan.drawing.sets import draw_set
from pushplan.drawing.world import (
    SWEPT_COLOUR,
    Box,
    draw_by_margin,
    draw_surroundings,
    draw_sweep,
    draw_tree,
    obstacle_keys,
    view_box,
)
from pushplan.mechanics.chain import Chain
from pushplan.plans.path import PushPath
from pushplan.util.printable import cut

if TYPE_CHECKING:
    from pushplan.plans.execution import Execution
    from pushplan.plans.result import PlanResult
    from pushplan.scenario.model import Scenario

# The layout, in inches.
_LEFT, _TOP, _RIGHT, _GAP = 0.62, 0.34, 0.2, 0.72
_FLOOR_HEIGHT, _SIDE_WIDTH, _MARGIN_HEIGHT = 4.0, 1.75, 0.95
_AXIS = 0.52  # numbers and name of an axis
_WORDS = 6.0  # size of the letters that say why there is no plan, points
_LINES = 13  # of them
_NEAREST_SPACING = 0.02
"""Path cost between the poses that the nearest path is drawn through, m."""


def plot_plan(scenario: Scenario, plan: PlanResult, execution: Execution | None, path: str | Path) -> None:
    """Draw a plan: what is swept from start to goal, the margin on the way, and the stable set used.

    Args:
        scenario: The problem.
        plan: Its result; without a path, the search tree is drawn instead.
        execution: What the simulator made of it, or None; the margins are taken from it.
        path: File to write; its suffix says whether PNG, SVG or PDF.

    Raises:
        PlotError: On a suffix that is none of these.
    """
    view = view_box(scenario, plan.path or plan.approximate_path)
    width = _FLOOR_HEIGHT * (view[2] - view[0]) / (view[3] - view[1])
    side = _LEFT + width + _GAP
    full = side + _SIDE_WIDTH + _RIGHT
    with figure_for(path, full, _FLOOR_HEIGHT) as figure:
        bears = "" if plan.robustness is None else plan.robustness.sentence
        bottom = draw_footer(figure, _LEFT, _keys(scenario, plan), bears) + _AXIS
        figure.set_size_inches(full, bottom + _FLOOR_HEIGHT + _TOP)
        _draw_floor(axes_at(figure, _LEFT, bottom, width, _FLOOR_HEIGHT), scenario, plan, view)
        above = bottom + _MARGIN_HEIGHT + _GAP
        if not _stands_apart(plan):
            beside = axes_at(figure, side, above, _SIDE_WIDTH, bottom + _FLOOR_HEIGHT - above)
            draw_set(beside, scenario.chain, scenario.stable_set(plan.stable_set))
        if execution is not None:
            curve = axes_at(figure, side, bottom, _SIDE_WIDTH, _MARGIN_HEIGHT)
            bar = axes_at(figure, side + _SIDE_WIDTH + 0.05, bottom, 0.07, _MARGIN_HEIGHT)
            _draw_margins(figure.axes[0], curve, bar, execution)
        elif plan.path is None:
            _tell_why(axes_at(figure, side, bottom, _SIDE_WIDTH, _MARGIN_HEIGHT + 0.3), plan)


def _tell_why(axes: Axes, plan: PlanResult) -> None:
    """Write why there is no plan."""
    axes.axis("off")
    letters = letters_across(axes, _WORDS)
    lines = [line for sentence in plan.why_not for line in textwrap.wrap(sentence, letters)]
    text = "\n".join(lines if len(lines) <= _LINES else [*lines[: _LINES - 1], "…"])
    axes.text(0.0, 1.0, text, transform=axes.transAxes, fontsize=_WORDS, color=INK, va="top")


def _draw_floor(axes: Axes, scenario: Scenario, plan: PlanResult, view: Box) -> None:
    axes.set_xlim(view[0], view[2])
    axes.set_ylim(view[1], view[3])
    equal_ticks(axes, max(view[2] - view[0], view[3] - view[1]))
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(_title(scenario, plan, letters_across(axes, 10.0)), loc="left")
    draw_surroundings(axes, scenario)
    if scenario.pushes is not None:
        draw_robot(axes, scenario)
        if plan.segments:
            draw_segments(axes, scenario, plan)
        else:
            draw_ends(axes, scenario)
        return
    if plan.path is not None:
        draw_sweep(axes, scenario.chain, plan.path)
    else:
        draw_tree(axes, plan.tree)
        if plan.approximate_path is not None:
            _draw_nearest(axes, scenario.chain, plan.approximate_path)
    draw_chain(axes, scenario.chain, scenario.start)
    draw_chain(axes, scenario.chain, scenario.goal.pose_chain, fill=GOAL_COLOUR)


def _draw_nearest(axes: Axes, chain: Chain, path: PushPath) -> None:
    """Draw the path that comes nearest to the goal, and a ghost of the chain at its end."""
    way = path.sampled(_NEAREST_SPACING)[:, :2]
    axes.plot(*way.T, color=NEAREST, linewidth=1.4, zorder=6.0)
    look: Any = {
        "fill": False,
        "edgecolor": NEAREST,
        "linewidth": outline_width(axes, chain),
        "linestyle": "--",
    }
    for outline in chain.outlines_at(path.end):
        axes.add_patch(Polygon(outline, zorder=6.0, **look))


def _title(scenario: Scenario, plan: PlanResult, letters: int) -> str:
    outcome = f": {_outcome(plan)}"
    return cut(scenario.name, max(8, letters - len(outcome))) + outcome


def _outcome(plan: PlanResult) -> str:
    if plan.path is None or plan.trajectory is None:
        return "no plan"
    if plan.segments:
        count = sum(segment.pushes for segment in plan.segments)
        pushed = f"{plan.way_pushed:.2f} m in {count} push{'es' if count > 1 else ''}"
        return f"{pushed}, {plan.trajectory.duration:.1f} s"
    return f"{plan.path.cost:.2f} m in {plan.trajectory.duration:.1f} s"


def _draw_margins(floor: Axes, curve: Axes, bar: Axes, execution: Execution) -> None:
    margins = execution.margins.min(axis=1)
    by_time = np.stack([execution.t, margins], axis=1)
    line = draw_by_margin(curve, by_time, margins, {"color": FAINT, "linewidth": 0.6})
    if execution.loads is None:
        draw_by_margin(floor, execution.poses[:, :2], margins, {"color": "white", "linewidth": 3.6})
    curve.set_xlim(0.0, max(float(execution.t[-1]), 1e-3))
    curve.set_ylim(min(0.0, float(margins.min())), max(1.05 * float(margins.max()), 1e-3))
    curve.set_xlabel("time [s]")
    coloured = execution.loads is None
    curve.set_title("margin: the path's colour" if coloured else "stability margin", loc="left")
    curve.spines[["top", "right"]].set_visible(False)
    colours = bar.figure.colorbar(line, cax=bar)
    colours.outline.set_visible(False)
    colours.set_ticks([])


def _keys(scenario: Scenario, plan: PlanResult) -> list[Artist]:
    """Return the entries of the key: what is drawn, and nothing else."""
    turns = [] if _stands_apart(plan) else turn_keys()
    return [*chain_keys(scenario.chain), *_ways(plan), *obstacle_keys(scenario), *turns]


def _stands_apart(plan: PlanResult) -> bool:
    """Tell whether a plan moves objects apart from one another: there is no stable set of all of them."""
    return any(segment.objects for segment in plan.segments)


def _ways(plan: PlanResult) -> list[Artist]:
    """Return the entries for paths, and for what was found while they were sought."""
    keys: list[Artist] = []
    if plan.segments:
        keys.append(Line2D([], [], color=PUSHED_COLOUR, linewidth=1.8, label="pushed"))
        alone: Any = {"color": ALONE, "linewidth": 0.9, "linestyle": (0, (4, 2))}
        keys.append(Line2D([], [], label="robot alone", **alone))
    if plan.path is not None:
        return [*keys, Patch(facecolor=SWEPT_COLOUR, edgecolor=FAINT, label="swept")]
    if len(plan.tree):
        keys.append(Line2D([], [], color=FAINT, linewidth=0.8, label="search tree"))
    if plan.approximate_path is not None:
        keys.append(Line2D([], [], color=NEAREST, linewidth=1.4, label="nearest path"))
    return keys
