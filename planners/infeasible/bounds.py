"""Costs that no path can beat: by the turns that the pushes allow, and by the way around the obstacles.

For turns, whatever is in the way: on any path the headings fill an interval I around those of start and goal. Take a
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
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import count, pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from pushplan.core.problem import remaining
from pushplan.geometry import se2
from pushplan.mechanics.chain import SEAM, Body, as_one
from pushplan.planners.infeasible.turning import Turns, turns_of
from pushplan.plans.path import TURN_WEIGHT
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

ARC_SEGMENTS = 8
"""Segments per quarter of a round corner, all inside it: what is blocked is never overestimated."""


_AROUND = 10.0
"""Room left around everything where there is no workspace, m: way enough around it all."""


class Disc(NamedTuple):
    """A disc inside the chain: centre (2,) in the chain frame, and radius, m."""

    center: FloatArray
    radius: float

    def at(self, pose: FloatArray) -> shapely.Point:
        """Return the centre with the chain frame at a pose (3,)."""
        return shapely.Point(se2.transform_points(pose, self.center))


def largest_disc(bodies: Iterable[Body]) -> Disc:
    """Return the largest disc inside bodies of a chain."""
    shape = as_one(bodies)
    return _disc_at(shape, shapely.get_coordinates(shapely.maximum_inscribed_circle([shape]))[0])


def disc_at(bodies: Iterable[Body], center: FloatArray) -> Disc:
    """Return the largest disc inside bodies around a point (2,) of the chain frame; its radius is 0 outside."""
    return _disc_at(as_one(bodies), center)


def _disc_at(shape: BaseGeometry, center: FloatArray) -> Disc:
    point = shapely.Point(center)
    radius = float(shape.boundary.distance(point)) if shape.contains(point) else 0.0
    return Disc(np.asarray(center, dtype=np.float64), max(0.0, radius - 10.0 * SEAM))


def blocked(obstacles: Sequence[Obstacle], radius: float) -> BaseGeometry:
    """Return where the centre of a disc cannot be for the obstacles."""
    return shapely.disjoint_subset_union_all(
        grown(obstacles, radius)
    )  # a quarter of the time of `union_all` where most are apart


def grown(obstacles: Sequence[Obstacle], radius: float) -> NDArray[np.object_]:
    """Return where the centre of a disc cannot be for each of the obstacles."""
    radii = np.array([o.radius for o in obstacles]) + radius
    return np.asarray(shapely.buffer([o.core for o in obstacles], radii, quad_segs=ARC_SEGMENTS))


def reached(free: BaseGeometry, place: BaseGeometry, within: float) -> BaseGeometry:
    """Return the parts of a region that a place is in, or no farther away from than `within` (m)."""
    parts = shapely.get_parts(free)
    return shapely.union_all(parts[shapely.distance(parts, place) <= within])


def between(grown_obstacles: NDArray[np.object_], one: BaseGeometry, other: BaseGeometry) -> tuple[int, ...]:
    """Return the indices of the obstacles, grown, that bound two regions."""
    near = [shapely.distance(grown_obstacles, side) <= TOUCH for side in (one, other)]
    return tuple(np.flatnonzero(near[0] & near[1]).tolist())


def near_to(obstacles: Sequence[Obstacle], areas: Sequence[BaseGeometry], within: float) -> tuple[int, ...]:
    """Return the indices of the obstacles that are within a distance (m) of any of the areas."""
    taken = shapely.union_all(areas)
    return tuple(k for k, shape in enumerate(grown(obstacles, 0.0)) if shape.distance(taken) <= within)


def room(scenario: Scenario, radius: float) -> BaseGeometry:
    """Return where the centre of a disc can be: inside the workspace and away from the obstacles.

    Without a workspace it is cut off where nothing is in the way any more.
    """
    return shapely.difference(_floor(scenario, radius), blocked(scenario.obstacles, radius))


def _floor(scenario: Scenario, radius: float) -> BaseGeometry:
    area = scenario.workspace
    if area is not None:
        corners = area.xmin + radius, area.ymin + radius, area.xmax - radius, area.ymax - radius
        empty = corners[0] >= corners[2] or corners[1] >= corners[3]
        return shapely.Polygon() if empty else shapely.box(*corners)
    points = [scenario.start[:2], scenario.goal.pose_chain[:2]]
    points += [corner for obstacle in scenario.obstacles for corner in obstacle.box]
    return shapely.MultiPoint(np.array(points)).envelope.buffer(_AROUND + 4.0 * radius, join_style="mitre")


TOUCH = 1e-7
"""Ways may cut into what is blocked by so much (m): they run along its edges."""

STRAIGHT = 1e-12
"""What edges are on two sides of a line counts as rounding, m^4."""

MOST_SIGHTS = 10_000
"""Lines of sight looked at, at most; the bound found until then is returned."""


def lower_bound(scenario: Scenario, segments: FloatArray, most: float = math.inf) -> float:
    """Return a cost (m) that no path which keeps the clearance can beat.

    Where obstacles are in the way it ignores how the chain can turn, and all of its shape but a disc: then the gap
    to it is an upper bound of what a path wastes, seldom the truth.

    Args:
        scenario: The problem.
        segments: (k, 6) stable twists that the pusher can make; see `controls`.
        most: Cost of a path that is known; ways longer than that are not looked at.
    """
    start, goal = scenario.start, scenario.goal.pose_chain
    turn = abs(float(se2.wrap_angle(goal[2] - start[2])))
    bounds = [remaining(start, goal)]
    for disc in _discs(scenario):
        rest = (TURN_WEIGHT - float(np.linalg.norm(disc.center))) * turn
        bounds.append(_way_around(scenario, disc, most - rest) + rest)
    return float(max(*bounds, turn_bound(start, goal, segments, most)))


def time_bound(scenario: Scenario, segments: FloatArray) -> float:
    """Return a time (s) in which no path from rest to rest can be driven; see `lower_bound`.

    It knows the limits of speed and acceleration, neither the jerk nor what contacts allow with inertia.
    """
    limits = scenario.chain.pusher.limits
    speed, turning = (max(limits.both(name)) for name in ("speed", "angular_speed"))
    gain, spin = (max(limits.both(name)) for name in ("acceleration", "angular_acceleration"))
    start, goal = scenario.start, scenario.goal.pose_chain
    around = _way_around(scenario, disc_at(scenario.chain.bodies, np.zeros(2)), math.inf)
    bend = turn_bound(start, goal, segments, price=Price(speed / turning, 0.0))
    # The share of the top speed, max(|v| / speed, |omega| / turning), changes by `rate` at most.
    rate = max(gain / speed, spin / turning)
    return max(
        _from_rest_to_rest(max(around, bend), speed, rate * speed),
        _from_rest_to_rest(around, speed, gain),
        _from_rest_to_rest(abs(float(se2.wrap_angle(goal[2] - start[2]))), turning, spin),
    )


def _from_rest_to_rest(length: float, speed: float, gain: float) -> float:
    """Return the least time (s) over a length with a top speed and an acceleration."""
    return length / speed + speed / gain if length >= speed**2 / gain else 2.0 * math.sqrt(length / gain)


def _discs(scenario: Scenario) -> list[Disc]:
    """Discs around the chain frame's origin, and around the roomiest point that is near enough to it."""
    chain = scenario.chain
    center = largest_disc(chain.bodies).center
    near = center * min(1.0, TURN_WEIGHT / max(float(np.linalg.norm(center)), 1e-12))
    return [disc_at(chain.bodies, point) for point in (np.zeros(2), near)]


def _way_around(scenario: Scenario, disc: Disc, most: float) -> float:
    """Length of the shortest way of a disc's centre from start to goal, or a lower bound of it, m (A*)."""
    radius = disc.radius + scenario.clearance - CLEARANCE_ROOM
    start, goal = disc.at(scenario.start), disc.at(scenario.goal.pose_chain)
    shape = blocked(scenario.obstacles, radius)
    points, edges = _corners(shape, shapely.get_coordinates([start, goal]), most)
    inside = shape.buffer(-TOUCH, join_style="mitre")
    shapely.prepare(inside)
    return _shortest(points, edges, inside)


def _shortest(points: FloatArray, edges: FloatArray, inside: BaseGeometry) -> float:
    """Length of the shortest way from the first of points (k, 2) to the second along lines that miss a shape.

    Where it bends, both edges (k, 2, 2) that leave a point are on one side of it.
    """
    ahead = np.linalg.norm(points - points[1], axis=1)
    so_far = np.where(np.arange(len(points)) == 0, 0.0, np.inf)
    queue, done, sights = [(float(ahead[0]), 0)], np.zeros(len(points), dtype=bool), 0
    while queue:
        through, here = heapq.heappop(queue)
        if here == 1:
            return through
        if done[here]:
            continue
        done[here] = True
        away = points - points[here]
        steps = so_far[here] + np.hypot(*away.T)
        sides = away[:, None, 0] * edges[..., 1] - away[:, None, 1] * edges[..., 0]
        better = np.flatnonzero((steps < so_far) & (sides[:, 0] * sides[:, 1] > -STRAIGHT))
        sights += len(better)
        if sights > MOST_SIGHTS:
            return through
        lines = np.stack([np.broadcast_to(points[here], (len(better), 2)), points[better]], axis=1)
        for there in better[~shapely.intersects(inside, shapely.linestrings(lines))]:
            so_far[there] = steps[there]
            heapq.heappush(queue, (float(steps[there] + ahead[there]), int(there)))
    return float(ahead[0])


def _corners(shape: BaseGeometry, ends: FloatArray, most: float) -> tuple[FloatArray, FloatArray]:
    """Return start, goal (2, 2) and the corners of a shape that ways of at most `most` can pass, (k, 2).

    Also the edges (k, 2, 2) that go from each to its neighbours; they are zero at start and goal.
    """
    corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(shape)), return_index=True)
    begins = np.flatnonzero(np.diff(ring, prepend=-1))
    forth = np.roll(corners, -1, axis=0) - corners
    back = np.roll(corners, 1, axis=0) - corners
    back[begins] = back[np.roll(begins, -1) - 1]  # a ring ends with its first corner
    through = np.linalg.norm(corners - ends[0], axis=1) + np.linalg.norm(corners - ends[1], axis=1)
    kept = (np.diff(ring, append=-1) == 0) & (through <= most + TOUCH)
    edges = np.stack([back, forth], axis=1)[kept]
    return np.concatenate([ends, corners[kept]]), np.concatenate([np.zeros((2, 2, 2)), edges])


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
