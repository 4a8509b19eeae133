"""The smallest size of a change at which a contact is lost at one of many moments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pushplan.sim.robustness.change_kernel import lost_contacts
from pushplan.sim.robustness.changes import Change
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

SECTIONS = 12
"""Parts into which an interval is cut when a root is narrowed down."""

CHECKS = 6
"""Sizes up to the one found at which every moment is asked; a loss that ends again between two of them is missed."""

FINE = 1e-8
"""Share of its size to which a root is found."""

WEAK = 12
"""Moments with the least to spare that bound the size before all are asked."""

Asked = list[tuple[Change, IntArray]]
"""Changes, and the moments (k,) at which each may lose a contact."""


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


def first_loss(changes: Sequence[Change], most: float) -> float:
    """Return the largest size up to `most` before which none of the changes loses a contact."""
    if not changes:
        return most
    order = np.argsort(changes[0].model.slack, kind="stable")
    found = _narrowed([(change, order[:WEAK]) for change in changes], most, SECTIONS)
    most, everyone = most if found is None else found, np.arange(len(order))
    while True:
        found = _narrowed([(change, everyone) for change in changes], most, CHECKS)
        if found is None:
            return most
        most = found


def _narrowed(asked: Asked, high: float, sections: int) -> float | None:
    """Return the size just below the first loss in (0, high], None where no contact is lost at any size tried."""
    low, lost = 0.0, False
    while not lost or high - low > FINE * high:
        sizes = low + (high - low) * (np.arange(sections) + 1.0) / sections
        losses = [_losses(change, sizes, which) for change, which in asked]
        sizes_with = np.any([found.any(axis=1) for found in losses], axis=0)
        if not sizes_with.any():
            return high if lost else None
        j, sections, lost = int(np.argmax(sizes_with)), SECTIONS, True
        pairs = zip(asked, losses, strict=True)
        asked = [(change, which[found[j]]) for (change, which), found in pairs if found[j].any()]
        low, high = (float(sizes[j - 1]) if j else low), float(sizes[j])
    return low


def _losses(change: Change, sizes: FloatArray, which: IntArray) -> BoolArray:
    """Return whether a contact is lost (q, k) at sizes (q,) and moments (k,)."""
    variants = change.at(sizes)
    return lost_contacts(change.model.values_of(variants, which), variants.holds)
