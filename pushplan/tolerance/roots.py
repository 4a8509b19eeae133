"""The smallest size of a change at which a contact is lost at one of many moments."""

from __future__ import annotations

import numpy as np

from pushplan.arrays import FloatArray, IntArray
from pushplan.tolerance.changes import Change

SECTIONS = 12
"""Parts into which an interval is cut: a loss shorter than a twelfth of the first one's size may be missed."""

FINE = 1e-9
"""Share of its size to which a root is found."""

WEAK = 12
"""Moments with the least to spare that bound the size before all are asked."""


def least_polynomial_root(change: Change) -> float:
    """Return the least |size| of either sign at which a contact is lost, where conditions are of degree 2; or inf."""
    model = change.model
    everyone = np.arange(len(model.values))
    below, above = model.values_of(change.at(np.array([-1.0, 1.0])), everyone)
    c = model.values
    a, b = 0.5 * (above + below) - c, 0.5 * (above - below)
    square = b**2 - 4.0 * a * c
    q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(square, 0.0)), b))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.fmin(np.abs(c / q), np.abs(q / a))
    return float(np.min(roots, where=square >= 0.0, initial=np.inf))


def first_loss(change: Change, most: float) -> float:
    """Return the largest size up to `most` before which no contact is lost.

    Every moment is asked at `SECTIONS` sizes between 0 and the size returned.
    """
    order = np.argsort(change.model.slack, kind="stable")
    for which in (order[:WEAK], np.arange(len(order))):
        while most > 0.0:
            found = _narrowed(change, which, most)
            if found is None:
                break
            most = found
    return most


def _narrowed(change: Change, which: IntArray, high: float) -> float | None:
    """Return the size just below a loss in (0, high], None where no contact is lost at `SECTIONS` sizes in it."""
    low, lost = 0.0, False
    while not lost or high - low > FINE * high:
        sizes = low + (high - low) * (np.arange(SECTIONS) + 1.0) / SECTIONS
        bad = _losses(change, sizes, which)
        if not bad.any():
            return high if lost else None
        j = int(np.argmax(bad.any(axis=1)))
        which, lost = which[bad[j]], True
        low, high = (float(sizes[j - 1]) if j else low), float(sizes[j])
    return low


def _losses(change: Change, sizes: FloatArray, which: IntArray) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Return whether a contact is lost (q, k) at sizes (q,) and moments (k,)."""
    variants = change.at(sizes)
    values = change.model.values_of(variants, which).reshape(len(sizes), len(which), -1)
    return np.asarray((values.min(axis=2) <= 0.0) | (variants.holds <= 0.0)[:, None])
