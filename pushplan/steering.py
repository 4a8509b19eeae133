"""Steering pairs: a left and a right turn of the chain that combine to Dubins' car.

Positive combinations of turns about cL (counter-clockwise) and cR (clockwise) move the point (cL + cR) / 2
along J (cR - cL) with a curvature of at most 2 / |cL - cR|. They are the twists of a great circle of the
twist sphere between the two turns, which passes through the translation d = J (cR - cL) / |cR - cL|: for a
heading d and a position t of the two CORs along d, the CORs are t d + y J d with y -> infinity at the
translation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pushplan.arrays import FloatArray, IntArray, frozen
from pushplan.bracketing import inner_ends

if TYPE_CHECKING:
    from pushplan.stable_set import StableSet

_SAMPLES = 24
_REACH = 1.45
_ZOOMS = 14


@dataclass(frozen=True, eq=False)
class SteeringPair:
    """A left turn, a translation and a right turn on one great circle; None where no such twist is stable.

    All twists between `left` and `right` are stable too, as far as sampling shows. Without a stable
    translation, `left` and `right` are the tightest stable turns, and nothing holds between them.

    Attributes:
        left: (3,) counter-clockwise unit twist.
        straight: (3,) unit translation.
        right: (3,) clockwise unit twist.
        separation: Distance of the two CORs, m; infinite when one is missing.
    """

    left: FloatArray | None
    straight: FloatArray | None
    right: FloatArray | None
    separation: float

    def __iter__(self) -> Iterator[FloatArray | None]:
        """Yield `left`, `straight` and `right`."""
        return iter((self.left, self.straight, self.right))


@dataclass(frozen=True, eq=False)
class _Arcs:
    """Great circles through translations of `heading` (m,), at positions L tan(`tilt`) (m,) along them."""

    stable: StableSet
    minimum: float
    heading: FloatArray
    tilt: FloatArray

    def twists(self, member: IntArray, angle: FloatArray) -> FloatArray:
        """Return unit twists at signed angles from the translation, rad; positive turns left."""
        heading, tilt = self.heading[member], self.tilt[member]
        c, s = np.cos(heading), np.sin(heading)
        along, across = np.cos(angle), -np.sin(angle) * np.sin(tilt)
        turn = np.sin(angle) * np.cos(tilt) / self.stable.chain.characteristic_length
        return np.stack([along * c - across * s, along * s + across * c, turn], axis=1)

    def excess(self, member: IntArray, angle: FloatArray) -> FloatArray:
        return self.stable.margin_values(self.twists(member, angle), self.minimum) - self.minimum

    def ends(self, side: float) -> FloatArray:
        """Return the angle (m,) of the last stable twist from the translation to one side, or 0."""
        m = len(self.heading)
        angles = side * np.linspace(0.0, 0.5 * np.pi, _SAMPLES + 1)
        member = np.repeat(np.arange(m), len(angles))
        values = self.excess(member, np.tile(angles, m)).reshape(m, -1)
        rows, first = np.arange(m), np.argmax(values <= 0.0, axis=1)
        whole = (values > 0.0).all(axis=1)
        first[whole] = len(angles) - 1
        last = np.maximum(first - 1, 0)
        inside = np.where(whole, angles[-1], angles[last])
        ends = inner_ends(self.excess, inside, angles[first], values[rows, last], values[rows, first])
        return np.where(values[:, 0] > 0.0, ends, 0.0)

    def separations(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the distance of the CORs (m,), inf where the translation is not stable, and both angles."""
        left, right = self.ends(+1.0), self.ends(-1.0)
        scale = self.stable.chain.characteristic_length / np.cos(self.tilt)
        with np.errstate(divide="ignore"):
            apart = scale * (1.0 / np.tan(left) - 1.0 / np.tan(right))
        return np.where((left > 0.0) & (right < 0.0), apart, np.inf), left, right


def best_pair(stable: StableSet, minimum: float) -> SteeringPair:
    """Return the pair with the closest CORs; see `StableSet.steering_pair`."""
    cone = _headings(stable, minimum)
    if cone is None:
        return _tightest_turns(stable, minimum)
    return _closest(stable, minimum, np.array([0.5 * (cone[0] + cone[1])]), 0.5 * (cone[1] - cone[0]))


def leaning_pairs(stable: StableSet, minimum: float, count: int) -> tuple[SteeringPair, ...]:
    """Return the best pair and the best ones for headings across the cone; see `StableSet.steering_pairs`."""
    best = best_pair(stable, minimum)
    cone = _headings(stable, minimum)
    if cone is None:
        return (best,)
    inner = np.linspace(cone[0], cone[1], count + 1)[1:-1]
    leaning = [_closest(stable, minimum, np.array([heading]), 0.0) for heading in inner]
    return (best, *(pair for pair in leaning if pair.straight is not None))


def _headings(stable: StableSet, minimum: float) -> tuple[float, float] | None:
    """Return the right-most and left-most heading of the stable translations, rad, the second one larger."""
    cone = stable.translation_cone(minimum)
    if cone is None:
        return None
    right, left = np.arctan2(cone[:, 1], cone[:, 0])
    return float(right), float(right + (left - right) % (2.0 * np.pi))


def _closest(stable: StableSet, minimum: float, middle: FloatArray, spread: float) -> SteeringPair:
    """Search the closest pair over headings within `spread` of `middle` and all tilts, zooming in."""
    headings, tilts = (9 if spread > 0.0 else 1), 31
    at, half = (float(middle[0]), 0.0), [0.98 * spread, _REACH]
    best: tuple[float, tuple[float, ...]] = (np.inf, (at[0], 0.0, 0.0, 0.0))
    for _ in range(_ZOOMS):
        h = at[0] + half[0] * np.linspace(-1.0, 1.0, headings)
        u = np.clip(at[1] + half[1] * np.linspace(-1.0, 1.0, tilts), -_REACH, _REACH)
        grid = [axis.ravel() for axis in np.meshgrid(h, u, indexing="ij")]
        apart, left, right = _Arcs(stable, minimum, *grid).separations()
        k = int(np.argmin(apart))
        if apart[k] < best[0]:
            best = (float(apart[k]), (grid[0][k], grid[1][k], left[k], right[k]))
        at = best[1][0], best[1][1]
        half = [0.35 * half[0], 0.35 * half[1]] if headings <= 5 else [half[0] / 3.0, half[1] / 10.0]
        headings, tilts = (5 if spread > 0.0 else 1), 5
    return _pair(stable, minimum, *best)


def _pair(stable: StableSet, minimum: float, apart: float, found: tuple[float, ...]) -> SteeringPair:
    heading, tilt, left, right = found
    arc = _Arcs(stable, minimum, np.full(3, heading), np.full(3, tilt))
    twists = arc.twists(np.arange(3), np.array([left, 0.0, right]))
    if not np.isfinite(apart):
        return SteeringPair(None, None, None, np.inf)
    frozen_twists = [frozen(twist, (3,), "steering twist") for twist in twists]
    return SteeringPair(frozen_twists[0], frozen_twists[1], frozen_twists[2], apart)


def _tightest_turns(stable: StableSet, minimum: float) -> SteeringPair:
    """Return the pair without a translation: the tightest stable turn of either sense, if any."""
    rows = stable.refined_meridians(minimum).meridians
    left = right = None
    if len(rows) and rows.upper.max() > 0.0:
        k = int(rows.upper.argmax())
        left = _turn(stable, rows.longitude[k], rows.upper[k])
    if len(rows) and rows.lower.min() < 0.0:
        k = int(rows.lower.argmin())
        right = _turn(stable, rows.longitude[k], rows.lower[k])
    return SteeringPair(left, None, right, np.inf)


def _turn(stable: StableSet, longitude: float, latitude: float) -> FloatArray:
    from pushplan.sphere import twists_at

    return frozen(twists_at(longitude, latitude, stable.chain.characteristic_length), (3,), "steering twist")
