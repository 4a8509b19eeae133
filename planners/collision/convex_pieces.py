"""Simple polygons cut into convex pieces: triangles, joined for as long as they stay convex."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
import shapely

from pushplan.compiled import compiled, no_refcount
from pushplan.errors import OutOfTimeError
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

STRAIGHT = 1e-12
"""A corner that stands out, or in, by less (m) is none."""


def convex_pieces(outlines: Sequence[FloatArray], until: float = math.inf) -> Iterator[FloatArray]:
    """Yield counter-clockwise convex polygons (k, 2) that cover simple polygons (v, 2), m, in their order.

    Raises:
        OutOfTimeError: When a polygon is not likely to be cut up before `time.perf_counter` is `until`.
    """
    if not len(outlines):
        return
    starts = np.cumsum([0, *(len(outline) for outline in outlines)])
    corners = np.concatenate(outlines)
    out, left = _bulges(corners, starts)
    for i, (first, last) in enumerate(pairwise(starts)):
        bulge, outline = out[first:last], corners[first:last]
        if bulge.min() > -STRAIGHT:
            yield outline[bulge > STRAIGHT][:: 1 if left[i] else -1]
        elif time.perf_counter() + 1e-5 * len(outline) > until:  # cutting takes about 10 us a corner
            raise OutOfTimeError(
                "the time limit ended while the problem was posed: no path was looked for; more time may help"
            )
        else:
            yield from _cut(outline)


def _bulges(corners: FloatArray, starts: IntArray) -> tuple[FloatArray, BoolArray]:
    """How far corners (v, 2) stand out of polygons (v,), < 0 inwards, m, and whether these (q,) turn left."""
    counts = np.diff(starts)
    after = np.arange(1, len(corners) + 1)
    after[starts[1:] - 1] = starts[:-1]
    edge = corners[after] - corners
    length = np.hypot(edge[:, 0], edge[:, 1])
    before = np.empty_like(after)
    before[after] = np.arange(len(after))
    turn = edge[before, 0] * edge[:, 1] - edge[before, 1] * edge[:, 0]
    middle = np.repeat(corners[starts[:-1]], counts, axis=0)  # keeps digits far from the origin
    x, y = (corners - middle).T
    left = np.add.reduceat(x * y[after] - y * x[after], starts[:-1]) > 0.0
    out = turn / np.maximum(np.maximum(length, length[before]), 1e-300)
    return np.where(np.repeat(left, counts), out, -out), left


def _cut(outline: FloatArray) -> list[FloatArray]:
    """Convex pieces of a polygon that is not convex (Hertel and Mehlhorn 1983)."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    rings = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)[:, :3]
    points, origin = np.unique(rings.reshape(-1, 2).copy().view(np.complex128), return_inverse=True)
    corners = np.column_stack([points.real, points.imag])
    origin = origin.reshape(-1).astype(np.int64)
    ring, starts = _joined(corners, origin, _twins(origin, len(corners)))
    return np.split(corners[ring], starts[1:-1])


def _twins(origin: IntArray, corners: int) -> IntArray:
    """The edge (3 t,) that runs along each edge of triangles the other way, or -1; edge i begins at origin[i]."""
    end = origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    key, reverse = origin * corners + end, end * corners + origin
    order = np.argsort(key)
    found = order[np.minimum(np.searchsorted(key[order], reverse), len(key) - 1)]
    return np.asarray(np.where(key[found] == reverse, found, -1))


@compiled
def _joined(corners: FloatArray, origin: IntArray, twin: IntArray) -> tuple[IntArray, IntArray]:
    """Return the corners (k,) of convex pieces, piece after piece, and where each begins (p + 1,).

    Taking an edge away leaves every corner as it is but the edge's two ends; so each edge is looked at once.
    """
    edges = np.arange(len(origin))
    after, before = edges - edges % 3 + (edges + 1) % 3, edges - edges % 3 + (edges + 2) % 3
    gone = twin == edges  # none is
    for h in range(len(origin)):
        t = twin[h]
        if h >= t or not _is_convex(corners, origin, before[h], after[t], after):
            continue
        if _is_convex(corners, origin, before[t], after[h], after):
            for one, other in ((h, t), (t, h)):
                after[before[one]], before[after[other]] = after[other], before[one]
                gone[one] = True
    ring, starts, k = np.empty(len(origin), dtype=np.int64), [0], 0
    for h in range(len(origin)):
        i = h
        while not gone[i]:
            ring[k], gone[i], k, i = origin[i], True, k + 1, after[i]
        if k > starts[-1]:
            starts.append(k)
    return ring[:k], np.array(starts)


@no_refcount
def _is_convex(corners: FloatArray, origin: IntArray, into: int, out: int, after: IntArray) -> bool:
    """Return whether the way from an edge `into` a corner on to an edge `out` of it does not turn right."""
    a, b, c = corners[origin[into]], corners[origin[out]], corners[origin[after[out]]]
    return bool((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) >= 0.0)
