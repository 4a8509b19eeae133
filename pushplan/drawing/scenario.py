"""The picture of a push problem before it is planned: start, goal, what is in the way, and the stable set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from pushplan.basics.arrays import FloatArray
from pushplan.drawing.chain import GOAL_COLOUR, OBJECT_COLOUR, PLATE_COLOUR, ROBOT_COLOUR, draw_chain
from pushplan.drawing.cor import SENSE_NAMES, SENSES
from pushplan.drawing.figure import HALO, INK, axes_at, equal_ticks, figure_for
from pushplan.drawing.run import draw_set
from pushplan.drawing.segments import draw_ends
from pushplan.drawing.world import draw_surroundings, obstacle_keys, view_box
from pushplan.geometry.se2 import transform_points
from pushplan.scenario import Scenario
from pushplan.stable_sets.stable_set import StableSet

# The layout, in inches.
_LEFT, _BOTTOM, _TOP, _RIGHT, _GAP = 0.62, 0.86, 0.34, 0.2, 0.72
_HEIGHT, _SIDE_WIDTH = 4.0, 2.6
_LEGEND = {"ncols": 7, "handlelength": 1.4, "columnspacing": 1.4, "handletextpad": 0.5, "borderaxespad": 0.0}


def plot_scenario(scenario: Scenario, stable: StableSet, path: str | Path) -> None:
    """Draw what was understood of a scenario: the floor with start and goal, and the chain with its stable set.

    Args:
        scenario: The problem.
        stable: A stable set of its chain.
        path: File to write; its suffix says whether PNG, SVG or PDF.

    Raises:
        PlotError: On a suffix that is none of these.
    """
    view = view_box(scenario, None)
    width = _HEIGHT * (view[2] - view[0]) / (view[3] - view[1])
    side = _LEFT + width + _GAP
    with figure_for(path, side + _SIDE_WIDTH + _RIGHT, _BOTTOM + _HEIGHT + _TOP) as figure:
        floor = axes_at(figure, _LEFT, _BOTTOM, width, _HEIGHT)
        floor.set(xlim=view[::2], ylim=view[1::2], xlabel="x [m]", ylabel="y [m]")
        floor.set_title(scenario.name, loc="left")
        equal_ticks(floor, max(view[2] - view[0], view[3] - view[1]))
        draw_surroundings(floor, scenario)
        if scenario.pushes is None:
            draw_chain(floor, scenario.chain, scenario.start)
            draw_chain(floor, scenario.chain, scenario.goal.pose_chain, fill=GOAL_COLOUR)
        else:
            draw_ends(floor, scenario)
        chain = axes_at(figure, side, _BOTTOM, _SIDE_WIDTH, _HEIGHT)
        draw_set(chain, scenario.chain, stable)
        _draw_names(chain, scenario)
        corner = (_LEFT / figure.get_figwidth(), 0.04 / figure.get_figheight())
        figure.legend(handles=_legend(scenario), loc="lower left", bbox_to_anchor=corner, **_LEGEND)


def _draw_names(axes: Axes, scenario: Scenario) -> None:
    """Write every object's name into it, in the chain frame; across the push when there are many in a row."""
    objects = scenario.chain.objects
    turned = 90.0 if len(objects) > 2 else 0.0
    for obj in objects:
        _write(axes, transform_points(obj.pose_chain, _inside(obj.outline)[None])[0], obj.name, turned)


def _inside(outline: FloatArray) -> FloatArray:
    """Return a point (2,) inside an outline, its centroid where that is inside."""
    polygon = shapely.Polygon(outline)
    point = polygon.centroid if polygon.contains(polygon.centroid) else polygon.representative_point()
    return np.array([point.x, point.y])


def _write(axes: Axes, place: FloatArray, text: str, turned: float) -> None:
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6.5, "clip_on": True, "bbox": HALO}
    axes.text(float(place[0]), float(place[1]), text, rotation=turned, color=INK, zorder=8.0, **style)


def _legend(scenario: Scenario) -> list[Patch]:
    robot = (
        [Patch(facecolor=ROBOT_COLOUR, edgecolor=INK, label="robot")]
        if scenario.chain.pusher.footprint
        else []
    )
    return [
        *robot,
        Patch(facecolor=PLATE_COLOUR, edgecolor=INK, label="pusher"),
        Patch(facecolor=OBJECT_COLOUR, edgecolor=INK, label="start"),
        Patch(facecolor=GOAL_COLOUR, edgecolor=INK, label="goal"),
        *obstacle_keys(scenario),
        *(Patch(facecolor=SENSES[s], alpha=0.35, label=SENSE_NAMES[s]) for s in SENSES),
    ]
