"""Steering pairs: a left and a right turn of the chain that combine to Dubins' car.

Positive combinations of turns about cL (counter-clockwise) and cR (clockwise) move the point (cL + cR) / 2 along
J (cR - cL) with a curvature of at most 2 / |cL - cR|. On the twist sphere they are the great circle between the two
turns, which passes through that translation. The closest CORs lie on the boundary of the set, where meridians
leave it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pushplan.arrays import FloatArray, IntArray, frozen
from pushplan.mechanics.sphere import Meridians, twists_at
from pushplan.stable_sets.boundary_turns import BoundaryTurns, TurnPairs, close_pairs
from pushplan.stable_sets.intervals import Samples, find_intervals

if TYPE_CHECKING:
    from pushplan.stable_sets.stable_set import StableSet

_COUNT = 512
_FEW = 64
_TRIED = 24
_SAMPLES = 97
_ROUNDS = 3
_AROUND = np.linspace(-1.0, 1.0, 17)


@dataclass(frozen=True, eq=False)
class SteeringPair:
    """A left turn, a translation and a right turn on one great circle; None where no such twist is stable.

    All positive combinations of `left` and `right` are stable too, as far as dense sampling shows. Without a stable
    translation, `left` and `right` are the tightest stable turns, and nothing holds between them.

    Attributes:
        left: (3,) counter-clockwise unit twist.
        straight: (3,) unit translation.
        right: (3,) clockwise unit twist.
        separation: Distance of the two CORs, m; infinite without a translation.
    """

    left: FloatArray | None
    straight: FloatArray | None
    right: FloatArray | None
    separation: float

    def __iter__(self) -> Iterator[FloatArray | None]:
        """Yield `left`, `straight` and `right`."""
        return iter((self.left, self.straight, self.right))


def steering_pairs(stable: StableSet, minimum: float, sectors: int) -> tuple[SteeringPair, ...]:
    """Return the best pair of all, then the best one in each of `sectors` equal sectors of headings.

    Sectors without a pair are left out, and the one that holds the best of all.
    """
    cone = stable.translation_cone(minimum)
    if cone is None:
        return (_tightest_turns(stable, minimum),)
    right, left = np.arctan2(cone[:, 1], cone[:, 0])
    edges = np.linspace(right, right + (left - right) % (2.0 * np.pi), sectors + 1)
    rows = stable.meridians(minimum, _COUNT)
    if len(rows) < _FEW:
        rows = stable.refined_meridians(minimum).meridians
    best = _closest(stable, minimum, rows, (edges[0], edges[-1]))
    if best is None:
        return (_tightest_turns(stable, minimum),)
    apart = [sector for sector in pairwise(edges) if not sector[0] <= best.heading < sector[1]]
    others = [_closest(stable, minimum, rows, sector) for sector in apart]
    return tuple(_pair(found) for found in (best, *others) if found is not None)


class _Found(NamedTuple):
    """A sound pair: unit twists left and right, their longitudes, the heading between, rad, the distance, m."""

    left: FloatArray
    right: FloatArray
    longitudes: tuple[float, float]
    heading: float
    separation: float


def _closest(
    stable: StableSet, minimum: float, rows: Meridians, sector: tuple[float, float]
) -> _Found | None:
    """Return the closest pair that `rows`, and finer ones around its turns, offer for headings in a sector."""
    length, gap = stable.chain.characteristic_length, 2.0 * np.pi / _COUNT
    left, right = (BoundaryTurns.of(rows, sense, length) for sense in (+1, -1))
    best = _first_sound(stable, minimum, close_pairs(left, right, *sector, _TRIED))
    for _ in range(_ROUNDS):
        if best is None:
            return None
        near = [stable.meridians_at(lon + gap * _AROUND, minimum) for lon in best.longitudes]
        left, right = BoundaryTurns.of(near[0], +1, length), BoundaryTurns.of(near[1], -1, length)
        found = _first_sound(stable, minimum, close_pairs(left, right, *sector, _TRIED))
        best = best if found is None or found.separation >= best.separation else found
        gap *= _AROUND[1] - _AROUND[0]
    return best


def _first_sound(stable: StableSet, minimum: float, pairs: TurnPairs) -> _Found | None:
    """Return the first pair between whose turns all twists have the margin, as far as samples and dips tell."""
    scale = np.array([1.0, 1.0, stable.chain.characteristic_length])
    shares = pairs.shares(_SAMPLES, scale)
    members = np.repeat(np.arange(len(shares)), shares.shape[1])

    def excess(member: IntArray, share: FloatArray) -> FloatArray:
        return stable.margin_values(pairs.at(member, share, scale), minimum) - minimum

    margins = excess(members, shares.ravel()).reshape(shares.shape)
    for k in np.flatnonzero((margins > 0.0).all(axis=1)):
        places = np.unique(shares[k])
        alone = Samples(np.full(len(places), k), places)
        if len(find_intervals(excess, alone).member) == 1:
            return _found(pairs, int(k))
    return None


def _found(pairs: TurnPairs, k: int) -> _Found:
    left, right, i, j = pairs.left, pairs.right, int(pairs.i[k]), int(pairs.j[k])
    longitudes = float(left.longitude[i]), float(right.longitude[j])
    return _Found(
        left.twist[i], right.twist[j], longitudes, float(pairs.heading[k]), float(pairs.separation[k])
    )


def _pair(found: _Found) -> SteeringPair:
    straight = [np.cos(found.heading), np.sin(found.heading), 0.0]
    left, middle, right = (frozen(v, (3,), "steering twist") for v in (found.left, straight, found.right))
    return SteeringPair(left, middle, right, found.separation)


def _tightest_turns(stable: StableSet, minimum: float) -> SteeringPair:
    """Return the pair without a translation: the tightest stable turn of either sense, if any."""
    rows = stable.refined_meridians(minimum).meridians
    left = _turn(stable, rows.longitude, rows.upper, +1)
    return SteeringPair(left, None, _turn(stable, rows.longitude, rows.lower, -1), np.inf)


def _turn(stable: StableSet, longitude: FloatArray, latitude: FloatArray, sense: int) -> FloatArray | None:
    """Return the unit twist with the largest latitude of one sense, if there is any."""
    if not (sense * latitude > 0.0).any():
        return None
    k = int(np.argmax(sense * latitude))
    twist = twists_at(longitude[k], latitude[k], stable.chain.characteristic_length)
    return frozen(twist, (3,), "steering twist")
