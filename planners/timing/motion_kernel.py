"""Where a motion leads, compiled: `trajectory.advance` for a piece at a time.

The formula stands here a second time as reading a log must not load the compiler, and blends ask a thousand times.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import compiled, inlined, no_refcount
from pushplan.util.arrays import FloatArray

_GAUSS = math.sqrt(3.0) / 6.0


@inlined
def _twist(c: FloatArray, tau: float) -> tuple[float, float, float]:
    """Return c0 + c1 tau + c2 tau^2 for c (3, 3)."""
    return (
        c[0, 0] + tau * (c[1, 0] + tau * c[2, 0]),
        c[0, 1] + tau * (c[1, 1] + tau * c[2, 1]),
        c[0, 2] + tau * (c[1, 2] + tau * c[2, 2]),
    )


@no_refcount
def _step(c: FloatArray, begin: float, end: float) -> tuple[float, float, float]:
    """Return the motion under the twist c0 + c1 tau + c2 tau^2, (3, 3), from `begin` to `end`; see `advance`."""
    h, middle = end - begin, 0.5 * (begin + end)
    early, late = middle - _GAUSS * h, middle + _GAUSS * h
    ax, ay, aw = _twist(c, early)
    bx, by, bw = _twist(c, late)
    bracket = math.sqrt(3.0) / 12.0 * h * h
    x = 0.5 * h * (ax + bx) + bracket * (bw * ay - aw * by)
    y = 0.5 * h * (ay + by) + bracket * (aw * bx - bw * ax)
    half = 0.25 * h * (aw + bw)
    chord = 1.0 if abs(half) < 1e-8 else math.sin(half) / half
    p, q = chord * math.cos(half), chord * math.sin(half)
    return p * x - q * y, q * x + p * y, 2.0 * half


@compiled
def poses_after(start: FloatArray, coefficients: FloatArray, durations: FloatArray) -> FloatArray:
    """Return the poses (q + 1, 3) at the ends of pieces with twists `coefficients` (q, 3, 3), from `start` on."""
    out = np.empty((len(durations) + 1, 3))
    out[0] = start
    for i in range(len(durations)):
        x, y, turn = _step(coefficients[i], 0.0, durations[i])
        c, s = math.cos(out[i, 2]), math.sin(out[i, 2])
        out[i + 1, 0] = out[i, 0] + c * x - s * y
        out[i + 1, 1] = out[i, 1] + s * x + c * y
        out[i + 1, 2] = out[i, 2] + turn
    return out
