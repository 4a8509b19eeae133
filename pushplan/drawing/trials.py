"""The picture of trials: where the objects end, and where on the way contacts failed first."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from pushplan.drawing.chain import draw_chain
from pushplan.drawing.figure import FAINT, INK, axes_at, equal_ticks, figure_for
from pushplan.drawing.palette import contact_colours
from pushplan.drawing.world import draw_surroundings, draw_sweep, view_box
from pushplan.geometry.se2 import compose, transform_points

if TYPE_CHECKING:
    from pushplan.plans.path import PushPath
    from pushplan.sim.trials.result import Trials

_LEFT, _BOTTOM, _TOP, _RIGHT, _GAP = 0.62, 0.92, 0.4, 0.2, 0.72
_HEIGHT = 4.0
_ARRIVED, _MISSED = "#2f9a55", "#c8322b"
_WINDOW = 10.0
"""Half of the width of what is shown around the goal, in units of its tolerance, at most."""
_MOST = 400
"""Samples that are drawn."""


def plot_trials(trials: Trials, path: PushPath | None, file: str | Path) -> None:
    """Draw trials: the floor with the plan's way, and a closer look at where the objects end.

    Args:
        trials: What was tried.
        path: The plan's path.
        file: File to write; its suffix says whether PNG, SVG or PDF.

    Raises:
        PlotError: On a suffix that is none of these.
    """
    view = view_box(trials.scenario, path)
    width = _HEIGHT * (view[2] - view[0]) / (view[3] - view[1])
    total = _LEFT + width + _GAP + _HEIGHT + _RIGHT
    with figure_for(file, total, _BOTTOM + _HEIGHT + _TOP) as figure:
        floor = axes_at(figure, _LEFT, _BOTTOM, width, _HEIGHT)
        draw_surroundings(floor, trials.scenario)
        if path is not None:
            draw_sweep(floor, trials.scenario.chain, path)
        draw_chain(floor, trials.scenario.chain, trials.scenario.start)
        _draw_ends(floor, trials)
        _draw_failures(floor, trials)
        floor.set(xlim=view[::2], ylim=view[1::2], xlabel="x [m]", ylabel="y [m]", aspect="equal")
        low, high = trials.interval
        floor.set_title(
            f"arrives in {100 * trials.success:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)", loc="left"
        )
        close = axes_at(figure, _LEFT + width + _GAP, _BOTTOM, _HEIGHT, _HEIGHT)
        _draw_close(close, trials)
        corner = (_LEFT / figure.get_figwidth(), 0.04 / figure.get_figheight())
        figure.legend(handles=_legend(trials), loc="lower left", bbox_to_anchor=corner, ncols=5)


def _draw_ends(axes: Axes, trials: Trials) -> None:
    """Outline the objects where they end, one colour for samples that arrive and one for the others."""
    for arrived, colour in ((False, _MISSED), (True, _ARRIVED)):
        shown = trials.object_poses[trials.arrived == arrived][:_MOST]
        outlines = [
            transform_points(pose, obj.outline)
            for poses in shown
            for obj, pose in zip(trials.scenario.chain.objects, poses, strict=True)
        ]
        alpha = 0.5 if len(shown) < 20 else 0.15
        axes.add_collection(
            PolyCollection(
                outlines, facecolors="none", edgecolors=colour, linewidths=0.5, alpha=alpha, zorder=4.0
            )
        )


def _draw_failures(axes: Axes, trials: Trials) -> None:
    """Mark where contacts were the first to move."""
    colours = contact_colours(len(trials.scenario.chain.contacts))
    for loss in trials.losses:
        if loss is not None:
            axes.plot(*loss.point, marker="x", color=colours[loss.contact], markersize=5.0, zorder=7.0)


def _draw_close(axes: Axes, trials: Trials) -> None:
    """Draw the goal's surroundings, and the errors of the goal's object as points around its place."""
    scenario = trials.scenario
    places = compose(scenario.goal.pose_chain, scenario.chain.places)
    k = len(places) - 1 if scenario.goal.of is None else scenario.chain.index_of(scenario.goal.of)
    off = 1e3 * (trials.object_poses[:, k, :2] - places[k, :2])
    for arrived, colour in ((False, _MISSED), (True, _ARRIVED)):
        x, y = off[trials.arrived == arrived].T
        axes.plot(x, y, ".", color=colour, markersize=4.0, alpha=0.6, markeredgewidth=0.0, zorder=3.0)
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    ring = 1e3 * scenario.goal.position_tolerance * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    axes.add_patch(Polygon(ring, fill=False, edgecolor=INK, linewidth=0.9, zorder=4.0))
    axes.axhline(0.0, color=FAINT, linewidth=0.5)
    axes.axvline(0.0, color=FAINT, linewidth=0.5)
    reach = 1e3 * scenario.goal.position_tolerance
    far = 1.15 * float(np.clip(np.abs(off).max(), reach, _WINDOW * reach))
    outside = int((np.abs(off).max(axis=1) > far).sum())
    axes.set(xlim=(-far, far), ylim=(-far, far), xlabel="x off the goal [mm]", ylabel="y off the goal [mm]")
    axes.set_title(f"{scenario.chain.objects[k].name}: final places, {outside} outside", loc="left")
    axes.set_aspect("equal")
    equal_ticks(axes, 2.0 * far)


def _legend(trials: Trials) -> list[Line2D]:
    chain = trials.scenario.chain
    ends = [
        Line2D([], [], color=_ARRIVED, label="arrived"),
        Line2D([], [], color=_MISSED, label="missed the tolerance"),
        Line2D([], [], color=INK, linewidth=0.9, label="tolerance"),
    ]
    failing = {loss.contact for loss in trials.losses if loss is not None}
    colours = contact_colours(len(chain.contacts))
    return ends + [
        Line2D(
            [],
            [],
            color=colours[k],
            marker="x",
            linestyle="none",
            label=f"{chain.contact_name(k)} failed first",
        )
        for k in sorted(failing)
    ]
