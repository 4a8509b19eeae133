"""Where a point of the chain can be at all: the floor, less everything that a disc around it would touch.

Whatever pose the chain has, a disc of radius r around a body-fixed point lies inside a body if it does at one pose.
So the point stays where it is r away from obstacles and walls: a superset of the truth, from which
impossibilities and lower bounds follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.geometry import se2
from pushplan.mechanics.body import SEAM, as_one
from pushplan.mechanics.chain import Chain
from pushplan.scenario.model import CircleObstacle, Obstacle, Scenario
from pushplan.util.arrays import FloatArray

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


def largest_disc(chain: Chain) -> Disc:
    """Return the largest disc inside the chain."""
    circle = shapely.maximum_inscribed_circle([as_one(chain.bodies)])
    return disc_at(chain, shapely.get_coordinates(circle)[0])


def disc_at(chain: Chain, center: FloatArray) -> Disc:
    """Return the largest disc inside the chain around a point (2,) of it; its radius is 0 outside."""
    shape, point = as_one(chain.bodies), shapely.Point(center)
    radius = float(shape.boundary.distance(point)) if shape.contains(point) else 0.0
    return Disc(np.asarray(center, dtype=np.float64), max(0.0, radius - 10.0 * SEAM))


def blocked(obstacles: Sequence[Obstacle], radius: float) -> BaseGeometry:
    """Return where the centre of a disc cannot be for the obstacles."""
    shapes = [
        shapely.Point(o.center) if isinstance(o, CircleObstacle) else shapely.Polygon(o.outline)
        for o in obstacles
    ]
    own = [o.radius if isinstance(o, CircleObstacle) else 0.0 for o in obstacles]
    grown = shapely.buffer(shapes, np.array(own) + radius, quad_segs=ARC_SEGMENTS)
    return shapely.disjoint_subset_union_all(
        grown
    )  # a quarter of the time of `union_all` where most are apart


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
    for obstacle in scenario.obstacles:
        if isinstance(obstacle, CircleObstacle):
            points += [obstacle.center - obstacle.radius, obstacle.center + obstacle.radius]
        else:
            points += list(obstacle.outline)
    return shapely.MultiPoint(np.array(points)).envelope.buffer(_AROUND + 4.0 * radius, join_style="mitre")
