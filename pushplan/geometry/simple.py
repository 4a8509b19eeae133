"""What keeps a list of corners from being a polygon with one inside."""

from __future__ import annotations

import numpy as np
import shapely

from pushplan.util.arrays import FloatArray

SAME_POINT = 1e-6
"""Corners nearer to each other than this are the same point, m."""

LEAST_AREA = 1e-6
"""Area below which a polygon counts as a line, m^2."""


def find_flaw(corners: FloatArray) -> str | None:
    """Return what is wrong with the polygon of the corners (v, 2), or None; corners count from 0."""
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    if lengths.min() < SAME_POINT:
        i = int(lengths.argmin())
        return f"corners [{i}] and [{(i + 1) % len(corners)}] are the same point"
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid:
        return _crossing(corners)
    if polygon.area < LEAST_AREA:
        return f"has an area of {polygon.area * 1e6:.3g} mm^2, less than {LEAST_AREA * 1e6:g} mm^2"
    return None


def _crossing(corners: FloatArray) -> str:
    """Return which two edges of an invalid polygon meet, and where."""
    ends = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    edges = np.array([shapely.LineString(pair) for pair in ends], dtype=object)
    count = len(edges)
    for i in range(count):
        others = np.array([j for j in range(i + 1, count) if 1 < j - i < count - 1], dtype=np.int64)
        hits = others[shapely.intersects(edges[i], edges[others])]
        if len(hits):
            x, y = shapely.get_coordinates(shapely.intersection(edges[i], edges[hits[0]]))[0]
            return f"the edges after corners [{i}] and [{hits[0]}] cross at ({x:.6g}, {y:.6g})"
    return "an edge runs back along the one before"
