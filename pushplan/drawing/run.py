"""The picture of a planned push: the floor with the swept chain, the stable set, the margin over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pushplan.drawing.chain import GOAL_COLOUR, OBJECT_COLOUR, draw_chain, draw_contacts
from pushplan.drawing.cor import SENSE_NAMES, SENSES, style_cor_axes
from pushplan.drawing.figure import FAINT, INK, axes_at, equal_ticks, figure_for
from pushplan.drawing.segments import ALONE_COLOUR, PUSHED_COLOUR, draw_ends, draw_robot, draw_segments
from pushplan.drawing.sets import draw_sets
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
from pushplan.stable_sets.cor_window import default_window
from pushplan.stable_sets.stable_set import StableSet

if TYPE_CHECKING:
    from pushplan.execution import Execution
    from pushplan.result import PlanResult
    from pushplan.scenario import Scenario

# The layout, in inches.
_LEFT, _BOTTOM, _TOP, _RIGHT, _GAP = 0.62, 0.92, 0.34, 0.2, 0.72
_FLOOR_HEIGHT, _SIDE_WIDTH, _MARGIN_HEIGHT = 4.0, 1.75, 0.95
_ROW = 0.2  # of the legend, which has two of them for several pushes
_SENTENCE, _SMALL = 0.26, 5.0  # height above the lower edge; size of letters in points
_LEGEND = {"ncols": 6, "handlelength": 1.4, "columnspacing": 1.4, "handletextpad": 0.5, "borderaxespad": 0.0}


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
    view = view_box(scenario, plan.path)
    width = _FLOOR_HEIGHT * (view[2] - view[0]) / (view[3] - view[1])
    side = _LEFT + width + _GAP
    bottom = _BOTTOM + (_ROW if plan.segments else 0.0)
    with figure_for(path, side + _SIDE_WIDTH + _RIGHT, bottom + _FLOOR_HEIGHT + _TOP) as figure:
        floor = axes_at(figure, _LEFT, bottom, width, _FLOOR_HEIGHT)
        _draw_floor(floor, scenario, plan, view)
        above = bottom + _MARGIN_HEIGHT + _GAP
        beside = axes_at(figure, side, above, _SIDE_WIDTH, bottom + _FLOOR_HEIGHT - above)
        draw_set(beside, scenario.chain, scenario.stable_set(plan.stable_set))
        if execution is not None:
            curve = axes_at(figure, side, bottom, _SIDE_WIDTH, _MARGIN_HEIGHT)
            bar = axes_at(figure, side + _SIDE_WIDTH + 0.05, bottom, 0.07, _MARGIN_HEIGHT)
            _draw_margins(floor, curve, bar, execution)
        corner = (_LEFT / figure.get_figwidth(), 0.04 / figure.get_figheight())
        if plan.tolerance is not None:
            _tell_tolerance(figure, plan.tolerance.sentence, bottom - _BOTTOM)
        figure.legend(handles=_legend(scenario, plan), loc="lower left", bbox_to_anchor=corner, **_LEGEND)


def _tell_tolerance(figure: Figure, sentence: str, raised: float) -> None:
    """Write what the plan bears above the legend."""
    x, y = _LEFT / figure.get_figwidth(), (_SENTENCE + raised) / figure.get_figheight()
    figure.text(x, y, f"bears {sentence}", fontsize=_SMALL, color=INK, va="bottom", wrap=True)


def _draw_floor(axes: Axes, scenario: Scenario, plan: PlanResult, view: Box) -> None:
    axes.set_xlim(view[0], view[2])
    axes.set_ylim(view[1], view[3])
    equal_ticks(axes, max(view[2] - view[0], view[3] - view[1]))
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(_title(scenario, plan), loc="left")
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
    draw_chain(axes, scenario.chain, scenario.start)
    draw_chain(axes, scenario.chain, scenario.goal.pose_chain, fill=GOAL_COLOUR)


def _title(scenario: Scenario, plan: PlanResult) -> str:
    if plan.path is None or plan.trajectory is None:
        return f"{scenario.name}: no plan"
    if plan.segments:
        count = sum(segment.pushes for segment in plan.segments)
        pushed = f"{plan.way_pushed:.2f} m in {count} push{'es' if count > 1 else ''}"
        return f"{scenario.name}: {pushed}, {plan.trajectory.duration:.1f} s"
    return f"{scenario.name}: {plan.path.cost:.2f} m in {plan.trajectory.duration:.1f} s"


def draw_set(axes: Axes, chain: Chain, stable: StableSet) -> None:
    """Draw a stable set with the chain and its friction cones, in the chain frame."""
    window = default_window(chain, [stable])
    draw_sets(axes, [stable], window)
    draw_chain(axes, chain)
    draw_contacts(axes, chain)
    style_cor_axes(axes, window)
    axes.set_xlabel("")
    axes.set_ylabel("")
    axes.set_title(f"stable CORs [m], {stable.name}", loc="left")


def _draw_margins(floor: Axes, curve: Axes, bar: Axes, execution: Execution) -> None:
    margins = execution.margins.min(axis=1)
    by_time = np.stack([execution.t, margins], axis=1)
    line = draw_by_margin(curve, by_time, margins, {"color": FAINT, "linewidth": 0.6})
    if execution.loads is None:
        draw_by_margin(floor, execution.poses[:, :2], margins, {"color": "white", "linewidth": 3.6})
    curve.set_xlim(0.0, max(float(execution.t[-1]), 1e-3))
    curve.set_ylim(min(0.0, float(margins.min())), max(1.05 * float(margins.max()), 1e-3))
    curve.set_xlabel("time [s]")
    curve.set_title("stability margin", loc="left")
    curve.spines[["top", "right"]].set_visible(False)
    colours = bar.figure.colorbar(line, cax=bar)
    colours.outline.set_visible(False)
    colours.set_ticks([])


def _ways(plan: PlanResult) -> list[Artist]:
    """What the lines of several pushes are."""
    if not plan.segments:
        return []
    return [
        Line2D([], [], color=PUSHED_COLOUR, linewidth=1.8, label="pushed"),
        Line2D([], [], color=ALONE_COLOUR, linewidth=0.9, linestyle=(0, (4, 2)), label="robot alone"),
    ]


def _legend(scenario: Scenario, plan: PlanResult) -> list[Artist]:
    return [
        Patch(facecolor=OBJECT_COLOUR, edgecolor=INK, label="start"),
        Patch(facecolor=GOAL_COLOUR, edgecolor=INK, label="goal"),
        *_ways(plan),
        Patch(facecolor=SWEPT_COLOUR, edgecolor=FAINT, label="swept")
        if plan.path is not None
        else Line2D([], [], color=FAINT, linewidth=0.8, label="search tree"),
        *obstacle_keys(scenario),
        *(Patch(facecolor=SENSES[s], alpha=0.35, label=SENSE_NAMES[s]) for s in SENSES),
    ]
