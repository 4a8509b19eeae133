"""Exact timing of a path: a jerk-limited profile from rest to rest along each twist, computed by Ruckig.

Neighbouring arcs of the same twist are driven as one, without a stop between them.
"""

from __future__ import annotations

import numpy as np

from pushplan.planners.timing.arc_limits import limits_of_arcs
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.timing.profile import ArcLimits, rest_to_rest, split
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import SAMPLE_RATE, Trajectory
from pushplan.util.arrays import FloatArray, IntArray

SAME = 1e-12
"""Twists that differ by less (m/s, rad/s) are the same motion."""


def time_path(path: PushPath, bounds: Bounds, rate: float = SAMPLE_RATE) -> Trajectory:
    """Return the trajectory that stops wherever the path's twist changes.

    Args:
        path: Constant-twist arcs.
        bounds: What limits the motion.
        rate: Samples per second of the trajectory.

    Raises:
        TimingError: When an arc cannot be timed.
    """
    durations: list[FloatArray] = [np.zeros(0)]
    coefficients: list[FloatArray] = [np.zeros((0, 3, 3))]
    arcs: list[FloatArray] = [np.zeros(0)]
    driven = runs(path)
    twists = np.array([path.twists[run[0]] for run in driven]).reshape(-1, 3)
    totals = np.array([path.lengths[run].sum() for run in driven])
    for run, limits in zip(driven, limits_of_arcs(twists, totals, bounds), strict=True):
        spent, pieces, owner = time_run(path.twists[run[0]], path.lengths[run], limits)
        durations.append(spent)
        coefficients.append(pieces)
        arcs.append(run[owner].astype(np.float64))
    breaks = np.concatenate([[0.0], np.cumsum(np.concatenate(durations))])
    return Trajectory(path.start, breaks, np.concatenate(coefficients), np.concatenate(arcs), rate)


def runs(path: PushPath) -> list[IntArray]:
    """Return the indices of the arcs that have a length, neighbours of the same twist together."""
    kept = np.flatnonzero(path.lengths > 0.0)
    change = np.abs(np.diff(path.twists[kept], axis=0)).max(axis=1, initial=0.0) > SAME
    return np.split(kept, np.flatnonzero(change) + 1) if len(kept) else []


def time_run(
    twist: FloatArray, lengths: FloatArray, limits: ArcLimits
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Drive arcs (a,) of the same twist (3,) from rest to rest within the limits of their parameter.

    Returns:
        durations (q,) in s, coefficients (q, 3, 3) of the twist, and (q,) which of the arcs each piece is on.
    """
    total = float(lengths.sum())
    profile = rest_to_rest(total, limits)
    pieces, passed = split(profile, np.cumsum(lengths)[:-1])
    return pieces.durations, pieces.rates[:, :, None] * twist, passed
