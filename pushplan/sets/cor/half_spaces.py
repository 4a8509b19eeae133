"""Stable sets that are polyhedral cones of twists: exact polygons of centres of rotation.

A row a with a . (vx, vy, L omega) > 0 is a great circle of the twist sphere and, for either sense, a straight
line of the COR plane, as V = sense (c_y, -c_x, 1).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from pushplan.errors import PushplanError
from pushplan.sets.cor.cor_region import Window, window_box
from pushplan.util.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


def velocity_rows(forces: FloatArray, points: FloatArray, length: float) -> FloatArray:
    """Return the rows (..., 3) of gamma . v(x) for directions gamma (..., 2) at points x (..., 2).

    v(x) = v + omega J x.
    """
    turn = forces[..., 1] * points[..., 0] - forces[..., 0] * points[..., 1]
    return np.stack(np.broadcast_arrays(forces[..., 0], forces[..., 1], turn / length), axis=-1)


def unit_rows(rows: FloatArray, scale: float) -> FloatArray:
    """Return rows (m, 3) scaled to length 1; those shorter than rounding of `scale` become 0, never > 0."""
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    kept = size > 1e-12 * scale
    return np.where(kept, rows / np.where(kept, size, 1.0), 0.0)


def smallest_sines(rows: FloatArray, owner: IntArray, twists: FloatArray, length: float) -> FloatArray:
    """Return the sine (k, n) of the angle of twists (k, 3) to the nearest great circle of each contact.

    Args:
        rows: (m, 3) unit rows.
        owner: (m,) contact of each row, in increasing order, every contact at least once.
        twists: In the chain frame, not zero.
        length: Characteristic length, m.
    """
    scaled = twists * [1.0, 1.0, length]
    scaled = scaled / np.abs(scaled).max(axis=1, keepdims=True)  # the square of a slow twist may be 0
    values = (scaled / np.linalg.norm(scaled, axis=1, keepdims=True)) @ rows.T
    return np.asarray(np.minimum.reduceat(values, np.searchsorted(owner, np.unique(owner)), axis=1))


def cor_polygon(rows: FloatArray, length: float, sense: int, window: Window | None) -> BaseGeometry:
    """Return the CORs of one sense that satisfy all rows (m, 3), inside `window`: a convex polygon.

    Raises:
        PushplanError: On another sense than +1 and -1, or an empty window.
    """
    if sense not in (1, -1):
        raise PushplanError(f"sense is {sense}; it must be +1 (counter-clockwise) or -1 (clockwise)")
    box = window_box(window, length)
    corners = shapely.get_coordinates(box)[:-1]
    normals = sense * np.stack([-rows[:, 1], rows[:, 0]], axis=1)
    offsets = sense * length * rows[:, 2]
    for normal, offset in zip(normals, offsets, strict=True):
        corners = _clipped(corners, corners @ normal + offset)
    polygon = shapely.Polygon(corners) if len(corners) > 2 else shapely.Polygon()
    return polygon if polygon.area > 1e-14 * box.area else shapely.Polygon()


def _clipped(corners: FloatArray, height: FloatArray) -> FloatArray:
    """Return the part (v, 2) of a convex polygon (u, 2) whose linear function `height` (u,) is positive."""
    if not (height > 0.0).any():
        return np.empty((0, 2))
    parts = []
    for p, q, a, b in zip(corners, np.roll(corners, -1, axis=0), height, np.roll(height, -1), strict=True):
        if a >= 0.0:
            parts.append(p)
        if a * b < 0.0:
            parts.append(p + (q - p) * (a / (a - b)))
    return np.array(parts)
