"""What stands around the chain: workspace and obstacles, those of maps included."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.scenario.arrangement.shapes import outline_of
from pushplan.scenario.files import OUTSIDE
from pushplan.scenario.imported.ros_map import RosMap, ros_map_of
from pushplan.scenario.parts import CircleObstacle, Obstacle, PolygonObstacle, Workspace
from pushplan.scenario.schema.scenario import Obstacle as StatedObstacle
from pushplan.scenario.schema.scenario import StatedRoom
from pushplan.scenario.yaml.report import Report


class Stated(NamedTuple):
    """Workspace, None without one, and obstacles."""

    workspace: Workspace | None
    obstacles: tuple[Obstacle, ...]


def build_surroundings(file: StatedRoom, read: Callable[[str], bytes], report: Report) -> Stated:
    """Return what a file states, without the maps that cannot be read; why is reported.

    The workspace is the rectangle around all maps where none is stated: beyond a map nothing is known.
    """
    obstacles: list[Obstacle] = []
    areas: list[Workspace] = []
    for i, stated in enumerate(file.obstacles):
        if stated.map is None:
            obstacles.append(_obstacle(stated))
            continue
        found = _map(stated.map, stated.unknown == "free", read, report, i)
        if found is not None:
            obstacles += found.obstacles
            areas.append(found.workspace)
    area = file.workspace
    return Stated(_around(areas) if area is None else Workspace(*area.x, *area.y), tuple(obstacles))


def _obstacle(stated: StatedObstacle) -> Obstacle:
    if stated.circle is not None and stated.center is not None:
        return CircleObstacle(np.array(stated.center), stated.circle)
    pose = stated.pose or (0.0, 0.0, 0.0)
    return PolygonObstacle(se2.transform_points(pose, outline_of(stated)), stated.unknown is not None)


def _map(
    name: str, unknown_is_free: bool, read: Callable[[str], bytes], report: Report, i: int
) -> RosMap | None:
    try:
        return ros_map_of(name, read, unknown_is_free=unknown_is_free)
    except PushplanError as error:
        hint = "; copy the map and its picture there, or give it with --map" if OUTSIDE in str(error) else ""
        report.add(("obstacles", i, "map"), f"{error}{hint}")
        return None


def _around(areas: list[Workspace]) -> Workspace | None:
    if not areas:
        return None
    xmin, ymin = min(area.xmin for area in areas), min(area.ymin for area in areas)
    return Workspace(xmin, max(area.xmax for area in areas), ymin, max(area.ymax for area in areas))
