"""A plan of several pushes on the floor: pushes solid, the robot's own ways dashed, the load's poses numbered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from pushplan.drawing.chain import CARRIED_COLOURS, GOAL_COLOUR, OBJECT_COLOUR, outline_width
from pushplan.drawing.cor import polygon_patches
from pushplan.drawing.figure import HALO, INK
from pushplan.drawing.palette import ALONE
from pushplan.drawing.world import SWEPT_COLOUR
from pushplan.geometry.se2 import compose, transform_points
from pushplan.mechanics.chain import PushedObject
from pushplan.util.arrays import FloatArray

if TYPE_CHECKING:
    from pushplan.plans.result import PlanResult
    from pushplan.plans.segment import Segment
    from pushplan.scenario.model import Scenario

PUSHED_COLOUR = "#1d4f7c"

_SPACING = 0.01
"""Path cost between the poses that a line runs through, and whose union is filled, m."""
_NUMBER: dict[str, Any] = {"ha": "center", "va": "center", "bbox": HALO}


def draw_segments(axes: Axes, scenario: Scenario, plan: PlanResult) -> None:
    """Draw start, goal and all segments of a plan."""
    pushes = [segment for segment in plan.segments if segment.pushes]
    for patch in polygon_patches(shapely.union_all([_swept(scenario, push) for push in pushes])):
        patch.set(facecolor=SWEPT_COLOUR, edgecolor="none", zorder=1.0)
        axes.add_patch(patch)
    for segment in plan.segments:
        line = segment.robot_path.sampled(_SPACING)
        if segment.pushes:
            line = compose(segment.load_at(line), np.append(_middle(scenario, segment.objects), 0.0))
            axes.plot(*line[:, :2].T, color=PUSHED_COLOUR, linewidth=1.8, zorder=6.0)
        else:
            axes.plot(*line[:, :2].T, color=ALONE, linewidth=0.9, linestyle=(0, (4, 2)), zorder=5.0)
    last = {push.objects: k for k, push in enumerate(pushes, start=1)} or {(): 0}
    for objects in last:
        _draw_numbered(axes, scenario, scenario.start, objects, 0, last=False)
    for k, push in enumerate(pushes, start=1):
        _draw_numbered(axes, scenario, push.load_after, push.objects, k, last=k == last[push.objects])


def _draw_numbered(
    axes: Axes, scenario: Scenario, pose: FloatArray, objects: tuple[str, ...], number: int, last: bool
) -> None:
    """Draw the load, after so many pushes, with their number."""
    _draw_load(axes, scenario, pose, GOAL_COLOUR if last else OBJECT_COLOUR, objects)
    x, y = transform_points(pose, _middle(scenario, objects))
    axes.text(float(x), float(y), str(number), fontsize=6.5, color=INK, zorder=8.0, **_NUMBER)


def draw_ends(axes: Axes, scenario: Scenario) -> None:
    """Draw the robot where it starts, and the load at start and goals."""
    assert scenario.pushes is not None
    draw_robot(axes, scenario)
    _draw_load(axes, scenario, scenario.start, OBJECT_COLOUR)
    for goal in scenario.pushes.goals:
        _draw_load(axes, scenario, goal.pose_chain, GOAL_COLOUR, goal.objects)


def draw_robot(axes: Axes, scenario: Scenario) -> None:
    """Draw the robot and its plate where it starts."""
    width = outline_width(axes, scenario.chain)
    for body in scenario.chain.carried:
        outline = transform_points(scenario.robot_start, body.outline)
        colour = CARRIED_COLOURS[body.kind]
        axes.add_patch(Polygon(outline, facecolor=colour, edgecolor=INK, linewidth=width, zorder=3.5))


def _draw_load(
    axes: Axes, scenario: Scenario, pose: FloatArray, fill: str, objects: tuple[str, ...] = ()
) -> None:
    width = outline_width(axes, scenario.chain)
    for obj in _moved(scenario, objects):
        outline = transform_points(pose, obj.outline_chain)
        axes.add_patch(Polygon(outline, facecolor=fill, edgecolor=INK, linewidth=width, zorder=3.0))


def _moved(scenario: Scenario, objects: tuple[str, ...]) -> list[PushedObject]:
    """Return the objects of these names, or all of them where there is no name."""
    return [obj for obj in scenario.chain.objects if obj.name in objects or not objects]


def _middle(scenario: Scenario, objects: tuple[str, ...]) -> FloatArray:
    """Middle (2,) of the objects of these names, or of all, in their frame."""
    points = np.concatenate([obj.outline_chain for obj in _moved(scenario, objects)])
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def _swept(scenario: Scenario, push: Segment) -> shapely.Geometry:
    """What robot and load pass over in a push."""
    robot = push.robot_path.sampled(_SPACING)
    carrying = [body.outline for body in scenario.chain.carried]
    loads = [obj.outline_chain for obj in _moved(scenario, push.objects)]
    outlines = [
        shapely.Polygon(transform_points(at, outline))
        for pose, load in zip(robot, push.load_at(robot), strict=True)
        for at, these in ((pose, carrying), (load, loads))
        for outline in these
    ]
    return shapely.union_all(outlines)
