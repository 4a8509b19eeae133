"""How deep two polygons overlap, and how far one has to move to come free."""

from __future__ import annotations

import numpy as np
import shapely

from pushplan.geometry.contact_segments import TOUCH
from pushplan.util.arrays import FloatArray

_MOST_WORK = 100_000
"""Pairs of triangles times directions that are looked at for outlines that are not convex."""


def overlap_depth(fixed: FloatArray, moving: FloatArray) -> float:
    """Return the shortest translation (m) along an edge's normal that parts two outlines (v, 2).

    This is the penetration depth of convex outlines, and an upper bound of it for others; 0 when they overlap by
    less than `TOUCH`.
    """
    first, second = shapely.Polygon(fixed), shapely.Polygon(moving)
    if not shapely.intersection(first, second).area > TOUCH * TOUCH:
        return 0.0
    directions = np.concatenate([_normals(fixed), -_normals(moving)])
    if all(p.convex_hull.area - p.area <= 1e-12 * p.area for p in (first, second)):
        depth = float(np.min((fixed @ directions.T).max(axis=0) - (moving @ directions.T).min(axis=0)))
    else:
        pieces = _triangles(fixed), _triangles(moving)
        most = max(4, _MOST_WORK // (len(pieces[0]) * len(pieces[1])))
        depth = min(_exit_distance(*pieces, direction) for direction in directions[:most])
    return depth if depth > TOUCH else 0.0


def exit_distance(fixed: FloatArray, moving: FloatArray, direction: FloatArray) -> float:
    """Return how far (m) `moving` has to go along the unit `direction` until it overlaps `fixed` no more."""
    return _exit_distance(_triangles(fixed), _triangles(moving), direction)


def _normals(outline: FloatArray) -> FloatArray:
    """Return the outward unit normals of a counter-clockwise outline's edges, those of the longest first."""
    edges = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(edges, axis=1)
    longest = np.argsort(-lengths, kind="stable")
    normals = edges[longest] / lengths[longest, None]
    return np.stack([normals[:, 1], -normals[:, 0]], axis=1)


def _triangles(outline: FloatArray) -> FloatArray:
    """Return triangles (k, 3, 2), counter-clockwise, that cover an outline."""
    cover = shapely.orient_polygons(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    return np.array([shapely.get_coordinates(piece)[:3] for piece in shapely.get_parts(cover)])


def _exit_distance(fixed: FloatArray, moving: FloatArray, direction: FloatArray) -> float:
    """Follow the shifts at which any two triangles overlap, from 0 to the first one at which none do."""
    low, high = _overlapping_shifts(fixed, moving, direction)
    reached = 0.0
    for begin, end in sorted(zip(low, high, strict=True)):
        if begin <= reached:
            reached = max(reached, end)
    return reached


def _overlapping_shifts(
    fixed: FloatArray, moving: FloatArray, direction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the ends of the intervals of shifts along `direction` at which a pair of triangles overlaps.

    Convex bodies are apart exactly if they are along a normal of one of their edges (separating axes).
    """
    low = np.full((len(fixed), len(moving)), -np.inf)
    high = np.full((len(fixed), len(moving)), np.inf)
    for axes, owner in ((_axes(fixed), 0), (_axes(moving), 1)):
        for k in range(3):
            axis = np.expand_dims(axes[:, k], 1 - owner)  # broadcasts over the other body's triangles
            top = (fixed[:, None] @ axis[..., None])[..., 0].max(axis=-1)
            bottom = (moving[None] @ axis[..., None])[..., 0].min(axis=-1)
            floor = (fixed[:, None] @ axis[..., None])[..., 0].min(axis=-1)
            ceiling = (moving[None] @ axis[..., None])[..., 0].max(axis=-1)
            low, high = _clip(low, high, axis @ direction, floor - ceiling, top - bottom)
    low, high = np.where(low < high, low, np.inf), np.where(low < high, high, -np.inf)
    return low[low < high], high[low < high]


def _clip(
    low: FloatArray, high: FloatArray, speed: FloatArray, least: FloatArray, most: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Keep the shifts t with least < t speed < most."""
    still = abs(speed) < 1e-12
    safe = np.where(still, 1.0, speed)
    a, b = np.minimum(least / safe, most / safe), np.maximum(least / safe, most / safe)
    inside = (least < 0.0) & (most > 0.0)
    a = np.where(still, np.where(inside, -np.inf, np.inf), a)
    b = np.where(still, np.where(inside, np.inf, -np.inf), b)
    return np.maximum(low, a), np.minimum(high, b)


def _axes(triangles: FloatArray) -> FloatArray:
    """Return the edge normals (k, 3, 2), not scaled, of triangles (k, 3, 2)."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    return np.stack([edges[..., 1], -edges[..., 0]], axis=-1)
