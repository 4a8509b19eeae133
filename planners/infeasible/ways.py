"""Free region for the centre of a disc inside the chain, and its shortest path around the obstacles."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from pushplan.geometry import se2
from pushplan.mechanics.chain import SEAM, Body, as_one
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import Obstacle
from pushplan.util.arrays import FloatArray
from pushplan.util.names import CLEARANCE_ROOM

ARC_SEGMENTS = 8
"""Segments per quarter of a round corner. They lie inside it, so that no free space counts as blocked."""


_AROUND = 10.0
"""Width of the free border around everything if there is no workspace, m."""


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
    """Return the region that obstacles block for the centre of a disc."""
    return shapely.disjoint_subset_union_all(
        grown(obstacles, radius)
    )  # a quarter of the time of `union_all` if most are disjoint


def grown(obstacles: Sequence[Obstacle], radius: float) -> NDArray[np.object_]:
    """Return the regions that each of the obstacles blocks for the centre of a disc."""
    radii = np.array([o.radius for o in obstacles]) + radius
    return np.asarray(shapely.buffer([o.core for o in obstacles], radii, quad_segs=ARC_SEGMENTS))


def reached(free: BaseGeometry, place: BaseGeometry, within: float) -> BaseGeometry:
    """Return the parts of a region within a distance (m) of a place."""
    parts = shapely.get_parts(free)
    return shapely.union_all(parts[shapely.distance(parts, place) <= within])


def between(grown_obstacles: NDArray[np.object_], one: BaseGeometry, other: BaseGeometry) -> tuple[int, ...]:
    """Return the indices of the grown obstacles that bound both of two regions."""
    near = [shapely.distance(grown_obstacles, side) <= TOUCH for side in (one, other)]
    return tuple(np.flatnonzero(near[0] & near[1]).tolist())


def near_to(obstacles: Sequence[Obstacle], areas: Sequence[BaseGeometry], within: float) -> tuple[int, ...]:
    """Return the indices of the obstacles that are within a distance (m) of any of the areas."""
    taken = shapely.union_all(areas)
    return tuple(k for k, shape in enumerate(grown(obstacles, 0.0)) if shape.distance(taken) <= within)


def room(scenario: Scenario, radius: float) -> BaseGeometry:
    """Return the free region for the centre of a disc: inside the workspace and clear of the obstacles.

    Without a workspace, the region ends at a free border around everything.
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
"""Depth (m) to which paths can enter a blocked region, because they run along its edges."""

STRAIGHT = 1e-12
"""Rounding tolerance of the test whether two edges lie on one side of a line, m^4."""

MOST_SIGHTS = 10_000
"""Maximum number of lines of sight. The search then returns the bound found so far."""


def way_around(scenario: Scenario, disc: Disc, most: float) -> float:
    """Return the length (m) of the shortest path of a disc's centre from start to goal, or a lower bound of it (A*).

    Args:
        scenario: The problem.
        disc: A disc inside the chain.
        most: Length above which paths are not searched for, m.
    """
    start, goal = disc.at(scenario.start), disc.at(scenario.goal.pose_chain)
    ends = shapely.get_coordinates([start, goal])
    shape = blocked(scenario.obstacles, disc.radius + scenario.clearance - CLEARANCE_ROOM)
    corners, edges = _corners(shape, ends, most)
    inside = shape.buffer(-TOUCH, join_style="mitre")
    shapely.prepare(inside)
    edges = np.concatenate([np.zeros((2, 2, 2)), edges])
    length = _shortest(np.concatenate([ends, corners]), edges, inside, most)
    return length if math.isfinite(length) else float(start.distance(goal))


def _shortest(points: FloatArray, edges: FloatArray, inside: BaseGeometry, most: float) -> float:
    """Return the length (m) of the shortest path between the first two of points (k, 2), or a lower bound.

    The path consists of lines outside a shape. It bends only at points whose two edges (k, 2, 2) lie on one side of
    the line. Paths longer than `most` are not searched for.
    """
    ahead = np.linalg.norm(points - points[1], axis=1)
    so_far = np.where(np.arange(len(points)) == 0, 0.0, np.inf)
    queue, done, sights = [(float(ahead[0]), 0)], np.zeros(len(points), dtype=bool), 0
    while queue:
        through, here = heapq.heappop(queue)
        if through > most or sights > MOST_SIGHTS or here == 1:
            return float(min(so_far[1], through))
        if done[here]:
            continue
        done[here] = True
        away = points - points[here]
        steps = so_far[here] + np.hypot(*away.T)
        sides = away[:, None, 0] * edges[..., 1] - away[:, None, 1] * edges[..., 0]
        better = np.flatnonzero((steps < so_far) & (sides[:, 0] * sides[:, 1] > -STRAIGHT))
        sights += len(better)
        lines = np.stack([np.broadcast_to(points[here], (len(better), 2)), points[better]], axis=1)
        for there in better[~shapely.intersects(inside, shapely.linestrings(lines))]:
            so_far[there] = steps[there]
            heapq.heappush(queue, (float(steps[there] + ahead[there]), int(there)))
    return float(so_far[1])


def _corners(shape: BaseGeometry, ends: FloatArray, most: float) -> tuple[FloatArray, FloatArray]:
    """Return the corners (k, 2) of a shape on paths of at most `most` between ends (2, 2).

    Also return the edges (k, 2, 2) from each corner to its neighbours.
    """
    corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(shape)), return_index=True)
    begins = np.flatnonzero(np.diff(ring, prepend=-1))
    forth = np.roll(corners, -1, axis=0) - corners
    back = np.roll(corners, 1, axis=0) - corners
    back[begins] = back[np.roll(begins, -1) - 1]  # a ring ends with its first corner
    through = np.linalg.norm(corners - ends[0], axis=1) + np.linalg.norm(corners - ends[1], axis=1)
    near = (np.diff(ring, append=-1) == 0) & (through <= most + TOUCH)
    return corners[near], np.stack([back, forth], axis=1)[near]
