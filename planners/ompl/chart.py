"""The chart of the stable set: three coordinates in [0, 1] name a stable arc, and any arc has its coordinates.

The stable set is known as segments, every positive combination of whose ends is stable (`controls`); between two
meridians nothing is proven. So the first coordinate says which segment, the second where on it, and the third how
long the arc is, in units of the longest one; one that is longer takes several units of time. A share of the first
coordinate stands for the turns and straight pushes of the steering families (`search.choose_twist`), which uniform
samples thus take more often.
"""

from __future__ import annotations

import math

import numpy as np

from pushplan.compiled import compiled, inlined, no_refcount
from pushplan.planners.collision.separation import step, sweep_is_free
from pushplan.planners.problem.problem import END_SHARE, LETTER_SHARE, Problem, choose_twist
from pushplan.util.arrays import FloatArray


@compiled
def arcs_at(problem: Problem, controls: FloatArray) -> FloatArray:
    """Return the arcs (k, 4), twists and lengths, of controls (k, 4): coordinates, and units that they go on for."""
    arcs = np.empty((controls.shape[0], 4))
    for i in range(controls.shape[0]):
        arcs[i, 0], arcs[i, 1], arcs[i, 2] = choose_twist(problem, controls[i, 0], controls[i, 1])
        arcs[i, 3] = controls[i, 2] * controls[i, 3] * problem.longest
    return arcs


@compiled
def controls_of(problem: Problem, arcs: FloatArray) -> FloatArray:
    """Return controls (k, 4) of arcs (k, 4), with whole units; not finite where a twist is on no segment."""
    controls = np.empty((arcs.shape[0], 4))
    for i in range(arcs.shape[0]):
        segment, share = _place(problem.segments, arcs[i, 0], arcs[i, 1], arcs[i, 2])
        units = max(1.0, math.ceil(arcs[i, 3] / problem.longest))
        controls[i, 0] = LETTER_SHARE + (1.0 - LETTER_SHARE) * (segment + 0.5) / problem.segments.shape[0]
        controls[i, 1] = END_SHARE + (1.0 - 2.0 * END_SHARE) * share
        controls[i, 2] = arcs[i, 3] / (units * problem.longest)
        controls[i, 3] = units
    return controls


@no_refcount
def _place(segments: FloatArray, tx: float, ty: float, tz: float) -> tuple[int, float]:
    """Return the segment that a twist t lies on, and the share b of its second end; b is no number if there is none.

    Up to a factor, t = (1 - b) a + b c: with t in the plane of the ends a and c, b = |a x t| / (|a x t| + |t x c|).
    """
    # Farther from every segment than 1e-9 of its size, a twist is not in the set.
    nearest, found, share = 1e-18 * (tx * tx + ty * ty + tz * tz), 0, np.nan
    for i in range(segments.shape[0]):
        ax, ay, az = segments[i, 0], segments[i, 1], segments[i, 2]
        cx, cy, cz = segments[i, 3], segments[i, 4], segments[i, 5]
        before = _span(ax, ay, az, tx, ty, tz)
        behind = _span(tx, ty, tz, cx, cy, cz)
        b = before / (before + behind) if before + behind > 0.0 else 0.0
        mx, my, mz = ax + b * (cx - ax), ay + b * (cy - ay), az + b * (cz - az)
        factor = (mx * tx + my * ty + mz * tz) / (mx * mx + my * my + mz * mz)
        dx, dy, dz = factor * mx - tx, factor * my - ty, factor * mz - tz
        away = dx * dx + dy * dy + dz * dz
        if factor > 0.0 and away < nearest:
            nearest, found, share = away, i, b
    return found, share


@inlined
def _span(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    """Size of the cross product of two vectors."""
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return math.sqrt(x * x + y * y + z * z)


@compiled
def poses_along(problem: Problem, start: FloatArray, arcs: FloatArray) -> tuple[FloatArray, int]:
    """Return the poses (k + 1, 3) at the ends of arcs (k, 4), and how many arcs come before one that is not free."""
    poses, free = np.empty((arcs.shape[0] + 1, 3)), arcs.shape[0]
    poses[0] = start
    for i in range(arcs.shape[0]):
        x, y, theta = poses[i, 0], poses[i, 1], poses[i, 2]
        vx, vy, omega, length = arcs[i, 0], arcs[i, 1], arcs[i, 2], arcs[i, 3]
        if free > i and length > 0.0 and not sweep_is_free(problem.scene, x, y, theta, vx, vy, omega, length):
            free = i
        poses[i + 1, 0], poses[i + 1, 1], poses[i + 1, 2] = step(x, y, theta, vx, vy, omega, length)
    return poses, free
