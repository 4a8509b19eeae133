"""A known load in cells: where it rests, closely enough to say what a pressure that is a little off does."""

from __future__ import annotations

import numpy as np
import shapely

from pushplan.errors import SupportError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport
from pushplan.util.arrays import FloatArray

CELLS = 72
"""Squares that have the area of a support, from which its cells are cut."""


def load_cells(obj: PushedObject) -> tuple[FloatArray, FloatArray]:
    """Return the load's centre in every cell (m, 2), chain frame, m, and parts (m,) of the weight, summing to 1.

    A polygon is cut by a square grid into cells with their exact parts of the load; more than `CELLS` points of a
    pressure map are gathered in the cells of such a grid; feet stay what they are.

    Raises:
        SupportError: When the load is not known.
    """
    support = obj.support
    if isinstance(support, UniformSupport):
        points, parts = _cells_of_polygon(support)
    elif isinstance(support, PressureMapSupport):
        points, parts = _gathered(support.points, support.fractions)
    elif isinstance(support, FeetSupport) and support.fractions is not None:
        points, parts = support.positions, support.fractions
    else:
        raise SupportError(f"the load under {obj.name!r} is unknown; cells of it need a known one")
    return transform_points(obj.pose_chain, points), parts


def _cells_of_polygon(support: UniformSupport) -> tuple[FloatArray, FloatArray]:
    """Return centroids and loads of the pieces into which a grid cuts a polygon; exact for affine pressures."""
    x, y = _grid(support.outline, support.moments.area)
    west, south = np.meshgrid(x[:-1], y[:-1])
    east, north = np.meshgrid(x[1:], y[1:])
    boxes = shapely.box(west.ravel(), south.ravel(), east.ravel(), north.ravel())
    pieces = shapely.intersection(boxes, shapely.Polygon(support.outline))
    areas = shapely.area(pieces)
    kept = areas > 1e-9 * support.moments.area
    points = shapely.get_coordinates(shapely.centroid(pieces[kept]))
    pressure = 1.0 + support.moments.area * (points - support.moments.centroid) @ support.gradient
    loads = np.maximum(areas[kept] * pressure, 0.0)
    return points, np.asarray(loads / loads.sum(), dtype=np.float64)


def _gathered(points: FloatArray, fractions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the loads of points (k, 2) in each cell of a grid, at their centres; few points as they are."""
    if len(points) <= CELLS:
        return points, fractions
    x, y = _grid(points, float(np.prod(np.ptp(points, axis=0))))
    columns = np.clip(np.searchsorted(x, points[:, 0], side="right") - 1, 0, len(x) - 2)
    rows = np.clip(np.searchsorted(y, points[:, 1], side="right") - 1, 0, len(y) - 2)
    _, cell = np.unique(rows * len(x) + columns, return_inverse=True)
    loads = np.bincount(cell, fractions)
    sums = np.stack([np.bincount(cell, fractions * points[:, d]) for d in (0, 1)], axis=1)
    return sums / loads[:, None], np.asarray(loads, dtype=np.float64)


def _grid(points: FloatArray, area: float) -> tuple[FloatArray, FloatArray]:
    """Return the lines x (m,) and y (n,) of a grid of about square cells that covers points (k, 2)."""
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    side = max(float(np.sqrt(area / CELLS)), float(size.max()) / 400)
    counts = np.maximum(np.ceil(size / side), 1.0).astype(np.int64)
    x, y = (low[d] + size[d] * np.arange(counts[d] + 1) / counts[d] for d in (0, 1))
    return x, y
