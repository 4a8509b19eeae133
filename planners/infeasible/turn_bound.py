"""Lower bound of a path's cost from the turns that its pushes need, without obstacles.

The headings of a path fill an interval I that contains those of start and goal. Let p be a vector of the plane with p
. R(theta) v <= |v| for all straight pushes v and all headings theta in I. The cost of the path is

    int c dt = p . d + int (c - p . R(theta) v) / |omega| |dtheta| >= p . d + int_sweep rho_p(theta) |dtheta|

Here d is the displacement from start to goal, c >= |v| is the cost of a twist (v, omega), and rho_p(theta) is the
minimum of that integrand over stable twists that turn to the same side. The shortest sweep that fills I goes from the
start to one end of I, then to the other end, then to the goal. Any other sweep turns once more to both sides at some
headings. The length of p is limited so that such a pair of turns has a positive cost. If I covers all headings, whole
turns are possible, and p is limited so that each of them has a positive cost too. The bound is the maximum over p,
minimised over I and the order of its ends. Branch and bound finds I. For a range of intervals, p is limited by the
widest one, and the sweep covers the narrowest one.
"""

from __future__ import annotations

import heapq
import math
from functools import lru_cache
from itertools import count, pairwise
from typing import NamedTuple

import numpy as np

from pushplan.geometry import se2
from pushplan.planners.infeasible.turning import Turns, turns_of
from pushplan.plans.path import TURN_WEIGHT
from pushplan.util.arrays import FloatArray

BINS, STRIDE = 360, 3
"""Heading bins relative to p's direction, with a lower bound rho on each, and the stride of p's directions."""

CIRCLE = 2.0 * math.pi
BIN = CIRCLE / BINS

LENGTHS = np.concatenate([[0.0, 0.25, 0.5, 0.75], 1.3 ** np.arange(15), 60.0 * 3.0 ** np.arange(6)])
"""Lengths of p to try, besides the longest that I allows. The bound is concave in p."""


class Price(NamedTuple):
    """Cost of a twist (v, omega): max(|v|, radius |omega|) + weight |omega|; radius and weight in m.

    For travel, the radius is 0. For time, the weight is 0 and the radius is the ratio of the limits of speed and
    angular speed.
    """

    radius: float = 0.0
    weight: float = TURN_WEIGHT


TRAVEL = Price()

NEVER = 1e6
"""rho (m) of a side without stable turns. It is finite, so that a turn of zero angle costs nothing."""

WIDEST = 1e3
"""Upper limit of radii, m. In sums with larger numbers, small ones would be lost."""

RANGES = 600
"""Maximum number of ranges of intervals."""

NARROW = math.radians(0.25)
"""Width (rad) below which a range of intervals is not halved."""


class _Range(NamedTuple):
    """Intervals of headings that begin in `low` and end in `high`. Headings are relative to the start's."""

    low: tuple[float, float]
    high: tuple[float, float]
    goal: float
    low_first: bool

    def halves(self) -> list[_Range]:
        """Return both halves along the wider side; empty if the range is narrow."""
        wide = [self.low[1] - self.low[0], self.high[1] - self.high[0]]
        if max(wide) < NARROW:
            return []
        if wide[0] >= wide[1]:
            middle = 0.5 * sum(self.low)
            return [self._replace(low=(self.low[0], middle)), self._replace(low=(middle, self.low[1]))]
        middle = 0.5 * sum(self.high)
        return [self._replace(high=(self.high[0], middle)), self._replace(high=(middle, self.high[1]))]


class _Rates:
    """Costs of turns for vectors p with `LENGTHS`, in directions `STRIDE` bins apart (first: the displacement).

    Args:
        turns: Turns of the stable twists.
        away: (2,) displacement from start to goal in the frame of the start, m.
        price: Cost of twists.
    """

    def __init__(self, turns: Turns, away: FloatArray, price: Price) -> None:
        sides = [_Side.of(sectors, price) for sectors in (turns.left, turns.right)]
        self._sums = [_sums(side.rho) for side in sides]
        self._straight = turns.straight
        self._toward = math.atan2(away[1], away[0])
        self._first = STRIDE * np.arange(BINS // STRIDE)
        self._along = math.hypot(*away) * np.cos(BIN * self._first)
        free = np.minimum(sides[0].longest, sides[1].longest)
        self._all_around = float(free.min())
        # Minima over 1, 2, 4, ... bins that begin at each bin.
        self._longest = [np.maximum(free, _to_and_fro(sides[0].rho + sides[1].rho))]
        for k in range(BINS.bit_length() - 1):
            self._longest.append(np.minimum(self._longest[-1], np.roll(self._longest[-1], -(1 << k))))
        self.swept = lru_cache(maxsize=None)(self._swept)

    def longest(self, low: float, high: float) -> FloatArray:
        """Return the maximum lengths (directions,) of p for headings from low to high that keep costs >= 0."""
        first = math.floor((low - self._toward) / BIN)
        bins = min(max(math.ceil((high - self._toward) / BIN) - first, 1), BINS)
        level = bins.bit_length() - 1
        starts, table = first - self._first, self._longest[level]
        longest = np.minimum(table[starts % BINS], table[(starts + bins - (1 << level)) % BINS])
        if bins == BINS:  # whole turns to one side are possible too
            longest = np.minimum(longest, self._all_around)
        if self._straight is None:
            return np.asarray(longest)
        low, high = low + self._straight[0] - self._toward, high + self._straight[1] - self._toward
        off = np.abs(se2.wrap_angle(BIN * self._first - 0.5 * (low + high))) - 0.5 * (high - low)
        return np.asarray(np.minimum(longest, 1.0 / np.maximum(np.cos(np.maximum(off, 0.0)), 1e-9)))

    def _swept(self, side: int, heading: float) -> FloatArray:
        """Return integrals (lengths, directions) of rho from p to a heading, for turns to the left (0) or right."""
        at = (heading - self._toward) / BIN - self._first
        whole = np.floor(at).astype(int)
        sums, turn = self._sums[side], self._sums[side][:, -1:]
        rounds, first = np.divmod(whole, BINS)
        below, above = sums[:, first], sums[:, first + 1]
        return np.asarray(rounds * turn + below + (at - whole) * (above - below))

    def least(self, one: _Range) -> float:
        """Return a lower bound of the cost of paths whose headings fill an interval of a range."""
        low, high = one.low[1], one.high[0]
        stops = (0.0, low, high, one.goal) if one.low_first else (0.0, high, low, one.goal)
        cost = LENGTHS[:, None] * self._along
        for k, (here, there) in enumerate(pairwise(stops)):
            side = (k + one.low_first) % 2
            turned = self.swept(side, there) - self.swept(side, here)
            cost += -turned if side else turned
        longest = np.minimum(self.longest(one.low[0], one.high[1]), LENGTHS[-1])
        k = np.clip(np.searchsorted(LENGTHS, longest, side="right") - 1, 0, len(LENGTHS) - 2)
        share, each = (longest - LENGTHS[k]) / (LENGTHS[k + 1] - LENGTHS[k]), np.arange(len(longest))
        at_longest = (1.0 - share) * cost[k, each] + share * cost[k + 1, each]
        shorter = np.max(cost, axis=0, where=LENGTHS[:, None] <= longest, initial=-math.inf)
        return float(max(at_longest.max(), shorter.max()))


class _Side(NamedTuple):
    """Costs of turns to one side.

    Attributes:
        rho: (lengths, BINS) lower bounds, by heading bin relative to p.
        longest: (BINS,) lengths of p up to which rho >= 0.
    """

    rho: FloatArray
    longest: FloatArray

    @classmethod
    def of(cls, sectors: FloatArray, price: Price) -> _Side:
        """Return the costs of turns in sectors (k, 4)."""
        if not len(sectors):
            return cls(np.full((len(LENGTHS), BINS), NEVER), np.full(BINS, math.inf))
        tightest, widest = np.minimum(sectors[:, :2], WIDEST).T
        # If v can go straight, straight pushes limit p. Then c - p . R v is lower for the tighter of two turns.
        widest = np.where(np.isinf(sectors[:, 1]), np.maximum(tightest, price.radius), widest)
        middles = BIN * (0.5 + np.arange(BINS))
        # Sectors are the first axis, so that minima work on whole rows, in a third of the time.
        off = np.abs(se2.wrap_angle(middles + sectors[:, 2:3])) - sectors[:, 3:] - 0.5 * BIN
        cosines = np.cos(np.clip(off, 0.0, math.pi))
        # c - p . R v is piecewise linear in the radius, with one corner, so its minimum is at one of these.
        rho, longest = np.full((len(LENGTHS), BINS), math.inf), np.full(BINS, math.inf)
        for radius in (tightest, widest, np.clip(price.radius, tightest, widest)):
            cost, ahead = price.weight + np.maximum(radius, price.radius)[:, None], radius[:, None] * cosines
            rho = np.minimum(rho, [np.min(cost - p * ahead, axis=0) for p in LENGTHS])
            longest = np.minimum(longest, np.min(cost / np.maximum(ahead, 1e-12), axis=0))
        return cls(rho, longest)


def _to_and_fro(rho: FloatArray) -> FloatArray:
    """Return lengths (BINS,) of p up to which rho (lengths, BINS), the concave sum of both sides, is >= 0."""
    k, each = np.maximum(np.argmax(rho < 0.0, axis=0), 1), np.arange(BINS)
    shorter, longer = rho[k - 1, each], rho[k, each]
    root = LENGTHS[k - 1] + (LENGTHS[k] - LENGTHS[k - 1]) * shorter / np.maximum(shorter - longer, 1e-300)
    return np.asarray(np.where((rho < 0.0).any(axis=0), root, LENGTHS[-1]))


def _sums(rho: FloatArray) -> FloatArray:
    return np.concatenate([np.zeros((len(rho), 1)), np.cumsum(rho, axis=1)], axis=1) * BIN


def turn_bound(
    start: FloatArray, goal: FloatArray, segments: FloatArray, most: float = math.inf, price: Price = TRAVEL
) -> float:
    """Return a lower bound (m) of the cost of any path of stable twists from start to goal.

    Args:
        start: (3,) start pose of the chain frame in the world.
        goal: (3,) goal pose of the chain frame in the world.
        segments: (k, 6) segments of stable twists; see `controls`.
        most: Cost of a known path, m. The search stops at a bound of this height.
        price: Cost of twists.
    """
    rates = _Rates(turns_of(segments), se2.rotate(-start[2], goal[:2] - start[:2]), price)
    turn = float(se2.wrap_angle(goal[2] - start[2]))
    number = count()
    queue: list[tuple[float, int, _Range]] = []

    def add(one: _Range) -> None:
        heapq.heappush(queue, (rates.least(one), next(number), one))

    # Two circles are enough: paths that turn further do so at all headings and cost no less.
    for end in turn + CIRCLE * np.arange(-2, 3):
        low, high = min(0.0, end), max(0.0, end)
        for low_first in (True, False):
            # For the same reason, one more circle is enough for the intervals.
            add(_Range((low - CIRCLE, low), (high, high + CIRCLE), float(end), low_first))
    for _ in range(RANGES):
        bound, _, one = queue[0]
        halves = one.halves()
        if bound >= most or not halves:
            break
        heapq.heappop(queue)
        for half in halves:
            add(half)
    return max(0.0, queue[0][0])
