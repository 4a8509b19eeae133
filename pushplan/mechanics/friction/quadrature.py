"""A load on the floor as a finite number of elements, for methods that integrate friction numerically."""

from __future__ import annotations

import numpy as np
import shapely

from pushplan.errors import SupportError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport
from pushplan.util.arrays import FloatArray


def load_elements(obj: PushedObject, count: int) -> tuple[FloatArray, FloatArray]:
    """Return places (m, 2) in the chain frame, m, and parts (m,) of the weight, which sum to 1.

    A polygon is cut into equal squares, about `count` of them with their centre inside; feet and pressure maps
    are their own elements.

    Raises:
        SupportError: When the load is not known.
    """
    support = obj.support
    if isinstance(support, UniformSupport):
        points = _squares(support.outline, float(np.sqrt(support.moments.area / count)))
        pressure = 1.0 / support.moments.area + (points - support.moments.centroid) @ support.gradient
        return transform_points(obj.pose_chain, points), pressure / pressure.sum()
    if isinstance(support, PressureMapSupport):
        return transform_points(obj.pose_chain, support.points), support.fractions
    if isinstance(support, FeetSupport) and support.fractions is not None:
        return transform_points(obj.pose_chain, support.positions), support.fractions
    raise SupportError(f"the load under {obj.name!r} is unknown; integrating its friction needs a known one")


def _squares(outline: FloatArray, side: float) -> FloatArray:
    """Return the centres (m, 2) inside a polygon of squares that cover it; its centroid if there are none."""
    low, size = outline.min(axis=0), np.ptp(outline, axis=0)
    counts = np.maximum(np.round(size / side), 1.0).astype(np.int64)
    x, y = (low[d] + (np.arange(counts[d]) + 0.5) * size[d] / counts[d] for d in (0, 1))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    polygon = shapely.Polygon(outline)
    inside = points[shapely.contains_xy(polygon, points[:, 0], points[:, 1])]
    return inside if len(inside) else shapely.get_coordinates(polygon.centroid)
