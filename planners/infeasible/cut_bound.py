"""A cost that no path can beat, by the turns that the pushes need from one cut across the room to the next.

A path crosses the cuts one after the other, at x_k with the heading theta_k; x_0 and x_(K+1) are start and goal. With
a costate p_k for each part between two of them, |p_k| <= 1, it costs, as in `turn_bound`, at least

    sum_k p_k . (x_(k+1) - x_k) + int_theta_k^theta_(k+1) rho_(p_k)(theta) |dtheta|.

The bound is the least of that over the headings, by dynamic programming over the edges of their bins, and over the
positions on the cuts where the chain is free. It is concave in all costates together: a level method finds their best
(Lemarechal, Nemirovskii and Nesterov 1995). Headings and positions that only paths dearer than a known one pass are
left out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import daqp
import numpy as np

from pushplan.geometry import se2
from pushplan.geometry.convex import convex_pieces
from pushplan.planners.infeasible.turn_bound import CIRCLE, NEVER, TRAVEL, WIDEST, Price
from pushplan.planners.infeasible.turning import turns_of
from pushplan.planners.infeasible.ways import NONE, SAME, Cut, find_cuts, free_sections, or_none, standing
from pushplan.plans.path import PushPath
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import BoolArray, FloatArray, IntArray

BINS = 144
"""Of the heading."""

ARC_ERROR = 1e-3
"""How far the corners of tangents may lie outside of the arcs that they cover, m."""

SIDES = 90
"""Of the polygon that costates are held in, in a circle of radius 1."""

CLOSE_ENOUGH, STEPS = 1e-3, 60
"""Share of the bound by which better costates may raise it where their search ends, and steps of it, at most."""


class _Twists(NamedTuple):
    """Turns to one side: each is a mean of points and costs no less than the mean of their costs.

    Attributes:
        points: (m, 2) v at |omega| = 1, m.
        costs: (m,) m.
    """

    points: FloatArray
    costs: FloatArray

    @classmethod
    def of(cls, sectors: FloatArray, price: Price) -> _Twists:
        """Return the turns in sectors (k, 4); see `Turns`."""
        if not len(sectors):
            return cls(np.zeros((1, 2)), np.full(1, NEVER))
        # Of turns with v in one direction the tightest costs least above p . R v, as |p| <= 1, but for a corner.
        tightest = np.minimum(sectors[:, 0], WIDEST)
        corner = np.clip(price.radius, tightest, sectors[:, 1])
        kept = corner > tightest
        radii = np.concatenate([tightest, corner[kept]])
        # An arc lies between its ends and where the tangents there meet; of a wide one each of its parts does.
        middles, halves = np.concatenate([sectors[:, 2:], sectors[kept, 2:]]).T
        parts = np.ceil(halves * np.sqrt(0.5 * radii / ARC_ERROR)).astype(int).clip(1)  # one direction is an arc, too
        row = np.repeat(np.arange(len(parts)), parts)
        number = np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)
        half = halves[row] / parts[row]
        middle = middles[row] - halves[row] + half * (2 * number + 1)
        angles, stretch = np.stack([middle - half, middle, middle + half]), np.stack([half * 0.0, half, half * 0.0])
        points = (radii[row] / np.cos(stretch))[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        costs = np.broadcast_to(np.maximum(radii[row], price.radius) + price.weight, angles.shape)
        return cls(points.reshape(-1, 2), costs.ravel())

    def least(
        self, costates: FloatArray, headings: FloatArray, scale: FloatArray, wanted: BoolArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return rho (k, b) of costates (k, 2) times a scale (b,) at headings (b,), and how it falls with them, m.

        The latter (k, b, 2) is the scaled v of the turn that costs so little; both are 0 where they are not wanted.
        """
        part, k = np.nonzero(wanted)
        above = self.costs - (scale[k, None] * se2.rotate(-headings[k], costates[part])) @ self.points.T
        best = np.argmin(above, axis=1)
        rho, falls = np.zeros(wanted.shape), np.zeros((*wanted.shape, 2))
        rho[part, k] = above[np.arange(len(k)), best]
        falls[part, k] = scale[k, None] * se2.rotate(headings[k], self.points[best])
        return rho, falls


class _Crossing(NamedTuple):
    """What crossing a cut costs: base (b,) + slope * offset with the headings of the edges.

    Attributes:
        base: (b,) m.
        slope: By the offset.
        offset: (b,) at which it is least, m; an infinite one makes it infinitely dear.
    """

    base: FloatArray
    slope: float
    offset: FloatArray

    @property
    def costs(self) -> FloatArray:
        """The least (b,), m."""
        return self.base + self.slope * self.offset


class _Parts:
    """The parts of paths between K cuts, K + 1 of them, and what costates (K + 1, 2) prove of them.

    Args:
        scenario: The problem.
        segments: (k, 6) stable twists; see `controls`.
        cuts: K of them.
        most: Cost of the known path, m.
        price: What twists cost.
        possible: Of each bin of headings, whether any path turns in it.
    """

    def __init__(
        self,
        scenario: Scenario,
        segments: FloatArray,
        cuts: list[Cut],
        most: float,
        price: Price,
        possible: BoolArray | None = None,
    ) -> None:
        start, goal = scenario.start, scenario.goal.pose_chain
        self.start, self.goal, self.cuts, self.most = start[:2], goal[:2], cuts, most
        turns = turns_of(segments)
        self.sides = [_Twists.of(sectors, price) for sectors in (turns.left, turns.right)]
        turn, edges = (goal[2] - start[2]) % CIRCLE, CIRCLE * np.arange(BINS) / BINS
        if np.abs(se2.wrap_angle(edges - turn)).min() > SAME:
            edges = np.sort(np.append(edges, turn))
        self.last, self.edges = int(np.argmin(np.abs(se2.wrap_angle(edges - turn)))), start[2] + edges
        self.widths = np.diff(edges, append=CIRCLE)
        # Seen by the chain, p is in a bin the mean of p at its edges and where the tangents there meet.
        half = 0.5 * self.widths
        self.middles, self.stretch = self.edges + half, 1.0 / np.cos(half)
        self.share = (np.sin(half) / half - np.cos(half)) / (self.stretch - np.cos(half))  # of the latter
        self.longest = float(np.cos(half).min())  # of costates, for that to be in the circle, too
        possible = np.ones(len(edges), dtype=bool) if possible is None else possible
        self.open = np.tile(possible, (len(cuts) + 1, 1))
        crossed = np.flatnonzero(possible | np.roll(possible, 1))
        pieces = convex_pieces([body.outline for body in scenario.chain.bodies])
        bodies = [se2.rotate(self.edges[crossed, None], piece) for piece in pieces]
        # At an edge of a bin the chain counts as free where it is in the bins beside it.
        reach, things = scenario.chain.reach, standing(scenario)
        slack = reach * float(self.widths.max())
        self.free = []
        for cut in cuts:
            sections = free_sections(cut, bodies, reach, slack, things)
            self.free.append(np.full((len(edges), *sections.shape[1:]), NONE))
            self.free[-1][crossed] = sections

    def value(self, costates: FloatArray) -> tuple[float, FloatArray]:
        """Return the cost that costates prove, and how it changes with them, (K + 1, 2)."""
        turning, falls, crossings = self._costs(costates)
        forth = self._forth(costates, turning, crossings)
        proven = float(forth[-1][1, self.last] + costates[-1] @ self.goal)
        change, here, end = np.zeros_like(costates), self.last, self.goal
        if proven < self.most:
            for part in reversed(range(len(costates))):
                here, side, bins = _turned_from(forth[part][0], turning[:, part], here)
                begin = self.cuts[part - 1].at(crossings[part - 1].offset[[here]])[0] if part else self.start
                change[part] = end - begin - falls[side, part, bins].sum(axis=0)
                end = begin
        return proven, change

    def leave_out(self, costates: FloatArray) -> None:
        """Leave out headings of parts, and ends of the free sections of cuts, that only dearer paths pass."""
        turning, _, crossings = self._costs(costates)
        forth = self._forth(costates, turning, crossings)
        back = self._back(costates, turning, crossings)
        able = np.stack([came[1] + goes[1] for came, goes in zip(forth, back, strict=True)]) <= self.most + SAME
        self.open &= able | np.roll(able, -1, axis=1)  # a bin is between an edge and the next
        for k, (base, slope, _) in enumerate(crossings):
            if abs(slope) > SAME:
                left = self.most + SAME - forth[k][1] - back[k + 1][1] - base
                # A path that crosses amid a bin may count as one at either edge, as other costates have it.
                farthest = np.maximum(left, np.maximum(np.roll(left, 1), np.roll(left, -1)))[:, None] / slope
                low, high = np.moveaxis(self.free[k], -1, 0)
                ends = (low, np.minimum(high, farthest)) if slope > 0.0 else (np.maximum(low, farthest), high)
                self.free[k] = or_none(np.stack(ends, axis=-1))

    def _forth(self, costates: FloatArray, turning: FloatArray, crossings: list[_Crossing]) -> list[FloatArray]:
        """Least costs (2, b) of coming from the start to headings in each part, before and after turning there."""
        return _sweep(0, -float(costates[0] @ self.start), turning, [crossing.costs for crossing in crossings])

    def _back(self, costates: FloatArray, turning: FloatArray, crossings: list[_Crossing]) -> list[FloatArray]:
        """Likewise of going on to the goal."""
        across = [crossing.costs for crossing in reversed(crossings)]
        return _sweep(self.last, float(costates[-1] @ self.goal), turning[::-1, ::-1], across)[::-1]

    def _costs(self, costates: FloatArray) -> tuple[FloatArray, FloatArray, list[_Crossing]]:
        """Return what turning and crossing cuts costs.

        Returns:
            Costs (2, K + 1, b) of turns over the bins to either side, how they fall with the costates
            (2, K + 1, b, 2), m, and the crossings.
        """
        shape = self.open.shape
        at_edges = self.open | np.roll(self.open, 1, axis=1)
        turning, moves, spread = np.full((2, *shape), self.most), np.zeros((2, *shape, 2)), np.zeros(shape)
        for side, turns in enumerate(self.sides):
            rho, falls = turns.least(costates, self.edges, np.ones_like(self.widths), at_edges)
            corner, corner_falls = turns.least(costates, self.middles, self.stretch, self.open)
            following, share = np.roll(rho, -1, axis=1), self.share[:, None]
            mean = 0.5 * (1.0 - self.share) * (rho + following) + self.share * corner
            least = np.minimum(np.minimum(rho, following), corner)
            turning[side] = np.where(self.open, np.minimum(self.widths * mean, self.most), self.most)
            spread = np.maximum(spread, np.where(self.open, self.widths * (mean - least), 0.0))
            both = falls + np.roll(falls, -1, axis=1)
            moves[side] = self.widths[:, None] * (0.5 * (1.0 - share) * both + share * corner_falls)
        # Where a cut is crossed amid a bin, the turns before and after it may cost as little as anywhere in the bin.
        spread = np.maximum(spread, np.roll(spread, 1, axis=1))
        crossings = []
        for k, (cut, change) in enumerate(zip(self.cuts, costates[:-1] - costates[1:], strict=True)):
            slope = float(change @ cut.along) or math.ulp(0.0)
            base = cut.level * float(change @ cut.normal) - np.maximum(spread[k], spread[k + 1])
            low, high = np.moveaxis(self.free[k], -1, 0)
            crossings.append(_Crossing(base, slope, low.min(axis=1) if slope > 0.0 else high.max(axis=1)))
        return turning, moves, crossings


def _sweep(first: int, cost: float, turning: FloatArray, crossing: list[FloatArray]) -> list[FloatArray]:
    """Least costs (2, b) of coming to headings in each part, before and after turning, from a cost at one of them."""
    here = np.full(turning.shape[-1], math.inf)
    here[first] = cost
    found = []
    for part, across in enumerate([*crossing, np.zeros_like(here)]):
        found.append(np.stack([here, _turned(here, *turning[:, part])]))
        here = found[-1][1] + across
    return found


def _turned(costs: FloatArray, left: FloatArray, right: FloatArray) -> FloatArray:
    """Least costs (b,) at headings from costs (b,) after turns, over bins that cost (b,) to the left and right."""
    count, twice = len(costs), np.concatenate([costs, costs])
    lefts, rights = (np.cumsum(np.concatenate([[0.0], side, side[:-1]])) for side in (left, right))
    by_left = np.minimum.accumulate(twice - lefts) + lefts
    by_right = np.minimum.accumulate((twice + rights)[::-1])[::-1] - rights
    return np.asarray(np.minimum(by_left[count:], by_right[:count]))


def _turned_from(costs: FloatArray, turning: FloatArray, here: int) -> tuple[int, int, IntArray]:
    """Return the heading from which turns (2, b) to a heading cost least, their side, and the bins that they pass."""
    count, steps = len(costs), np.arange(len(costs))
    passed = (here - 1 - steps) % count, (here + steps) % count  # to the right of the heading, and to its left
    turned = [np.concatenate([[0.0], np.cumsum(turning[side, bins])[:-1]]) for side, bins in enumerate(passed)]
    by_left, by_right = costs[(here - steps) % count] + turned[0], costs[passed[1]] + turned[1]
    left, right = int(np.argmin(by_left)), int(np.argmin(by_right))
    if by_left[left] <= by_right[right]:
        return (here - left) % count, 0, passed[0][:left]
    return (here + right) % count, 1, passed[1][:right]


def cut_bound(
    scenario: Scenario, segments: FloatArray, path: PushPath, most: float, proven: float, price: Price = TRAVEL
) -> float:
    """Return a cost (m) that no path which keeps the clearance can beat.

    Args:
        scenario: The problem.
        segments: (k, 6) stable twists that the pusher can make; see `controls`.
        path: One that is known.
        most: What it costs, or more; so is the bound, at most.
        proven: What no path can beat, as is known already; so is the bound, at least.
        price: What twists cost.
    """
    cuts = find_cuts(scenario, path, most)
    if not cuts:
        return proven
    apart = scenario.goal.pose_chain[:2] - scenario.start[:2]
    costates = 0.99 * apart[None] / max(float(np.linalg.norm(apart)), SAME)
    possible = None
    for chosen in ([], cuts):
        costates = np.tile(costates, (len(chosen) + 1, 1))
        parts = _Parts(scenario, segments, chosen, most, price, possible)
        parts.leave_out(costates)
        proven, costates = _highest(parts, costates, proven)
        possible = parts.open[0]
    return min(proven, most)


def _highest(parts: _Parts, costates: FloatArray, proven: float) -> tuple[float, FloatArray]:
    """Return the higher of a bound and the best that costates prove, and these (k, 2), found from others on.

    A step goes to the nearest costates that may prove, by all that is known, a bound halfway between the best one and
    what none is above. Where there are none, none is above that.
    """
    angles = CIRCLE * np.arange(SIDES) / SIDES
    held = np.kron(np.eye(len(costates)), np.column_stack([np.cos(angles), np.sin(angles)]))
    limits = np.full(len(held), parts.longest * math.cos(math.pi / SIDES))
    best, chosen, most = -math.inf, costates, parts.most
    changes, rests = np.zeros((0, costates.size)), np.zeros(0)
    for _ in range(STEPS):
        bound, change = parts.value(costates)
        if bound > best:
            best, chosen = bound, costates
        changes = np.vstack([changes, change.ravel()])
        rests = np.append(rests, bound - change.ravel() @ costates.ravel())
        flag = 0
        while flag <= 0:
            if most - best <= CLOSE_ENOUGH * best or most <= proven:
                return max(best, proven), chosen
            level = 0.5 * (best + most)
            rows, upper = np.vstack([held, -changes]), np.append(limits, rests - level)
            nearest, _, flag, _ = daqp.solve(np.eye(costates.size), -chosen.ravel(), rows, upper)
            if flag <= 0:
                most = level
        costates = nearest.reshape(-1, 2)
    return max(best, proven), chosen
