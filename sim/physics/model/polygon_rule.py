"""Quadrature on polygons, convex or not, with positive weights at interior points."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from pushplan.util.arrays import FloatArray


class Rule(NamedTuple):
    """Points (k, 2) and positive weights (k,)."""

    points: FloatArray
    weights: FloatArray


def polygon_rule(outline: FloatArray, order: int) -> Rule:
    """Return a rule of total weight = area on a simple polygon (v, 2), exact for polynomials of degree 2 order - 2.

    Horizontal lines through the corners cut the polygon into trapezoids; each takes order x order Gauss points.
    """
    levels = np.unique(outline[:, 1])
    parts = [_slab(outline, low, high, order) for low, high in itertools.pairwise(levels) if high > low]
    return Rule(
        np.concatenate([part.points for part in parts]), np.concatenate([part.weights for part in parts])
    )


def _slab(outline: FloatArray, low: float, high: float, order: int) -> Rule:
    """Return the rule between two neighbouring levels of the corners."""
    node, weight = leggauss(order)
    y = low + 0.5 * (high - low) * (node + 1.0)
    sides = _crossings(outline, low, high, y)
    left, right = sides[0::2, :, None], sides[1::2, :, None]
    x = left + 0.5 * (right - left) * (node + 1.0)
    area = 0.25 * (high - low) * (right - left) * weight[:, None] * weight
    return Rule(np.stack([x, np.broadcast_to(y[:, None], x.shape)], axis=-1).reshape(-1, 2), area.reshape(-1))


def _crossings(outline: FloatArray, low: float, high: float, y: FloatArray) -> FloatArray:
    """Return where the edges that cross the slab meet the heights `y` (m,): (2 t, m), from left to right."""
    begin, end = outline, np.roll(outline, -1, axis=0)
    crossing = np.minimum(begin[:, 1], end[:, 1]) <= low
    crossing &= np.maximum(begin[:, 1], end[:, 1]) >= high
    begin, end = begin[crossing], end[crossing]
    share = (y - begin[:, 1, None]) / (end[:, 1] - begin[:, 1])[:, None]
    x = begin[:, 0, None] + share * (end[:, 0] - begin[:, 0])[:, None]
    return np.asarray(x[np.argsort(x.mean(axis=1))], dtype=np.float64)
