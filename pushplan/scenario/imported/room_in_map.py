"""Where in a map a push can begin and end: two places with room around them and nothing between."""

from __future__ import annotations

import numpy as np
import shapely

from pushplan.scenario.imported.ros_map import RosMap
from pushplan.util.arrays import FloatArray

_ACROSS = 60
"""Places that are looked at along the longer side of the map."""


def start_and_goal(found: RosMap, radius: float, apart: float) -> tuple[FloatArray, FloatArray] | None:
    """Return two poses (3,) that face the same way, the second straight ahead of the first.

    The first is where there is most room; the second is about `apart` away from it, with `radius` free all along the
    line between them.

    Args:
        found: The map.
        radius: Room around both, m.
        apart: Distance that is wanted, m; less where there is no more.

    Returns:
        None where the map has no such places.
    """
    area = found.workspace
    blocked = shapely.union_all([shapely.Polygon(obstacle.outline) for obstacle in found.obstacles])
    floor = shapely.box(area.xmin, area.ymin, area.xmax, area.ymax) - blocked
    room = floor.buffer(-radius, quad_segs=4)
    shapely.prepare(room)
    spacing = max(area.xmax - area.xmin, area.ymax - area.ymin) / _ACROSS
    x, y = np.meshgrid(np.arange(area.xmin, area.xmax, spacing), np.arange(area.ymin, area.ymax, spacing))
    places = np.stack([x.ravel(), y.ravel()], axis=1).round(2)
    places = places[shapely.contains(room, shapely.points(places))]
    if len(places) == 0:
        return None
    walls = shapely.distance(shapely.points(places), room.boundary)
    start = places[int(walls.argmax())]
    lines = shapely.linestrings(np.stack([np.broadcast_to(start, places.shape), places], axis=1))
    seen = places[shapely.covers(room, lines)]
    far = np.hypot(*(seen - start).T)
    goal = seen[int(np.abs(far - apart).argmin())]
    if np.hypot(*(goal - start)) < radius:
        return None
    heading = np.round(np.degrees(np.arctan2(*(goal - start)[::-1])), 1)
    return np.array([*start, np.radians(heading)]), np.array([*goal, np.radians(heading)])
