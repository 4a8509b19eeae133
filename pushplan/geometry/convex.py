"""Cuts polygons into convex pieces, packs them into flat arrays for the core, and finds bounding circles."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from pushplan.core import collision
from pushplan.core.collision import Shapes, join_triangles
from pushplan.errors import OutOfTimeError
from pushplan.util.arrays import FloatArray, IntArray, frozen

STRAIGHT = 1e-12
"""Deviation from a straight line below which a point is not a corner, m."""


def convex_pieces(outlines: Sequence[FloatArray], until: float = math.inf) -> Iterator[FloatArray]:
    """Yield counter-clockwise convex polygons (k, 2) that cover simple polygons (v, 2), m, in order.

    Raises:
        OutOfTimeError: If cutting a polygon would probably take longer than `until` (`time.perf_counter`).
    """
    if not len(outlines):
        return
    corners, starts = joined(outlines)
    out, left = collision.bulges(corners, starts)
    for i, (first, last) in enumerate(pairwise(starts.tolist())):
        bulge, outline = out[first:last], corners[first:last]
        if bulge.min() > -STRAIGHT:
            yield outline[bulge > STRAIGHT][:: 1 if left[i] else -1]
        elif time.perf_counter() + 1e-5 * len(outline) > until:  # cutting takes about 10 us a corner
            raise OutOfTimeError(
                "the time limit was reached during preparation, before the search began; more time may help"
            )
        else:
            yield from _cut(outline)


def _cut(outline: FloatArray) -> list[FloatArray]:
    """Return the convex pieces of a non-convex polygon (Hertel and Mehlhorn 1983)."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    rings = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    points, origin = np.unique(rings.reshape(-1, 2).copy().view(np.complex128), return_inverse=True)
    corners = np.column_stack([points.real, points.imag])
    origin = origin.reshape(-1).astype(np.int64)
    ring, starts = join_triangles(corners, origin, _twins(origin, len(corners)))
    return np.split(corners[ring], starts[1:-1])


def _twins(origin: IntArray, corners: int) -> IntArray:
    """Return the opposite half-edge (3 t,) of each triangle edge, or -1; edge i begins at origin[i]."""
    end = origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    key, reverse = origin * corners + end, end * corners + origin
    order = np.argsort(key)
    found = order[np.minimum(np.searchsorted(key[order], reverse), len(key) - 1)]
    return np.asarray(np.where(key[found] == reverse, found, -1))


def flatten(polygons: Sequence[FloatArray]) -> Shapes:
    """Return convex polygons as flat arrays with edge normals and bounding circles."""
    return collision.flatten(*joined(polygons))


def joined(polygons: Sequence[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Return the concatenated corners (v, 2) of polygons, and the start index of each polygon (q + 1,)."""
    corners = np.concatenate(polygons) if len(polygons) else np.zeros((0, 2))
    return corners, np.cumsum([0, *(len(polygon) for polygon in polygons)])


def bounding_circle(points: FloatArray) -> FloatArray:
    """Return centre and radius (3,) of the smallest circle around points (k, 2); read-only."""
    return _circle_around(np.asarray(points, dtype=np.float64).tobytes())


@lru_cache(maxsize=1024)
def _circle_around(corners: bytes) -> FloatArray:
    points = np.frombuffer(corners).reshape(-1, 2)  # cached, because the same bodies occur often
    circle = shapely.minimum_bounding_circle(shapely.MultiPoint(points))
    center = shapely.get_coordinates(circle.centroid)[0]
    return frozen(np.append(center, np.linalg.norm(points - center, axis=1).max()), (3,), "circle")
