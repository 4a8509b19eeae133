"""What moves and what stands in a room as convex pieces, and the scene that the core looks at."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from pushplan.core import collision
from pushplan.core.collision import Scene, Shapes, join_triangles
from pushplan.errors import OutOfTimeError
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import FloatArray, IntArray, frozen

STRAIGHT = 1e-12
"""A corner that stands out, or in, by less (m) is none."""


def convex_pieces(outlines: Sequence[FloatArray], until: float = math.inf) -> Iterator[FloatArray]:
    """Yield counter-clockwise convex polygons (k, 2) that cover simple polygons (v, 2), m, in their order.

    Raises:
        OutOfTimeError: When a polygon is not likely to be cut up before `time.perf_counter` is `until`.
    """
    if not len(outlines):
        return
    corners, starts = _joined(outlines)
    out, left = collision.bulges(corners, starts)
    for i, (first, last) in enumerate(pairwise(starts.tolist())):
        bulge, outline = out[first:last], corners[first:last]
        if bulge.min() > -STRAIGHT:
            yield outline[bulge > STRAIGHT][:: 1 if left[i] else -1]
        elif time.perf_counter() + 1e-5 * len(outline) > until:  # cutting takes about 10 us a corner
            raise OutOfTimeError(
                "the time limit ended while the problem was posed: no path was looked for; more time may help"
            )
        else:
            yield from _cut(outline)


def _cut(outline: FloatArray) -> list[FloatArray]:
    """Convex pieces of a polygon that is not convex (Hertel and Mehlhorn 1983)."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    rings = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    points, origin = np.unique(rings.reshape(-1, 2).copy().view(np.complex128), return_inverse=True)
    corners = np.column_stack([points.real, points.imag])
    origin = origin.reshape(-1).astype(np.int64)
    ring, starts = join_triangles(corners, origin, _twins(origin, len(corners)))
    return np.split(corners[ring], starts[1:-1])


def _twins(origin: IntArray, corners: int) -> IntArray:
    """The edge (3 t,) that runs along each edge of triangles the other way, or -1; edge i begins at origin[i]."""
    end = origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    key, reverse = origin * corners + end, end * corners + origin
    order = np.argsort(key)
    found = order[np.minimum(np.searchsorted(key[order], reverse), len(key) - 1)]
    return np.asarray(np.where(key[found] == reverse, found, -1))


def flatten(polygons: Sequence[FloatArray]) -> Shapes:
    """Return convex polygons as flat arrays with edge normals and bounding circles."""
    return collision.flatten(*_joined(polygons))


def _joined(polygons: Sequence[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Corners (v, 2) of polygons one after another, and where each begins (q + 1,)."""
    corners = np.concatenate(polygons) if len(polygons) else np.zeros((0, 2))
    return corners, np.cumsum([0, *(len(polygon) for polygon in polygons)])


def bounding_circle(points: FloatArray) -> FloatArray:
    """Return centre and radius (3,) of the smallest circle around points (k, 2); read-only."""
    return _circle_around(np.asarray(points, dtype=np.float64).tobytes())


@lru_cache(maxsize=1024)
def _circle_around(corners: bytes) -> FloatArray:
    points = np.frombuffer(corners).reshape(-1, 2)  # kept: the same bodies are asked for again and again
    circle = shapely.minimum_bounding_circle(shapely.MultiPoint(points))
    center = shapely.get_coordinates(circle.centroid)[0]
    return frozen(np.append(center, np.linalg.norm(points - center, axis=1).max()), (3,), "circle")


def build_scene(
    chain: Chain,
    polygons: Iterable[FloatArray],
    circles: FloatArray,
    walls: tuple[float, float, float, float],
    clearance: float,
    until: float = math.inf,
) -> Scene:
    """Return the scene.

    Args:
        chain: What moves, pusher and robot included.
        polygons: Outlines (k, 2) of polygonal obstacles, world frame.
        circles: (c, 3) x, y and radius of round obstacles, world frame.
        walls: Workspace (xmin, ymin, xmax, ymax); infinite where there is none.
        clearance: Distance from everything at the poses that are looked at, m, > 0.
        until: `time.perf_counter` at which it must be there.

    Raises:
        OutOfTimeError: When cutting the obstacles into convex pieces takes too long.
    """
    body = list(convex_pieces([moving.outline for moving in chain.bodies]))
    standing = list(convex_pieces(list(polygons), until))
    return scene_of(body, standing, circles, np.array(walls, dtype=np.float64), clearance)


def scene_of(
    body: Sequence[FloatArray],
    polygons: Sequence[FloatArray],
    circles: FloatArray,
    walls: FloatArray,
    clearance: float,
    kept: float | None = None,
) -> Scene:
    """Return the scene of convex pieces, its obstacles in the order of their tree."""
    kept = 0.5 * clearance if kept is None else kept
    bound = bounding_circle(np.concatenate(body))
    return Scene(flatten(body), bound, *standing_shapes(polygons, circles), walls, clearance, kept)


def standing_shapes(polygons: Sequence[FloatArray], circles: FloatArray) -> tuple[Shapes, FloatArray, FloatArray]:
    """Return convex obstacles in the order of their tree, round ones likewise, and the tree; see `Scene`."""
    return collision.standing_shapes(*_joined(polygons), circles)
