"""Check that robot, pusher and objects are free at start and goal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
import shapely

from pushplan.geometry import se2
from pushplan.geometry.penetration import overlap_depth
from pushplan.mechanics.chain import Chain
from pushplan.scenario.arrangement.meeting import millimetres
from pushplan.scenario.parts import CircleObstacle, Obstacle, Workspace
from pushplan.util.arrays import FloatArray

ROUNDING = 1e-9
"""Distances that fall short of the clearance by less (m) are rounding."""


MOST_TOLD = 20
"""Obstacles near one body that are told one by one."""


class Surroundings(NamedTuple):
    """What to keep away from, and how far (m)."""

    workspace: Workspace | None
    obstacles: Sequence[Obstacle]
    clearance: float


def placement_troubles(
    what: str, bodies: Sequence[tuple[str, FloatArray]], surroundings: Surroundings
) -> Iterator[str]:
    """Yield a sentence on every body that leaves the workspace or comes too near an obstacle.

    Args:
        what: `start` or `goal`, for the sentences.
        bodies: Names and outlines (v, 2) in the world.
        surroundings: What to keep away from.
    """
    obstacles, clearance = surroundings.obstacles, surroundings.clearance
    tree = shapely.STRtree([_geometry(obstacle) for obstacle in obstacles])
    for name, outline in bodies:
        troubles = list(_beyond_walls(outline, surroundings.workspace, clearance))
        near = _near(tree, outline, 2.0 * clearance)
        all_near = filter(
            None, (_too_near(outline, obstacles[i], f"obstacles[{i}]", clearance) for i in near)
        )
        troubles += islice(all_near, MOST_TOLD)
        if any(all_near):
            troubles.append(f"is as near to more obstacles than these {MOST_TOLD}, which are not listed")
        yield from (f"at the {what}, '{name}' {trouble}" for trouble in troubles)


def bodies_at(chain: Chain, pose: FloatArray) -> list[tuple[str, FloatArray]]:
    """Return names and world outlines of robot, pusher and objects with the chain frame at `pose` (3,)."""
    return [(body.name, se2.transform_points(pose, body.outline)) for body in chain.bodies]


def _geometry(obstacle: Obstacle) -> shapely.Polygon:
    """Return an obstacle for the search by distance; discs as the squares around them."""
    if isinstance(obstacle, CircleObstacle):
        (x, y), r = obstacle.center, obstacle.radius
        return shapely.Polygon([(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r)])
    return shapely.Polygon(obstacle.outline)


def _near(tree: shapely.STRtree, outline: FloatArray, reach: float) -> list[int]:
    """Return the obstacles within reach of a body, and some discs that are a little farther away."""
    found = tree.query(shapely.Polygon(outline), predicate="dwithin", distance=reach)
    return [int(i) for i in np.sort(found)]


def _beyond_walls(outline: FloatArray, workspace: Workspace | None, clearance: float) -> Iterator[str]:
    """Yield how far a body is beyond each wall, or that it is too near to it."""
    if workspace is None:
        return
    (xmin, ymin), (xmax, ymax) = outline.min(axis=0), outline.max(axis=0)
    walls = (
        (xmin - workspace.xmin, f"x >= {workspace.xmin:.6g}"),
        (workspace.xmax - xmax, f"x <= {workspace.xmax:.6g}"),
        (ymin - workspace.ymin, f"y >= {workspace.ymin:.6g}"),
        (workspace.ymax - ymax, f"y <= {workspace.ymax:.6g}"),
    )
    for gap, wall in walls:
        if gap < 0.0:
            yield f"leaves the workspace ({wall}) by {millimetres(-gap)}"
        elif gap < clearance - ROUNDING:
            yield _short_of(gap, f"the workspace's wall {wall}", clearance)


def _too_near(outline: FloatArray, obstacle: Obstacle, name: str, clearance: float) -> str:
    """Return what is wrong between a body and an obstacle, or nothing."""
    body = shapely.Polygon(outline)
    if isinstance(obstacle, CircleObstacle):
        center = shapely.Point(obstacle.center)
        inside = bool(body.contains(center))
        away = -float(body.exterior.distance(center)) if inside else float(body.distance(center))
        gap = away - obstacle.radius
    else:
        gap = float(body.distance(shapely.Polygon(obstacle.outline)))
        gap = gap or 0.0 - overlap_depth(obstacle.outline, outline)
    if gap < 0.0:
        return f"overlaps {name} by {millimetres(-gap)}"
    return _short_of(gap, name, clearance) if gap < clearance - ROUNDING else ""


def _short_of(gap: float, what: str, clearance: float) -> str:
    return f"is {millimetres(gap)} from {what}; allowed: at least {millimetres(clearance)}"
