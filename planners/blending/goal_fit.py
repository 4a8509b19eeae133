"""Arc lengths that bring the end of a motion exactly onto a pose: Newton's method with the smallest change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.errors import TimingError
from pushplan.geometry import se2
from pushplan.planners.blending.least_change import least_change
from pushplan.planners.blending.nudge import LengthRows, effects_on
from pushplan.plans.path import PushPath
from pushplan.util.arrays import FloatArray

CLOSE = 1e-12
"""Error (m, rad) of the end that counts as none."""

ENOUGH = 1e-10
"""Error (m, rad) that is accepted when rounding allows no better."""

ROUNDS = 25


class NoFitError(TimingError):
    """No arc lengths near the path's own make a blended motion end where the path does."""


def fit_lengths(
    end: Callable[[FloatArray], FloatArray],
    goal: FloatArray,
    path: PushPath,
    lengths: FloatArray,
    rows: LengthRows,
) -> FloatArray:
    """Return the lengths (k,) at which a motion along a path's twists ends on a pose.

    Args:
        end: Pose (3,) in the world at the end of the motion for lengths (k,).
        goal: (3,) pose in the world, near the path's end.
        path: Tells how the end depends on the lengths, nearly.
        lengths: (k,) to begin with; long arcs are changed more than short ones, none below 0.
        rows: Other conditions that the lengths have to meet: no less than their values.

    Raises:
        NoFitError: When Newton's method does not get there.
    """
    effects = effects_on(path.end, path)
    best, least = lengths, np.inf
    for _ in range(ROUNDS):
        error = se2.relative(end(lengths), goal)
        missing = rows.values - rows.matrix @ lengths
        size = max(float(np.abs(error).max()), float(missing.max(initial=0.0)))
        if size < least:
            best, least = lengths, size
        if size < CLOSE:
            break
        lengths = lengths + _change(effects, error, rows.matrix, missing, lengths)
    if least > ENOUGH:
        raise NoFitError(
            f"no arc lengths found that end on the goal: the best miss a condition by {least:.2g}"
        )
    return best


def _change(
    effects: FloatArray, error: FloatArray, matrix: FloatArray, missing: FloatArray, lengths: FloatArray
) -> FloatArray:
    """The change of the lengths, small in relation to them, that takes away the error and what is missing.

    Raises:
        NoFitError: When what is missing cannot be had without a negative length.
    """
    kept = np.eye(len(lengths))
    share = least_change(
        effects * lengths, error, np.vstack([matrix * lengths, kept]), np.append(missing, -kept.sum(axis=1))
    )
    if share is None:
        raise NoFitError("no arc lengths, none of them negative, keep away from everything that was touched")
    return np.maximum(share, -1.0) * lengths
