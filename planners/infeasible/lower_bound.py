"""A cost that no path can beat: by the turns that the pushes allow, or by the way around the obstacles.

The first is `turn_bound`, which sees no obstacle. For the second, let q be a point of the chain at distance a from
the chain frame's origin. Along a path that turns by Theta in all, q travels at most a Theta more than the origin. So
cost = travel + w Theta >= travel of q + (w - a) Theta, and for a <= w both parts have bounds: q's shortest way among
the obstacles, and the smallest turn from start to goal.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.geometry import se2
from pushplan.planners.infeasible.free_space import Disc, blocked, disc_at, largest_disc
from pushplan.planners.infeasible.turn_bound import turn_bound
from pushplan.planners.problem.problem import remaining
from pushplan.plans.path import TURN_WEIGHT
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

TOUCH = 1e-7
"""Ways may cut into what is blocked by so much (m): they run along its edges."""

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
    x, y, theta = scenario.start
    goal = scenario.goal.pose_chain
    turn = abs(float(se2.wrap_angle(goal[2] - theta)))
    bounds = [float(remaining(x, y, theta, goal)), turn_bound(scenario.start, goal, segments)]
    for disc in _discs(scenario):
        rest = (TURN_WEIGHT - float(np.linalg.norm(disc.center))) * turn
        bounds.append(_way_around(scenario, disc, most - rest) + rest)
    return float(max(bounds))


def _discs(scenario: Scenario) -> list[Disc]:
    """Discs around the chain frame's origin, and around the roomiest point that is near enough to it."""
    chain = scenario.chain
    center = largest_disc(chain).center
    near = center * min(1.0, TURN_WEIGHT / max(float(np.linalg.norm(center)), 1e-12))
    return [disc_at(chain, point) for point in (np.zeros(2), near)]


def _way_around(scenario: Scenario, disc: Disc, most: float) -> float:
    """Length of the shortest way of a disc's centre from start to goal, or a lower bound of it, m (A*)."""
    radius = disc.radius + scenario.clearance - CLEARANCE_ROOM
    start, goal = disc.at(scenario.start), disc.at(scenario.goal.pose_chain)
    shape = blocked(scenario.obstacles, radius)
    points = _corners(shape, shapely.get_coordinates([start, goal]), most)
    inside = shape.buffer(-TOUCH, join_style="mitre")
    shapely.prepare(inside)
    return _shortest(points, inside)


def _shortest(points: FloatArray, inside: BaseGeometry) -> float:
    """Length of the shortest way from the first of points (k, 2) to the second along lines that miss a shape."""
    ahead = np.linalg.norm(points - points[1], axis=1)
    so_far = np.where(np.arange(len(points)) == 0, 0.0, np.inf)
    queue, done, sights = [(float(ahead[0]), 0)], np.zeros(len(points), dtype=bool), 0
    while queue:
        through, here = heapq.heappop(queue)
        if here == 1 or sights > MOST_SIGHTS:
            return through
        if done[here]:
            continue
        done[here] = True
        steps = so_far[here] + np.linalg.norm(points - points[here], axis=1)
        better = np.flatnonzero(steps < so_far)
        sights += len(better)
        lines = np.stack([np.broadcast_to(points[here], (len(better), 2)), points[better]], axis=1)
        for there in better[~shapely.intersects(inside, shapely.linestrings(lines))]:
            so_far[there] = steps[there]
            heapq.heappush(queue, (float(steps[there] + ahead[there]), int(there)))
    return float(ahead[0])


def _corners(shape: BaseGeometry, ends: FloatArray, most: float) -> FloatArray:
    """Start, goal (2, 2) and the corners of a shape that ways of at most `most` can pass, (k, 2)."""
    corners = shapely.get_coordinates(shape)
    through = np.linalg.norm(corners - ends[0], axis=1) + np.linalg.norm(corners - ends[1], axis=1)
    return np.concatenate([ends, corners[through <= most + TOUCH]])
