"""Random outlines: convex objects with flush edges in front and behind, and obstacles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pushplan.bench.random_problems.parameters import Range
from pushplan.util.arrays import FloatArray

DIGITS = 4
"""Decimals of the lengths in a generated file: tenths of a millimetre."""


@dataclass(frozen=True, eq=False)
class FlushShape:
    """An object's outline.

    Attributes:
        outline: (v, 2) convex corners in its frame, m, counter-clockwise.
        rear: Lowest and highest y of its rear edge, m.
        front: The same of its front edge.
        stated: What a scenario file says, `{box: ...}` or `{polygon: ...}`.
    """

    outline: FloatArray
    rear: Range
    front: Range
    stated: dict[str, object]


def rounded(value: float) -> float:
    """Return a length with as many decimals as a generated file has."""
    return round(float(value), DIGITS)


def random_box(rng: np.random.Generator, size: Range) -> FlushShape:
    """Return a box."""
    length, width = (rounded(rng.uniform(*size)) for _ in range(2))
    x, y = 0.5 * length, 0.5 * width
    outline = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    return FlushShape(outline, (-y, y), (-y, y), {"box": [length, width]})


def random_flush_polygon(rng: np.random.Generator, size: Range) -> FlushShape:
    """Return a convex polygon: an edge in front, one behind, and up to two corners on either side."""
    x, y = (0.5 * rounded(rng.uniform(*size)) for _ in range(2))
    corners = [(end, sign * rng.uniform(0.5, 0.9) * y) for end in (-x, x) for sign in (-1.0, 1.0)]
    for sign in (-1.0, 1.0):
        bulge = rng.uniform([-0.7, 0.9], [0.7, 1.0], (int(rng.integers(0, 3)), 2))
        corners += [(at * x, sign * out * y) for at, out in bulge]
    outline = _hull(np.array(corners))
    rear, front = (outline[outline[:, 0] == end, 1] for end in (outline[:, 0].min(), outline[:, 0].max()))
    return FlushShape(outline, _span(rear), _span(front), {"polygon": outline.tolist()})


def _span(y: FloatArray) -> Range:
    return float(y.min()), float(y.max())


def random_polygon(rng: np.random.Generator, length: float, width: float) -> FloatArray:
    """Return a convex polygon (v, 2) about the origin that fits into a box, corners on an ellipse."""
    count = int(rng.integers(3, 8))
    angle = 2.0 * np.pi * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    return _hull(0.5 * np.stack([length * np.cos(angle), width * np.sin(angle)], axis=1))


def _hull(corners: FloatArray) -> FloatArray:
    """Return the convex hull (v, 2), rounded, counter-clockwise."""
    hull = shapely.MultiPoint(np.round(corners, DIGITS)).convex_hull
    ring = shapely.get_coordinates(shapely.orient_polygons(hull))[:-1]
    return np.round(ring, DIGITS)
