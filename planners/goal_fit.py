"""Arc lengths that bring the end of a motion exactly onto a pose: Newton's method with the smallest change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan import se2
from pushplan.arrays import FloatArray
from pushplan.errors import TimingError
from pushplan.path import PushPath

CLOSE = 1e-12
"""Error (m, rad) of the end that counts as none."""

ENOUGH = 1e-10
"""Error (m, rad) that is accepted when rounding allows no better."""

ROUNDS = 25


class NoFitError(TimingError):
    """No arc lengths near the path's own make a blended motion end where the path does."""


def end_twists(path: PushPath) -> FloatArray:
    """Return (3, k): the body twist at the path's end by which it moves per unit of each arc's length."""
    knots = se2.relative(path.end, path.knots[1:])
    v, omega = se2.rotate(knots[:, 2], path.twists[:, :2]), path.twists[:, 2]
    return np.stack([v[:, 0] + omega * knots[:, 1], v[:, 1] - omega * knots[:, 0], omega])


def fit_lengths(
    end: Callable[[FloatArray], FloatArray], goal: FloatArray, lengths: FloatArray, effect: FloatArray
) -> FloatArray:
    """Return the lengths (k,) at which the motion ends on the goal.

    Args:
        end: Pose (3,) in the world at the end for lengths (k,).
        goal: (3,) pose in the world.
        lengths: (k,) to begin with; long arcs are changed more than short ones, none below 0.
        effect: (3, k) about how the end moves in its own frame per unit of length.

    Raises:
        NoFitError: When Newton's method does not get there.
    """
    best, least = lengths, np.inf
    for _ in range(ROUNDS):
        error = se2.relative(end(lengths), goal)
        size = float(np.abs(error).max())
        if size < least:
            best, least = lengths, size
        if size < CLOSE:
            break
        change = np.linalg.lstsq(effect * lengths, error, rcond=1e-9)[0] * lengths
        lengths = np.maximum(lengths + change, 0.0)
    if least > ENOUGH:
        raise NoFitError(
            f"no arc lengths found that end on the goal: the best miss it by {least:.2g} m or rad"
        )
    return best
