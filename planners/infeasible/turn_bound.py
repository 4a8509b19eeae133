"""A cost between two poses that no stable path beats, whatever its turns: a dual bound, exact in many free rooms.

Let R(theta) v be the velocity of the chain frame's origin in the world, omega the turning rate, p a vector with
|p| <= 1. Along any path from (x_s, theta_s) to (x_g, theta_g)

    cost = int |v| + w |omega| dt = p.(x_g - x_s) + int |v| - p.R(theta) v + w |omega| dt.

The last integrand is never negative, and in a turn by d theta it is at least

    rho(theta) = w + min over stable twists with |omega| = 1 of |v| (1 - |p| cos(theta + beta - arg p)),

beta being the direction of v in the chain frame. So cost >= p.d + the least integral of rho over the headings on a
way from theta_s to theta_g, with d = x_g - x_s. That way cannot be any: the mean velocity points along d, so the path
is at some time at a heading sigma at which a stable twist moves along d, or against it (else it would move to one
side of d all the time). Hence

    cost >= max over p of p.d + min over sigma of P(theta_s, sigma) + P(sigma, theta_g),

P being the lesser integral of rho of those to the left and to the right. p is the costate of the position, constant
where nothing is in the way (Pontryagin).
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.geometry import se2
from pushplan.planners.infeasible.turns import Turns, turns_of
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray

BINS = 360
"""Bins of the heading, a degree wide: rho is a lower bound on each of them."""

DIRECTIONS = 48
"""Directions of p looked at first, and then again around the best of them: the bound is concave in p."""

SIZES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Lengths of p; below 1 only where the goal is so near that turns cost more than the way."""

NEVER = 1e6
"""rho of turns to a side to which there are none, m: finite, so that no turn at all costs nothing."""


def turn_bound(start: FloatArray, goal: FloatArray, segments: FloatArray) -> float:
    """Return a cost (m) that no path of stable twists from start to goal can beat.

    Args:
        start: (3,) pose of the chain frame in the world.
        goal: Likewise.
        segments: (k, 6) stable twists between two ends; see `controls`.
    """
    turns = turns_of(segments)
    between, step = _headings_between(start, goal, turns), 2.0 * math.pi / DIRECTIONS
    best = 0.0
    for size in SIZES:
        integrals = [_integrals(_rates(sectors, size)) for sectors in (turns.left, turns.right)]
        angles = np.linspace(0.0, 2.0 * math.pi, DIRECTIONS, endpoint=False)
        coarse = _bounds(start, goal, between, integrals, size, angles)
        around = angles[np.argmax(coarse)] + np.linspace(-step, step, DIRECTIONS)
        here = float(max(coarse.max(), _bounds(start, goal, between, integrals, size, around).max()))
        if here <= best:  # the bound is concave in p: shorter ones gain nothing, either
            break
        best = here
    return best


def _bounds(
    start: FloatArray,
    goal: FloatArray,
    between: FloatArray,
    integrals: list[FloatArray],
    size: float,
    angles: FloatArray,
) -> FloatArray:
    """Bounds (d,) with vectors p of a size in directions (d,); see `_headings_between` and `_integrals`."""
    along = size * (np.column_stack([np.cos(angles), np.sin(angles)]) @ (goal[:2] - start[:2]))
    to_there = _cheapest(integrals, start[2], between, angles)
    from_there = _cheapest(integrals, between, goal[2], angles)
    return np.asarray(along + np.min(to_there + from_there, axis=1))


def _headings_between(start: FloatArray, goal: FloatArray, turns: Turns) -> FloatArray:
    """Headings (m,) of which the path meets one: those at which the chain can move along the way, or against it."""
    away = goal[:2] - start[:2]
    headings = np.concatenate([2.0 * math.pi / BINS * np.arange(BINS), [start[2], goal[2]]])
    low, high = turns.lean
    if not away.any() or high - low >= math.pi:
        return headings
    # A bin more on either side: the sum of both integrals is least at start, goal, or where these headings end.
    half, middle = 0.5 * (high - low) + 2.0 * math.pi / BINS, 0.5 * (high + low)
    off = np.abs(se2.wrap_angle(headings + middle - math.atan2(away[1], away[0])))
    return headings[np.minimum(off, math.pi - off) <= half]


def _integrals(rates: FloatArray) -> FloatArray:
    """Integrals (3 BINS + 1,) of rates (BINS,) over the heading, from -2 pi to 4 pi at the bins' edges."""
    return np.concatenate([[0.0], np.cumsum(np.tile(rates, 3))]) * (2.0 * math.pi / BINS)


def _cheapest(
    integrals: list[FloatArray], begin: FloatArray | float, end: FloatArray | float, angles: FloatArray
) -> FloatArray:
    """Lesser integrals (d, m) of the rates from headings to headings (m,), with p in directions (d,)."""
    edges = 2.0 * math.pi / BINS * np.arange(-BINS, 2 * BINS + 1)
    first = (np.asarray(begin) - angles[:, None]) % (2.0 * math.pi)
    to_left = (np.asarray(end) - np.asarray(begin)) % (2.0 * math.pi)
    to_right = (np.asarray(begin) - np.asarray(end)) % (2.0 * math.pi)
    left, right = (
        np.abs(np.interp(first + turn, edges, integral) - np.interp(first, edges, integral))
        for turn, integral in zip((to_left, -to_right), integrals, strict=True)
    )
    return np.asarray(np.minimum(left, right))


def _rates(sectors: FloatArray, size: float) -> FloatArray:
    """Lower bounds of rho (BINS,) on bins of the heading, relative to p's direction, for turns in sectors (k, 3)."""
    if not len(sectors):
        return np.full(BINS, NEVER)
    half = math.pi / BINS
    middles = half * (1.0 + 2.0 * np.arange(BINS))
    radius, middle, width = sectors.T
    off = np.abs(se2.wrap_angle(middles[:, None] + middle)) - width - half
    return np.asarray(TURN_WEIGHT + np.min(radius * (1.0 - size * np.cos(np.maximum(off, 0.0))), axis=1))
