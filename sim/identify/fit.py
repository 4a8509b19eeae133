"""The most likely place in the unit cube, by least squares with or without heavy tails."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from pushplan.basics.arrays import FloatArray

STEP = 5e-3
"""Of finite differences in the unit cube: mode switches make errors slightly uneven on smaller ones."""
STARTS = 32
"""Places that are looked at before the best is refined."""

Errors = Callable[[FloatArray], FloatArray]
"""From a place (p,) in the unit cube to errors (k,) over their expected size."""


def best_start(errors: Errors, count: int, robust: bool = False) -> FloatArray:
    """Return the best of some places (p,) spread over the unit cube, its middle among them."""
    spread = qmc.Sobol(count, seed=1).random(STARTS) if count else np.zeros((1, 0))
    places = np.vstack([np.full((1, count), 0.5), 0.02 + 0.96 * spread])
    return np.asarray(places[int(np.argmin([cost(errors(place), robust) for place in places]))])


def cost(errors: FloatArray, robust: bool) -> float:
    """Return the sum of squares, or with heavy tails of 2 (sqrt(1 + e^2) - 1)."""
    squares = np.asarray(errors) ** 2
    return float(2.0 * (np.sqrt(1.0 + squares) - 1.0).sum() if robust else squares.sum())


def refined(
    errors: Errors,
    start: FloatArray,
    robust: bool = False,
    jacobian: Callable[[FloatArray], FloatArray] | None = None,
    free: int = 0,
) -> FloatArray:
    """Return the nearest place with the least cost.

    Args:
        errors: Of all unknowns, those in the unit cube first.
        start: (p + free,) where to begin.
        robust: Errors have heavy tails.
        jacobian: Of `errors`; None for finite differences.
        free: Number of unknowns behind those in the unit cube that may have any value.
    """
    bounded = len(start) - free
    low = np.concatenate([np.zeros(bounded), np.full(free, -np.inf)])
    high = np.concatenate([np.ones(bounded), np.full(free, np.inf)])
    inside = np.concatenate([np.clip(start[:bounded], 0.01, 0.99), start[bounded:]])
    found = least_squares(
        errors,
        inside,
        jac=jacobian or (lambda place: differences(errors, place)),
        bounds=(low, high),
        loss="soft_l1" if robust else "linear",
        xtol=1e-4,
        ftol=1e-4,
        max_nfev=20,
    )
    return np.asarray(found.x)


def differences(errors: Errors, place: FloatArray) -> FloatArray:
    """Return the derivatives of the errors (k, p) by finite differences that stay in the unit cube."""
    base = errors(place)
    columns = []
    for j in range(len(place)):
        step = STEP if place[j] < 0.5 else -STEP
        moved = place.copy()
        moved[j] += step
        columns.append((errors(moved) - base) / step)
    return np.stack(columns, axis=1) if columns else np.zeros((len(base), 0))
