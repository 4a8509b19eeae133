"""Stable intervals on one meridian of the twist sphere, compiled: what `intervals` does for many at once."""

from __future__ import annotations

import math

import numpy as np

from pushplan.basics.arrays import FloatArray
from pushplan.compiled import compiled, inlined, no_refcount
from pushplan.mechanics.sphere import POLE
from pushplan.stable_sets.boundary.bracketing import TOLERANCE
from pushplan.stable_sets.boundary.intervals import PROMISING
from pushplan.stable_sets.boundary.margin_kernel import Packed, margin_of
from pushplan.stable_sets.boundary.meridians import LATITUDES

Line = tuple[float, float, float, float]
"""A meridian: cosine and sine of its longitude, characteristic length (m), and the margin to exceed."""

_GRID = np.linspace(-POLE, POLE, LATITUDES)
_PARTS = 5
_STEPS = 14
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_WIDEN = 4.0
_MOST_WIDENINGS = 4
_SMALL_PUSH = 1e-3


@compiled
def excess(packed: Packed, line: Line, latitude: float) -> float:
    """Return by how much the margin at a latitude exceeds the one asked for; inexact below -PROMISING."""
    flat, minimum = math.cos(latitude), line[3]
    turn = math.sin(latitude) / line[2]
    return margin_of(packed, flat * line[0], flat * line[1], turn, minimum - PROMISING) - minimum


@compiled
def inner_end(
    packed: Packed, line: Line, a: float, b: float, fa: float, fb: float, push: float = 0.2
) -> float:
    """Return the last latitude above 0 on the way from a (fa > 0) to b (fb <= 0): ITP, see `bracketing`.

    The first point is moved by `push` of the bracket beyond the secant's root: little where the secant is good.
    """
    width = abs(b - a)
    steps, kappa = math.ceil(math.log2(max(width / TOLERANCE, 1.0))) + 2.0, push / max(width, TOLERANCE)
    while abs(b - a) > TOLERANCE and 0.5 * (a + b) != a:
        half, gap = 0.5 * (a + b), abs(b - a)
        falsi = (fb * a - fa * b) / (fb - fa)
        delta = max(kappa * gap * gap, 0.4 * TOLERANCE)
        towards = math.copysign(1.0, half - falsi)
        x = falsi + towards * delta if delta <= abs(half - falsi) else half
        reach = max(0.5 * TOLERANCE * 2.0 ** max(steps, 0.0) - 0.5 * gap, 0.0)
        if abs(x - half) > reach:
            x = half - towards * reach
        value = excess(packed, line, x)
        if value > 0.0:
            a, fa = x, value
        else:
            b, fb = x, value
        steps -= 1.0
    return a


@inlined
def _beyond(packed: Packed, line: Line, low: float, high: float, sign: float) -> tuple[float, float]:
    """Return a place between low and high where sign times the excess is above 0, or the largest found."""
    x1, x2 = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    f1, f2 = sign * excess(packed, line, x1), sign * excess(packed, line, x2)
    for _ in range(_STEPS):
        if max(f1, f2) > 0.0:
            break
        if f1 < f2:
            low, x1, f1 = x1, x2, f2
            x2 = low + _GOLDEN * (high - low)
            f2 = sign * excess(packed, line, x2)
        else:
            high, x2, f2 = x2, x1, f1
            x1 = high - _GOLDEN * (high - low)
            f1 = sign * excess(packed, line, x1)
    return (x1, sign * f1) if f1 >= f2 else (x2, sign * f2)


@no_refcount
def _sort(rows: FloatArray) -> None:
    """Sort rows (k, 2) by their first column; there are few, and most are in order."""
    for i in range(1, len(rows)):
        x, value, j = rows[i, 0], rows[i, 1], i
        while j > 0 and rows[j - 1, 0] > x:
            rows[j, 0], rows[j, 1] = rows[j - 1, 0], rows[j - 1, 1]
            j -= 1
        rows[j, 0], rows[j, 1] = x, value


@inlined
def _sampled(packed: Packed, line: Line, hints: FloatArray) -> FloatArray:
    """Return samples (k, 2) of latitude and excess, in order."""
    out = np.empty((len(_GRID) + len(hints), 2))
    for i in range(len(out)):
        out[i, 0] = _GRID[i] if i < len(_GRID) else hints[i - len(_GRID)]
        out[i, 1] = excess(packed, line, out[i, 0])
    _sort(out)
    return out


@inlined
def _closer(packed: Packed, line: Line, samples: FloatArray) -> FloatArray:
    """Return samples (k, 2) with some more in every gap with a change of sign, as there may be several."""
    out, k = np.empty((len(samples) * _PARTS, 2)), 0
    for i in range(len(samples)):
        out[k, 0], out[k, 1], k = samples[i, 0], samples[i, 1], k + 1
        if i + 1 < len(samples) and (samples[i, 1] > 0.0) != (samples[i + 1, 1] > 0.0):
            for j in range(1, _PARTS):
                x = samples[i, 0] + (samples[i + 1, 0] - samples[i, 0]) * j / _PARTS
                out[k, 0], out[k, 1], k = x, excess(packed, line, x), k + 1
    return out[:k]


@inlined
def _with_extremes(packed: Packed, line: Line, samples: FloatArray) -> FloatArray:
    """Return samples (k, 2) with peaks above 0 and dips below 0 that lie between them."""
    out, k = np.empty((2 * len(samples), 2)), len(samples)
    for i in range(k):
        out[i, 0], out[i, 1] = samples[i, 0], samples[i, 1]
    for i in range(1, len(samples) - 1):
        sign = -1.0 if samples[i, 1] > 0.0 else 1.0
        here = sign * samples[i, 1]
        if here > -PROMISING and here >= sign * samples[i - 1, 1] and here >= sign * samples[i + 1, 1]:
            x, value = _beyond(packed, line, samples[i - 1, 0], samples[i + 1, 0], sign)
            if sign * value > 0.0:
                out[k, 0], out[k, 1], k = x, value, k + 1
    _sort(out[:k])
    return out[:k]


@compiled
def scan(packed: Packed, line: Line, hints: FloatArray) -> FloatArray:
    """Return all intervals (c, 2) on a meridian that samples, or peaks and dips between samples, tell of."""
    samples = _sampled(packed, line, hints)
    samples = _with_extremes(packed, line, _closer(packed, line, samples))
    last, out, c = len(samples) - 1, np.empty((len(samples), 2)), 0
    for i in range(last + 1):
        x, value = samples[i, 0], samples[i, 1]
        for j in range(2):
            other = min(max(i + 2 * j - 1, 0), last)
            beside = samples[other, 1]
            if value > 0.0 and other == i:
                out[c, j], c = x, c + j
            elif value > 0.0 and beside <= 0.0:
                out[c, j], c = inner_end(packed, line, x, samples[other, 0], value, beside), c + j
    return out[:c]


@inlined
def _end_near(packed: Packed, line: Line, x: float, reach: float, outward: float) -> float:
    """Return the end near x of an interval that extends against `outward` (+1 or -1), or nan."""
    value = excess(packed, line, x)
    side = outward if value > 0.0 else -outward
    for _ in range(_MOST_WIDENINGS):
        other = x + side * reach
        beside = excess(packed, line, other)
        if (beside > 0.0) != (value > 0.0):
            if value > 0.0:
                return inner_end(packed, line, x, other, value, beside, _SMALL_PUSH)
            return inner_end(packed, line, other, x, beside, value, _SMALL_PUSH)
        x, value, reach = other, beside, _WIDEN * reach
    return math.nan


@compiled
def follow(packed: Packed, line: Line, ends: FloatArray, reach: FloatArray) -> tuple[bool, FloatArray]:
    """Return the intervals (c, 2) whose ends are near `ends` (c, 2), and whether there are that many.

    `reach` (c, 2) is how far away the ends are thought to be. What lies elsewhere on the meridian is not looked at.
    """
    found = np.empty_like(ends)
    for i in range(len(ends)):
        for j in range(2):
            outward = -1.0 if j == 0 else 1.0
            if abs(ends[i, j]) >= POLE:
                found[i, j] = outward * POLE
                if not excess(packed, line, found[i, j]) > 0.0:
                    return False, found
            else:
                found[i, j] = _end_near(packed, line, ends[i, j], reach[i, j], outward)
                if not abs(found[i, j]) < POLE:
                    return False, found
        before = found[i - 1, 1] if i > 0 else -math.inf
        if not before < found[i, 0] <= found[i, 1]:
            return False, found
        if i > 0 and excess(packed, line, 0.5 * (before + found[i, 0])) > 0.0:
            return False, found
        if not excess(packed, line, 0.5 * (found[i, 0] + found[i, 1])) > 0.0:
            return False, found
    return True, found
