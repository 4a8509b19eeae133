"""A cost that no path can beat, by the turns that the pushes need, whatever is in the way.

On any path the headings fill an interval I around those of start and goal. Take a
vector p of the plane with p . R(theta) v <= |v| for all straight pushes v at all headings theta in I. The path costs

    int c dt = p . d + int (c - p . R(theta) v) / |omega| |dtheta| >= p . d + int_sweep rho_p(theta) |dtheta|

with the displacement d from start to goal, the cost c >= |v| of a twist (v, omega), and the least rho_p(theta) of
that integrand over stable twists that turn to that side. The shortest sweep that fills I goes from the start to one
end of I, to the other, and to the goal; any other turns to both sides at some headings once more, and p is held so
short that both together cost something (at an I of all headings, where whole turns are possible, each of them). The
most of that over p, and the least over I and the order of its ends, is the bound. I is looked for by branch and
bound: over a range of intervals p is held to the widest of them, the sweep to the narrowest.
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
"""Bins of the heading relative to p's direction: rho is a lower bound on each; p has a third of the directions."""

CIRCLE = 2.0 * math.pi
BIN = CIRCLE / BINS

LENGTHS = np.concatenate([[0.0, 0.25, 0.5, 0.75], 1.3 ** np.arange(15), 60.0 * 3.0 ** np.arange(6)])
"""Lengths of p that are tried, besides the longest that I allows: the bound is concave in p."""


class Price(NamedTuple):
    """What a twist (v, omega) costs: max(|v|, radius |omega|) + weight |omega|; both in m.

    Travel has no radius; time at a speed and an angular speed that are limited has their ratio, and no weight.
    """

    radius: float = 0.0
    weight: float = TURN_WEIGHT


TRAVEL = Price()

NEVER = 1e6
"""rho of turns to a side to which there are none, m: finite, so that no turn at all costs nothing."""

WIDEST = 1e3
"""Radii (m) above that count as that: sums of larger numbers would lose the small ones."""

RANGES = 600
"""Ranges of intervals that are looked at, at most."""

NARROW = math.radians(0.25)
"""Ranges of intervals whose ends differ by less are not halved."""


class _Range(NamedTuple):
    """Intervals of headings, relative to the start's, that begin in `low` and end in `high`; the goal's is `goal`."""

    low: tuple[float, float]
    high: tuple[float, float]
    goal: float
    low_first: bool

    def halves(self) -> list[_Range]:
        """Return both halves along the wider side; none of what is narrow."""
        wide = [self.low[1] - self.low[0], self.high[1] - self.high[0]]
        if max(wide) < NARROW:
            return []
        if wide[0] >= wide[1]:
            middle = 0.5 * sum(self.low)
            return [self._replace(low=(self.low[0], middle)), self._replace(low=(middle, self.low[1]))]
        middle = 0.5 * sum(self.high)
        return [self._replace(high=(self.high[0], middle)), self._replace(high=(middle, self.high[1]))]


class _Rates:
    """What turns cost for vectors p of `LENGTHS`, in directions `STRIDE` bins apart from that of the displacement on.

    Args:
        turns: What is known of the twists.
        away: (2,) from start to goal in the frame of the start, m.
        price: What twists cost.
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
        # Over 1, 2, 4, ... bins from each on.
        self._longest = [np.maximum(free, _to_and_fro(sides[0].rho + sides[1].rho))]
        for k in range(BINS.bit_length() - 1):
            self._longest.append(np.minimum(self._longest[-1], np.roll(self._longest[-1], -(1 << k))))
        self.swept = lru_cache(maxsize=None)(self._swept)

    def longest(self, low: float, high: float) -> FloatArray:
        """Lengths (directions,) that p may have for headings from low to high: no more pushes cost less."""
        first = math.floor((low - self._toward) / BIN)
        bins = min(max(math.ceil((high - self._toward) / BIN) - first, 1), BINS)
        level = bins.bit_length() - 1
        starts, table = first - self._first, self._longest[level]
        longest = np.minimum(table[starts % BINS], table[(starts + bins - (1 << level)) % BINS])
        if bins == BINS:  # a whole turn to one side is a way to go on, too
            longest = np.minimum(longest, self._all_around)
        if self._straight is None:
            return np.asarray(longest)
        low, high = low + self._straight[0] - self._toward, high + self._straight[1] - self._toward
        off = np.abs(se2.wrap_angle(BIN * self._first - 0.5 * (low + high))) - 0.5 * (high - low)
        return np.asarray(np.minimum(longest, 1.0 / np.maximum(np.cos(np.maximum(off, 0.0)), 1e-9)))

    def _swept(self, side: int, heading: float) -> FloatArray:
        """Integrals (lengths, directions) of rho of turns to the left (0) or right, from p to a heading."""
        at = (heading - self._toward) / BIN - self._first
        whole = np.floor(at).astype(int)
        sums, turn = self._sums[side], self._sums[side][:, -1:]
        rounds, first = np.divmod(whole, BINS)
        below, above = sums[:, first], sums[:, first + 1]
        return np.asarray(rounds * turn + below + (at - whole) * (above - below))

    def least(self, one: _Range) -> float:
        """Return a cost that no path beats whose headings fill an interval of a range."""
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
    """What turns to one side cost.

    Attributes:
        rho: (lengths, BINS) lower bounds on bins of the heading relative to p.
        longest: (BINS,) lengths of p up to which rho is not negative there.
    """

    rho: FloatArray
    longest: FloatArray

    @classmethod
    def of(cls, sectors: FloatArray, price: Price) -> _Side:
        """Return what turns in sectors (k, 4) cost."""
        if not len(sectors):
            return cls(np.full((len(LENGTHS), BINS), NEVER), np.full(BINS, math.inf))
        tightest, widest = np.minimum(sectors[:, :2], WIDEST).T
        # Where v may go straight, straight pushes hold p: the tighter of two turns costs less above p . R v.
        widest = np.where(np.isinf(sectors[:, 1]), np.maximum(tightest, price.radius), widest)
        middles = BIN * (0.5 + np.arange(BINS))
        # Sectors come first: the least over them is taken of whole rows, in a third of the time.
        off = np.abs(se2.wrap_angle(middles + sectors[:, 2:3])) - sectors[:, 3:] - 0.5 * BIN
        cosines = np.cos(np.clip(off, 0.0, math.pi))
        # What a turn costs above p . R v is linear in its radius but for a corner: least at one of these.
        rho, longest = np.full((len(LENGTHS), BINS), math.inf), np.full(BINS, math.inf)
        for radius in (tightest, widest, np.clip(price.radius, tightest, widest)):
            cost, ahead = price.weight + np.maximum(radius, price.radius)[:, None], radius[:, None] * cosines
            rho = np.minimum(rho, [np.min(cost - p * ahead, axis=0) for p in LENGTHS])
            longest = np.minimum(longest, np.min(cost / np.maximum(ahead, 1e-12), axis=0))
        return cls(rho, longest)


def _to_and_fro(rho: FloatArray) -> FloatArray:
    """Lengths (BINS,) of p up to which turns to and fro cost something: rho (lengths, BINS) of both, concave in p."""
    k, each = np.maximum(np.argmax(rho < 0.0, axis=0), 1), np.arange(BINS)
    shorter, longer = rho[k - 1, each], rho[k, each]
    root = LENGTHS[k - 1] + (LENGTHS[k] - LENGTHS[k - 1]) * shorter / np.maximum(shorter - longer, 1e-300)
    return np.asarray(np.where((rho < 0.0).any(axis=0), root, LENGTHS[-1]))


def _sums(rho: FloatArray) -> FloatArray:
    return np.concatenate([np.zeros((len(rho), 1)), np.cumsum(rho, axis=1)], axis=1) * BIN


def turn_bound(
    start: FloatArray, goal: FloatArray, segments: FloatArray, most: float = math.inf, price: Price = TRAVEL
) -> float:
    """Return a cost (m) that no path of stable twists from start to goal can beat.

    Args:
        start: (3,) pose of the chain frame in the world.
        goal: Likewise.
        segments: (k, 6) stable twists between two ends; see `controls`.
        most: Cost of a path that is known: a bound as high as that is not made higher.
        price: What twists cost.
    """
    rates = _Rates(turns_of(segments), se2.rotate(-start[2], goal[:2] - start[:2]), price)
    turn = float(se2.wrap_angle(goal[2] - start[2]))
    number = count()
    queue: list[tuple[float, int, _Range]] = []

    def add(one: _Range) -> None:
        heapq.heappush(queue, (rates.least(one), next(number), one))

    # Two circles are enough: what turns further does so at all headings, and costs no less.
    for end in turn + CIRCLE * np.arange(-2, 3):
        low, high = min(0.0, end), max(0.0, end)
        for low_first in (True, False):
            # Likewise intervals that reach a circle further.
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
