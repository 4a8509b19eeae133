"""How far a stable set extends: its translation cone, smallest turning radii and area on the twist sphere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pushplan.basics.arrays import FloatArray, IntArray, frozen
from pushplan.mechanics.sphere import POLE, TurningRadii, twists_at
from pushplan.stable_sets.boundary.bracketing import inner_ends, maximise

if TYPE_CHECKING:
    from pushplan.stable_sets.stable_set import StableSet

_DIRECTIONS = 720


def translation_cone(stable: StableSet, minimum: float) -> FloatArray | None:
    """Return unit directions [right-most, left-most] (2, 2) of translations with margin > `minimum`.

    Each contact allows a convex cone of directions, so that the intersection is one cone.
    """

    def excess(member: IntArray, lon: FloatArray) -> FloatArray:
        del member
        return stable.margin_values(twists_at(lon, np.zeros_like(lon), 1.0)) - minimum

    lon = -np.pi + 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    step = lon[1] - lon[0]
    middle = lon[[int(np.argmax(excess(np.arange(len(lon)), lon)))]]
    best, value = maximise(excess, middle - step, middle + step, 0.0, 40)
    if value[0] <= 0.0:
        return None
    offsets = step * np.arange(1, _DIRECTIONS)
    ends = []
    for side in (-1.0, +1.0):
        ring = best[0] + side * offsets
        values = excess(np.arange(len(ring)), ring)
        first = int(np.argmax(values <= 0.0))
        inside = ring[first - 1] if first else best[0]
        f_inside = values[first - 1] if first else value[0]
        bracket = (np.array([inside]), ring[[first]], np.array([f_inside]), values[[first]])
        ends.append(float(inner_ends(excess, *bracket)[0]))
    return frozen([[np.cos(end), np.sin(end)] for end in ends], (2, 2), "translation cone")


def turning_radii(stable: StableSet, minimum: float) -> TurningRadii:
    """Return the smallest distance from the origin to a COR with margin > `minimum`, either sense."""
    meridians = stable.refined_meridians(minimum).meridians
    length = stable.chain.characteristic_length
    highest = np.concatenate([[0.0], meridians.upper]).max()
    lowest = np.concatenate([[0.0], meridians.lower]).min()
    return TurningRadii(left=_radius(highest, length), right=_radius(-lowest, length))


def _radius(latitude: float, length: float) -> float:
    return length * max(float(np.tan(POLE - latitude)), 0.0) if latitude > 0.0 else np.inf


def sphere_area(stable: StableSet) -> float:
    """Return the solid angle of the stable twists, sr: trapezoids between refined meridians."""
    refined = stable.refined_meridians()
    rows = refined.meridians
    at = np.searchsorted(refined.longitude, rows.longitude)
    heights = np.bincount(at, np.sin(rows.upper) - np.sin(rows.lower), minlength=len(refined.longitude))
    return float(np.trapezoid(heights, refined.longitude))
