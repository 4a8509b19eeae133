"""Costs that no path can beat: by the turns that the pushes allow, and by the way around the obstacles."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from pushplan.core.problem import remaining
from pushplan.geometry import se2
from pushplan.mechanics.body import SEAM, Body, as_one
from pushplan.planners.infeasible.turn_bound import Price, turn_bound
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
    bounds = [float(remaining(x, y, theta, goal))]
    for disc in _discs(scenario):
        rest = (TURN_WEIGHT - float(np.linalg.norm(disc.center))) * turn
        bounds.append(_way_around(scenario, disc, most - rest) + rest)
    return float(max(*bounds, turn_bound(scenario.start, goal, segments, most)))


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
        if here == 1:
            return through
        if done[here]:
            continue
        done[here] = True
        steps = so_far[here] + np.linalg.norm(points - points[here], axis=1)
        better = np.flatnonzero(steps < so_far)
        sights += len(better)
        if sights > MOST_SIGHTS:
            return through
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
