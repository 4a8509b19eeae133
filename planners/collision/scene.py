"""From a scenario to the arrays of the compiled collision check: convex pieces with bounding circles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from pushplan.mechanics.chain import Chain
from pushplan.planners.collision.convex_pieces import convex_pieces
from pushplan.planners.collision.obstacle_tree import obstacle_tree
from pushplan.planners.collision.separation import Scene, Shapes
from pushplan.util.arrays import FloatArray, IntArray


def flatten(polygons: Sequence[FloatArray]) -> Shapes:
    """Return convex polygons as flat arrays with edge normals and bounding circles."""
    if not polygons:
        return Shapes(np.zeros((0, 4)), np.zeros(1, dtype=np.int64), np.zeros((0, 3)))
    corners, counts = np.concatenate(polygons), np.array([len(polygon) for polygon in polygons])
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    after = np.arange(1, len(corners) + 1)
    after[starts[1:] - 1] = starts[:-1]
    edge = corners[after] - corners
    normal = np.stack([edge[:, 1], -edge[:, 0]], axis=1) / np.linalg.norm(edge, axis=1, keepdims=True)
    boxes = _boxes(corners, starts)
    center = 0.5 * (boxes[:, :2] + boxes[:, 2:])
    away = np.linalg.norm(corners - np.repeat(center, counts, axis=0), axis=1)
    bounds = np.column_stack([center, np.maximum.reduceat(away, starts[:-1])])
    return Shapes(np.hstack([corners, normal]), starts, bounds)


def bounding_circle(points: FloatArray) -> FloatArray:
    """Return centre and radius (3,) of the smallest circle around points (k, 2)."""
    circle = shapely.minimum_bounding_circle(shapely.MultiPoint(points))
    center = shapely.get_coordinates(circle.centroid)[0]
    return np.append(center, np.linalg.norm(points - center, axis=1).max())


def _boxes(corners: FloatArray, starts: IntArray) -> FloatArray:
    """Smallest boxes (q, 4) xmin, ymin, xmax, ymax around polygons with corners (v, 2), each from its start on."""
    return np.hstack([part.reduceat(corners, starts[:-1], axis=0) for part in (np.minimum, np.maximum)])


def build_scene(
    chain: Chain,
    polygons: Iterable[FloatArray],
    circles: Iterable[tuple[float, float, float]],
    walls: tuple[float, float, float, float],
    clearance: float,
    kept: float | None = None,
    until: float = math.inf,
) -> Scene:
    """Return the compiled scene.

    Args:
        chain: What moves, pusher and robot included.
        polygons: Outlines (k, 2) of polygonal obstacles, world frame.
        circles: (x, y, radius) of round obstacles, world frame.
        walls: Workspace (xmin, ymin, xmax, ymax); infinite where there is none.
        clearance: Distance from everything at the poses that are looked at, m, > 0.
        kept: Distance that is proven between them, m, smaller; None stands for half of the clearance.
        until: `time.perf_counter` at which it must be there.

    Raises:
        OutOfTimeError: When cutting the obstacles into convex pieces takes too long.
    """
    body = list(convex_pieces([moving.outline for moving in chain.bodies]))
    standing = list(convex_pieces(list(polygons), until))
    discs = np.array(list(circles), dtype=np.float64).reshape(-1, 3)
    return scene_of(body, standing, discs, np.array(walls, dtype=np.float64), clearance, kept)


def scene_of(
    body: Sequence[FloatArray],
    polygons: Sequence[FloatArray],
    circles: FloatArray,
    walls: FloatArray,
    clearance: float,
    kept: float | None = None,
) -> Scene:
    """Return the compiled scene of convex pieces, its obstacles in the order of their tree."""
    radius = circles[:, 2:]
    boxes = np.hstack([circles[:, :2] - radius, circles[:, :2] + radius])
    if polygons:
        starts = np.cumsum([0, *(len(polygon) for polygon in polygons)])
        boxes = np.concatenate([_boxes(np.concatenate(polygons), starts), boxes])
    tree, order = obstacle_tree(boxes, len(polygons))
    standing = [polygons[i] for i in order[order < len(polygons)]]
    discs = circles[order[order >= len(polygons)] - len(polygons)]
    return Scene(
        flatten(body),
        bounding_circle(np.concatenate(body)),
        flatten(standing),
        discs,
        tree,
        walls,
        clearance,
        0.5 * clearance if kept is None else kept,
    )
