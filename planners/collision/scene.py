"""From a scenario to the arrays of the compiled collision check: convex pieces with bounding circles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.arrays import FloatArray
from pushplan.mechanics.chain import Chain
from pushplan.planners.collision.obstacle_tree import obstacle_tree
from pushplan.planners.collision.separation import Scene, Shapes


def convex_pieces(outline: FloatArray) -> list[FloatArray]:
    """Return counter-clockwise convex polygons (k, 2) that cover a simple polygon, itself if it is convex."""
    polygon = shapely.Polygon(outline)
    if polygon.equals(polygon.convex_hull):
        return [_ring(polygon)]
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    return [_ring(piece) for piece in _merged(list(triangles))]


def _merged(pieces: list[BaseGeometry]) -> list[BaseGeometry]:
    """Join neighbouring pieces for as long as the union stays convex (Hertel and Mehlhorn 1983)."""
    for i, first in enumerate(pieces):
        for j in range(i + 1, len(pieces)):
            union = shapely.union(first, pieces[j])
            convex = (
                union.geom_type == "Polygon" and union.convex_hull.area - union.area <= 1e-12 * union.area
            )
            if convex:
                rest = [piece for k, piece in enumerate(pieces) if k not in (i, j)]
                return _merged([union, *rest])
    return pieces


def _ring(polygon: BaseGeometry) -> FloatArray:
    """Corners of a convex polygon, counter-clockwise, without the repeated end and points inside an edge."""
    ring = shapely.orient_polygons(shapely.simplify(polygon.convex_hull, 0.0))
    return shapely.get_coordinates(ring)[:-1]


def flatten(polygons: Sequence[FloatArray]) -> Shapes:
    """Return convex polygons as flat arrays with edge normals and bounding circles."""
    if not polygons:
        return Shapes(np.zeros((0, 4)), np.zeros(1, dtype=np.int64), np.zeros((0, 3)))
    corners = []
    for polygon in polygons:
        edge = np.roll(polygon, -1, axis=0) - polygon
        normal = np.stack([edge[:, 1], -edge[:, 0]], axis=1) / np.linalg.norm(edge, axis=1, keepdims=True)
        corners.append(np.hstack([polygon, normal]))
    starts = np.concatenate([[0], np.cumsum([len(polygon) for polygon in polygons])]).astype(np.int64)
    bounds = np.array([bounding_circle(polygon) for polygon in polygons])
    return Shapes(np.ascontiguousarray(np.concatenate(corners)), starts, bounds)


def bounding_circle(points: FloatArray) -> FloatArray:
    """Return centre and radius (3,) of the smallest circle around points (k, 2)."""
    circle = shapely.minimum_bounding_circle(shapely.MultiPoint(points))
    center = shapely.get_coordinates(circle.centroid)[0]
    return np.append(center, np.linalg.norm(points - center, axis=1).max())


def _box(points: FloatArray) -> FloatArray:
    """Smallest box (xmin, ymin, xmax, ymax) around points (k, 2)."""
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def build_scene(
    chain: Chain,
    polygons: Iterable[FloatArray],
    circles: Iterable[tuple[float, float, float]],
    walls: tuple[float, float, float, float],
    clearance: float,
    kept: float | None = None,
) -> Scene:
    """Return the compiled scene.

    Args:
        chain: What moves, pusher and robot included.
        polygons: Outlines (k, 2) of polygonal obstacles, world frame.
        circles: (x, y, radius) of round obstacles, world frame.
        walls: Workspace (xmin, ymin, xmax, ymax); infinite where there is none.
        clearance: Distance from everything at the poses that are looked at, m, > 0.
        kept: Distance that is proven between them, m, smaller; None stands for half of the clearance.
    """
    body = [piece for moving in chain.bodies for piece in convex_pieces(moving.outline)]
    standing = [piece for outline in polygons for piece in convex_pieces(outline)]
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
    boxes = np.array([_box(polygon) for polygon in polygons]).reshape(-1, 4)
    radius = circles[:, 2:]
    boxes = np.concatenate([boxes, np.hstack([circles[:, :2] - radius, circles[:, :2] + radius])])
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
