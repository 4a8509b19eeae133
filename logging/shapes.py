"""Outlines as the primitives that viewers draw: filled triangles and closed lines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from pushplan.arrays import FloatArray

CIRCLE_CORNERS = 48
"""Corners of the polygon that is drawn for a circle."""

_LINE_PIXELS = 2.0


class Paint(NamedTuple):
    """A colour: red, green, blue, opacity, each from 0 to 1."""

    r: float
    g: float
    b: float
    a: float = 1.0


def circle(center: FloatArray, radius: float) -> FloatArray:
    """Return a polygon (v, 2) through points of a circle, counter-clockwise."""
    angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_CORNERS, endpoint=False)
    return center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def filled(outline: FloatArray, z: float, paint: Paint) -> TriangleListPrimitive:
    """Return the inside of a simple polygon (v, 2) at height `z`, m, as triangles."""
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    corners = [shapely.get_coordinates(shapely.orient_polygons(part))[:3] for part in parts]
    return TriangleListPrimitive(
        pose=_identity(), points=_points(np.concatenate(corners), z), color=Color(**paint._asdict())
    )


def line(points: FloatArray, z: float, paint: Paint, kind: int = LinePrimitive.LINE_STRIP) -> LinePrimitive:
    """Return a line through points (k, 2) at height `z`, m, of the same width at every zoom."""
    return LinePrimitive(
        type=kind,  # type: ignore[arg-type]
        pose=_identity(),
        thickness=_LINE_PIXELS,
        scale_invariant=True,
        points=_points(points, z),
        color=Color(**paint._asdict()),
    )


def loop(outline: FloatArray, z: float, paint: Paint) -> LinePrimitive:
    """Return the closed line around a polygon (v, 2)."""
    return line(outline, z, paint, LinePrimitive.LINE_LOOP)


def _points(points: FloatArray, z: float) -> list[Point3]:
    return [Point3(x=x, y=y, z=z) for x, y in points]


def _identity() -> Pose:
    return Pose(position=Vector3(), orientation=Quaternion(w=1.0))


def corners(shape: LinePrimitive | TriangleListPrimitive) -> FloatArray:
    """Return the points (k, 3) of a primitive."""
    return np.array([(point.x, point.y, point.z) for point in shape.points]).reshape(-1, 3)
