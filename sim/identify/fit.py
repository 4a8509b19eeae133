"""The most likely place in the unit cube, by least squares from several starts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from pushplan.util.arrays import FloatArray

STEP = 5e-3
"""Of finite differences in the unit cube: mode switches make errors slightly uneven on smaller ones."""
LOOKED_AT, STARTS = 256, 4
"""Places that are looked at, and the best of them, from which a search for the most likely one begins."""

Errors = Callable[[FloatArray], FloatArray]
"""From a place (p,) in the unit cube to errors (k,) over their expected size."""


def best_starts(errors: Errors, count: int) -> list[FloatArray]:
    """Return the best of some places (p,) spread over the unit cube, its middle among them."""
    spread = qmc.Sobol(count, seed=1).random(LOOKED_AT) if count else np.zeros((1, 0))
    places = np.vstack([np.full((1, count), 0.5), 0.02 + 0.96 * spread])
    return list(places[np.argsort([cost(errors(place)) for place in places], kind="stable")[:STARTS]])


def cost(errors: FloatArray) -> float:
    """Return the sum of squares."""
    return float((np.asarray(errors) ** 2).sum())


def refined(
    errors: Errors, start: FloatArray, jacobian: Callable[[FloatArray], FloatArray], free: int
) -> FloatArray:
    """Return the nearest place with the least sum of squares.

    Args:
        errors: Of all unknowns, those in the unit cube first.
        start: (p + free,) where to begin.
        jacobian: Of `errors`.
        free: Number of unknowns behind those in the unit cube that may have any value.
    """
    bounded = len(start) - free
    low = np.concatenate([np.zeros(bounded), np.full(free, -np.inf)])
    high = np.concatenate([np.ones(bounded), np.full(free, np.inf)])
    # Off the sides: the trust region of `least_squares` scales by the distance to bounds and would hardly leave one.
    inside = np.concatenate([np.clip(start[:bounded], 0.01, 0.99), start[bounded:]])
    found = least_squares(errors, inside, jac=jacobian, bounds=(low, high), xtol=1e-4, ftol=1e-4, max_nfev=20)
    return np.asarray(found.x)
