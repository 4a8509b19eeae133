"""The picture of a push problem before it is planned: start, goal, what is in the way, and the stable set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes

from pushplan.drawing.chain import GOAL_COLOUR, draw_chain, thinnest_in_points
from pushplan.drawing.figure import HALO, INK, axes_at, equal_ticks, figure_for, letters_across
from pushplan.drawing.footer import chain_keys, draw_footer, turn_keys
from pushplan.drawing.segments import draw_ends
from pushplan.drawing.sets import draw_set
from pushplan.drawing.world import draw_surroundings, obstacle_keys, view_box
from pushplan.geometry.se2 import transform_points
from pushplan.scenario.model import Scenario
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray
from pushplan.util.printable import cut

# The layout, in inches.
_LEFT, _TOP, _RIGHT, _GAP, _AXIS = 0.62, 0.34, 0.2, 0.72, 0.52
_HEIGHT, _SIDE_WIDTH = 4.0, 2.6
_ACROSS = 14
"""Letters of a name that is written across the push; one along it may have twice as many."""
_LEGIBLE = 6.0
"""Least width of the thinnest object with names written into objects, points."""


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
    full = side + _SIDE_WIDTH + _RIGHT
    with figure_for(path, full, _HEIGHT) as figure:
        keys = [*chain_keys(scenario.chain), *obstacle_keys(scenario), *turn_keys()]
        bottom = draw_footer(figure, _LEFT, keys) + _AXIS
        figure.set_size_inches(full, bottom + _HEIGHT + _TOP)
        floor = axes_at(figure, _LEFT, bottom, width, _HEIGHT)
        floor.set(xlim=view[::2], ylim=view[1::2], xlabel="x [m]", ylabel="y [m]")
        floor.set_title(cut(scenario.name, letters_across(floor, 10.0)), loc="left")
        equal_ticks(floor, max(view[2] - view[0], view[3] - view[1]))
        draw_surroundings(floor, scenario)
        if scenario.pushes is None:
            draw_chain(floor, scenario.chain, scenario.start)
            draw_chain(floor, scenario.chain, scenario.goal.pose_chain, fill=GOAL_COLOUR)
        else:
            draw_ends(floor, scenario)
        chain = axes_at(figure, side, bottom, _SIDE_WIDTH, _HEIGHT)
        draw_set(chain, scenario.chain, stable)
        _draw_names(chain, scenario)


def _draw_names(axes: Axes, scenario: Scenario) -> None:
    """Write every object's name into it, in the chain frame, if there is room; across the push if they are many."""
    objects = scenario.chain.objects
    if thinnest_in_points(axes, scenario.chain) < _LEGIBLE:
        return
    turned, letters = (90.0, _ACROSS) if len(objects) > 2 else (0.0, 2 * _ACROSS)
    for obj in objects:
        place = transform_points(obj.pose_chain, _inside(obj.outline)[None])[0]
        _write(axes, place, cut(obj.name, letters), turned)


def _inside(outline: FloatArray) -> FloatArray:
    """Return a point (2,) inside an outline, its centroid where that is inside."""
    polygon = shapely.Polygon(outline)
    point = polygon.centroid if polygon.contains(polygon.centroid) else polygon.representative_point()
    return np.array([point.x, point.y])


def _write(axes: Axes, place: FloatArray, text: str, turned: float) -> None:
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6.5, "clip_on": True, "bbox": HALO}
    axes.text(float(place[0]), float(place[1]), text, rotation=turned, color=INK, zorder=8.0, **style)
