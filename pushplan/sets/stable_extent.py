"""How far a stable set extends: its translation cone, smallest turning radii and area on the twist sphere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.mechanics.sphere import POLE, Meridians, TurningRadii, twists_at
from pushplan.sets.boundary_following import RefinedMeridians
from pushplan.sets.meridians import inner_ends, maximise
from pushplan.util.arrays import FloatArray, IntArray, frozen

_DIRECTIONS = 720


def translation_cone(margin_values: Callable[[FloatArray], FloatArray], minimum: float) -> FloatArray | None:
    """Return unit directions [right-most, left-most] (2, 2) of translations with margin > `minimum`.

    Each contact allows a convex cone of directions, so that the intersection is one cone.
    """

    def excess(member: IntArray, lon: FloatArray) -> FloatArray:
        del member
        return margin_values(twists_at(lon, np.zeros_like(lon), 1.0)) - minimum

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
        bracket = np.array([[inside, ring[first], f_inside, values[first]]])
        ends.append(float(inner_ends(excess, bracket)[0]))
    return frozen([[np.cos(end), np.sin(end)] for end in ends], (2, 2), "translation cone")


def turning_radii(meridians: Meridians, length: float) -> TurningRadii:
    """Return the smallest distance from the origin to a COR on meridians, either sense, for a unit of length, m."""
    highest = np.concatenate([[0.0], meridians.upper]).max()
    lowest = np.concatenate([[0.0], meridians.lower]).min()
    return TurningRadii(left=_radius(highest, length), right=_radius(-lowest, length))


def _radius(latitude: float, length: float) -> float:
    return length * max(float(np.tan(POLE - latitude)), 0.0) if latitude > 0.0 else np.inf


def sphere_area(refined: RefinedMeridians) -> float:
    """Return the solid angle of the twists on refined meridians, sr.

    Between refined meridians, d apart, ends run along great circles, from a to b; the area between that and the
    equator is 2 atan(tan(d / 2) sin((a + b) / 2) / cos((a - b) / 2)).
    """
    rows = refined.meridians
    first = np.append(np.searchsorted(rows.longitude, refined.longitude), len(rows))
    count, apart = np.diff(first), np.diff(refined.longitude)
    gaps = np.flatnonzero(count[:-1] == count[1:])  # others are no wider than SMALLEST_GAP
    area = 0.0
    for j in range(count.max(initial=0)):
        k = gaps[count[gaps] > j]
        for end, sign in ((rows.upper, +1.0), (rows.lower, -1.0)):
            a, b = end[first[k] + j], end[first[k + 1] + j]
            height = np.sin(0.5 * (a + b)) / np.cos(0.5 * (a - b))
            area += sign * float(2.0 * np.arctan(np.tan(0.5 * apart[k]) * height).sum())
    return area
