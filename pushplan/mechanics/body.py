"""The bodies that move with the chain as one, for collision checks and pictures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import shapely
from shapely.geometry.base import BaseGeometry

from pushplan.geometry import se2
from pushplan.util.arrays import FloatArray

SEAM = 1e-7
"""Bodies this close (m) count as one: they touch along lines that rounding may open."""


class BodyKind(Enum):
    """What a body is; objects alone rest on the floor and are pushed."""

    ROBOT = "robot"
    PLATE = "plate"
    OBJECT = "object"


@dataclass(frozen=True, eq=False)
class Body:
    """An outline that is fixed to the chain frame.

    Attributes:
        name: `robot`, `pusher` (the plate) or the object's name.
        kind: What it is.
        outline: (v, 2) simple polygon in the chain frame, m, counter-clockwise.
    """

    name: str
    kind: BodyKind
    outline: FloatArray


def as_one(bodies: Iterable[Body]) -> BaseGeometry:
    """Return what the bodies cover together, in the chain frame."""
    outlines = [shapely.Polygon(body.outline) for body in bodies]
    return shapely.union_all(outlines).buffer(SEAM, join_style="mitre").buffer(-SEAM, join_style="mitre")


def area_at(bodies: Iterable[Body], pose: FloatArray) -> BaseGeometry:
    """Return what bodies cover together with their frame at a pose (3,) in the world."""
    return shapely.transform(as_one(bodies), lambda corners: se2.transform_points(pose, corners))


def outline_of_all(bodies: Iterable[Body]) -> FloatArray:
    """Return one polygon (v, 2) around all bodies, counter-clockwise; where they are apart, their convex hull."""
    shape = as_one(bodies)
    around = shape if isinstance(shape, shapely.Polygon) else shape.convex_hull
    ring = shapely.Polygon(shapely.get_exterior_ring(around))  # without holes between the bodies
    return shapely.get_coordinates(shapely.orient_polygons(ring))[:-1]
