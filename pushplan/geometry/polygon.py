"""Polygons as vertex arrays: orientation, area, centroid, second moments and convex hull."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from pushplan.errors import SupportError
from pushplan.util.arrays import FloatArray, frozen


class AreaMoments(NamedTuple):
    """Area (m^2), centroid (2,) and central second moments (2, 2) (m^4) of a polygon."""

    area: float
    centroid: FloatArray
    second: FloatArray


def simple_polygon(outline: ArrayLike, name: str) -> FloatArray:
    """Return `outline` as a read-only counter-clockwise (v, 2) array.

    Raises:
        SupportError: When it is not a simple polygon with an area.
    """
    vertices = frozen(outline, (None, 2), name)
    if len(vertices) < 3:
        raise SupportError(f"{name} has {len(vertices)} vertices; a polygon needs at least 3")
    polygon = shapely.Polygon(vertices)
    if not polygon.is_valid or not polygon.area > 0.0:
        reason = shapely.is_valid_reason(polygon)
        why = "area 0" if reason == "Valid Geometry" else reason
        raise SupportError(f"{name} must be a simple polygon with an area, but: {why}")
    return frozen(vertices if polygon.exterior.is_ccw else vertices[::-1], (None, 2), name)


def area_moments(outline: FloatArray) -> AreaMoments:
    """Return area, centroid and central second moments of a counter-clockwise (v, 2) polygon."""
    anchor = outline[0]
    p = outline - anchor
    q = np.roll(p, -1, axis=0)
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    area = 0.5 * float(cross.sum())
    centroid = (cross @ (p + q)) / (6.0 * area)
    p, q = p - centroid, q - centroid
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    total = p + q
    outer = p[:, :, None] * p[:, None, :] + q[:, :, None] * q[:, None, :]
    outer += total[:, :, None] * total[:, None, :]
    return AreaMoments(area, anchor + centroid, np.einsum("e,eij->ij", cross, outer) / 24.0)


def convex_hull(points: FloatArray) -> FloatArray:
    """Return the corners (h, 2) of the convex hull of (k, 2) points, counter-clockwise; h may be 1 or 2."""
    hull = shapely.MultiPoint(points).convex_hull
    if isinstance(hull, shapely.Polygon):
        corners = shapely.get_coordinates(hull)[:-1]
        return frozen(corners if hull.exterior.is_ccw else corners[::-1], (None, 2), "hull")
    return frozen(shapely.get_coordinates(hull), (None, 2), "hull")
