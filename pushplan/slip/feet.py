"""Replaces a known support by a few feet for simulation.

A pressure is replaced by a positive quadrature with the same moments up to a degree d. By Tchakaloff's theorem,
(d + 1)(d + 2) / 2 points are sufficient; they are found as a non-negative least-squares solution.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander2d

from pushplan.errors import SupportError
from pushplan.mechanics.support import PressureMapSupport, Support, UniformSupport
from pushplan.util.arrays import FloatArray, frozen


class Rule(NamedTuple):
    """Points (k, 2) and positive weights (k,)."""

    points: FloatArray
    weights: FloatArray


def polygon_rule(outline: FloatArray, order: int) -> Rule:
    """Return a rule on a simple polygon (v, 2) that is exact for polynomials of degree 2 order - 2.

    The total weight is the area. Horizontal lines through the corners cut the polygon into trapezoids with
    order x order Gauss points each.
    """
    levels = np.unique(outline[:, 1])
    parts = [_slab(outline, low, high, order) for low, high in itertools.pairwise(levels) if high > low]
    return Rule(np.concatenate([part.points for part in parts]), np.concatenate([part.weights for part in parts]))


def _slab(outline: FloatArray, low: float, high: float, order: int) -> Rule:
    """Return the rule between two adjacent levels of the corners."""
    node, weight = leggauss(order)
    y = low + 0.5 * (high - low) * (node + 1.0)
    sides = _crossings(outline, low, high, y)
    left, right = sides[0::2, :, None], sides[1::2, :, None]
    x = left + 0.5 * (right - left) * (node + 1.0)
    area = 0.25 * (high - low) * (right - left) * weight[:, None] * weight
    return Rule(np.stack([x, np.broadcast_to(y[:, None], x.shape)], axis=-1).reshape(-1, 2), area.reshape(-1))


def _crossings(outline: FloatArray, low: float, high: float, y: FloatArray) -> FloatArray:
    """Return the x coordinates (2 t, m) at which the edges that cross the slab meet the heights `y` (m,), sorted."""
    begin, end = outline, np.roll(outline, -1, axis=0)
    crossing = np.minimum(begin[:, 1], end[:, 1]) <= low
    crossing &= np.maximum(begin[:, 1], end[:, 1]) >= high
    begin, end = begin[crossing], end[crossing]
    share = (y - begin[:, 1, None]) / (end[:, 1] - begin[:, 1])[:, None]
    x = begin[:, 0, None] + share * (end[:, 0] - begin[:, 0])[:, None]
    return np.asarray(x[np.argsort(x.mean(axis=1))], dtype=np.float64)


DEGREE = 9
"""Degree up to which the feet have the moments of the pressure."""

_CANDIDATES = 12
"""Number of Gauss points along each side of a trapezoid, from which the feet are chosen."""


@dataclass(frozen=True, eq=False)
class Feet:
    """Points under an object.

    Attributes:
        positions: Feet (k, 2) in the object's own frame, m.
        fractions: Fractions (k,) of the weight on each foot at rest, with sum 1.
        stiffness: Shares (k,) of each foot in a load that shifts, with sum 1.
    """

    positions: FloatArray
    fractions: FloatArray
    stiffness: FloatArray

    def __post_init__(self) -> None:
        count = len(self.positions)
        object.__setattr__(self, "positions", frozen(self.positions, (count, 2), "positions of the feet"))
        object.__setattr__(self, "fractions", frozen(self.fractions, (count,), "fractions of the feet"))
        object.__setattr__(self, "stiffness", frozen(self.stiffness, (count,), "stiffness of the feet"))


def feet_of(support: Support, degree: int = DEGREE) -> Feet:
    """Return the feet that represent a support; known loads on points are kept.

    Raises:
        SupportError: If the loads are not known.
    """
    if not support.known:
        raise SupportError(
            "a physics simulation needs a known load distribution on the floor: give a pressure, load fractions or "
            "a pressure map"
        )
    if isinstance(support, UniformSupport):
        return _feet_of_polygon(support, degree)
    positions, fractions, stiffness = support.point_loads
    if not isinstance(support, PressureMapSupport):
        return Feet(positions, fractions, stiffness)
    rule = compressed(Rule(positions, fractions), degree)  # a pressure map has many points
    return Feet(rule.points, rule.weights, rule.weights)


def _feet_of_polygon(support: UniformSupport, degree: int) -> Feet:
    rule = _rule_of(support.outline.tobytes(), degree)
    share = rule.weights / rule.weights.sum()
    pressure = 1.0 + support.moments.area * (rule.points - support.moments.centroid) @ support.gradient
    loads = share * pressure
    return Feet(rule.points, loads / loads.sum(), share)


@lru_cache(maxsize=64)
def _rule_of(outline: bytes, degree: int) -> Rule:
    """Return the points that represent an outline (v, 2) given as bytes; cached, as many objects share an outline."""
    return compressed(polygon_rule(np.frombuffer(outline).reshape(-1, 2), _CANDIDATES), degree)


def compressed(rule: Rule, degree: int) -> Rule:
    """Return a rule on at most (degree + 1)(degree + 2) / 2 of the points with the same moments up to `degree`.

    Raises:
        SupportError: If rounding errors do not allow the moments to be met.
    """
    low, high = rule.points.min(axis=0), rule.points.max(axis=0)
    scaled = (2.0 * rule.points - low - high) / np.maximum(high - low, 1e-300)
    powers = np.add.outer(np.arange(degree + 1), np.arange(degree + 1)).reshape(-1)
    moments = legvander2d(scaled[:, 0], scaled[:, 1], [degree, degree])[:, powers <= degree].T
    total = float(rule.weights.sum())
    if len(rule.weights) <= len(moments):
        return rule
    from scipy.optimize import nnls  # takes 0.5 s to load and is needed only for plans of rows

    weights, residual = nnls(moments, moments @ rule.weights / total)
    if residual > 1e-9:
        raise SupportError(f"no feet have the moments of the pressure: the residual is {residual:.2g}")
    kept = weights > 0.0
    return Rule(rule.points[kept], total * weights[kept])
