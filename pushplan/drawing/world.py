"""The floor seen from above: workspace, obstacles, and what the chain sweeps on its way from start to goal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from pushplan.drawing.cor import polygon_patches
from pushplan.drawing.figure import FAINT, INK
from pushplan.mechanics.chain import Chain
from pushplan.plans.path import PushPath
from pushplan.scenario.model import CircleObstacle, Obstacle, PolygonObstacle, Scenario
from pushplan.util.arrays import FloatArray

Box = tuple[float, float, float, float]
"""(xmin, ymin, xmax, ymax) in the world, m."""

OBSTACLE_COLOUR = "#c3c9d1"
OBSTACLE_EDGE = "#8b939d"
OBSTACLE_LOOK: dict[str, Any] = {"facecolor": OBSTACLE_COLOUR, "edgecolor": OBSTACLE_EDGE}
UNKNOWN_LOOK: dict[str, Any] = {"facecolor": "none", "edgecolor": OBSTACLE_COLOUR, "hatch": "////"}
SWEPT_COLOUR = "#f3eee2"
MARGIN_COLOURS = LinearSegmentedColormap.from_list("margin", ["#b5352c", "#e0a04a", "#4f9d8c", "#1d4f7c"])
"""From the edge of the stable set to deep inside it."""

_SWEEP_SPACING = 0.01
"""Path cost between the poses whose union is filled, m."""
_GHOSTS = 9
"""Poses between start and goal that are outlined."""
_JUMP = 0.1
"""Change of the margin between two samples, as a share of the largest margin, that counts as a jump."""
_ASPECTS = 1.0, 1.6
"""Least and largest width of the view over its height."""


def view_box(scenario: Scenario, path: PushPath | None) -> Box:
    """Return what to show: the workspace, or everything there is; wider or taller where that is a thin strip."""
    area = scenario.workspace
    if area is not None:
        low, high = np.array([area.xmin, area.ymin]), np.array([area.xmax, area.ymax])
    else:
        low, high = _extent(scenario, path)
    size = np.maximum(high - low, [(high - low)[1] * _ASPECTS[0], (high - low)[0] / _ASPECTS[1]])
    (x0, y0), (x1, y1) = (low + high - size) / 2.0, (low + high + size) / 2.0
    return (float(x0), float(y0), float(x1), float(y1))


def draw_surroundings(axes: Axes, scenario: Scenario) -> None:
    """Draw the workspace's walls and the obstacles."""
    area = scenario.workspace
    if area is not None:
        size = area.xmax - area.xmin, area.ymax - area.ymin
        axes.add_patch(
            Rectangle((area.xmin, area.ymin), *size, fill=False, edgecolor=OBSTACLE_EDGE, linewidth=1.4)
        )
    for obstacle in scenario.obstacles:
        patch = _patch(obstacle)
        patch.set(linewidth=0.8, zorder=2.0, **(UNKNOWN_LOOK if _is_unknown(obstacle) else OBSTACLE_LOOK))
        axes.add_patch(patch)


def obstacle_keys(scenario: Scenario) -> list[Patch]:
    """Return the legend's entries for what is in the way."""
    unknown = {_is_unknown(obstacle) for obstacle in scenario.obstacles}
    keys = [Patch(**OBSTACLE_LOOK, label="obstacle")] if False in unknown else []
    return keys + ([Patch(**UNKNOWN_LOOK, label="unknown")] if True in unknown else [])


def _is_unknown(obstacle: Obstacle) -> bool:
    return isinstance(obstacle, PolygonObstacle) and obstacle.unknown


def draw_sweep(axes: Axes, chain: Chain, path: PushPath) -> None:
    """Fill everything that the chain passes over, and outline it faintly at even distances."""
    bodies = [
        shapely.Polygon(outline)
        for pose in path.sampled(_SWEEP_SPACING)
        for outline in chain.outlines_at(pose)
    ]
    for patch in polygon_patches(shapely.union_all(bodies)):
        patch.set(facecolor=SWEPT_COLOUR, edgecolor="none", zorder=1.0)
        axes.add_patch(patch)
    for pose in path.poses_at(np.linspace(0.0, path.cost, _GHOSTS + 2)[1:-1]):
        for outline in chain.outlines_at(pose):
            axes.add_patch(Polygon(outline, fill=False, edgecolor=INK, alpha=0.22, linewidth=0.6, zorder=1.5))


def draw_tree(axes: Axes, branches: FloatArray) -> None:
    """Draw the branches (q, 2, 3) of a search tree."""
    axes.add_collection(
        LineCollection(list(branches[:, :, :2]), colors=FAINT, linewidths=0.4, alpha=0.6, zorder=1.2)
    )


def draw_by_margin(
    axes: Axes, points: FloatArray, margins: FloatArray, under: Mapping[str, Any]
) -> LineCollection:
    """Draw a line through points (m, 2), coloured by the margins (m,), over a plain line in the style `under`.

    Where the margin jumps, as it does when the pusher stops and sets off differently, only the plain line is drawn.
    """
    top = max(float(margins.max()), 1e-6)
    smooth = np.abs(np.diff(margins)) < _JUMP * top
    axes.plot(*points.T, solid_capstyle="round", zorder=6.0, **under)
    line = LineCollection(
        list(np.stack([points[:-1], points[1:]], axis=1)[smooth]),
        cmap=MARGIN_COLOURS,
        norm=Normalize(0.0, top),
        linewidths=2.0,
        capstyle="round",
        zorder=6.1,
    )
    line.set_array(np.minimum(margins[:-1], margins[1:])[smooth])
    axes.add_collection(line)
    return line


def _patch(obstacle: Obstacle) -> Patch:
    if isinstance(obstacle, CircleObstacle):
        x, y = obstacle.center
        return Circle((x, y), obstacle.radius)
    return Polygon(obstacle.outline)


def _extent(scenario: Scenario, path: PushPath | None) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a box around everything that is drawn, with some air."""
    poses = [scenario.start, scenario.goal.pose_chain, *([] if path is None else path.sampled(0.05))]
    poses += [] if scenario.pushes is None else [scenario.robot_start]
    points = [outline for pose in poses for outline in scenario.chain.outlines_at(pose)]
    points += [_corners(obstacle) for obstacle in scenario.obstacles]
    low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
    air = 0.03 * float((high - low).max())
    return low - air, high + air


def _corners(obstacle: Obstacle) -> FloatArray:
    if isinstance(obstacle, CircleObstacle):
        return np.stack([obstacle.center - obstacle.radius, obstacle.center + obstacle.radius])
    return obstacle.outline
