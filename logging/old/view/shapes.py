"""Outlines as the primitives that viewers draw: filled triangles and closed lines."""

from __future__ import annotations

from typing import NamedTuple, Self, TypeVar

import numpy as np
import shapely
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from pushplan.drawing.palette import PLATE, ROBOT, object_colours, red_green_blue
from pushplan.logging.old.message_template import MessageTemplate
from pushplan.mechanics.body import BodyKind
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import FloatArray

CIRCLE_CORNERS = 48
"""Corners of the polygon that is drawn for a circle."""


Primitive = TypeVar("Primitive", LinePrimitive, TriangleListPrimitive)


class Paint(NamedTuple):
    """A colour: red, green, blue, opacity, each from 0 to 1."""

    r: float
    g: float
    b: float
    a: float = 1.0

    @classmethod
    def of(cls, colour: str, a: float = 1.0) -> Self:
        """Return a colour written `#rrggbb`."""
        r, g, b = (part / 255.0 for part in red_green_blue(colour))
        return cls(r, g, b, a)

    @property
    def color(self) -> Color:
        """The same as a message."""
        return Color(**self._asdict())


def body_colours(chain: Chain) -> list[str]:
    """Return the colour of every body of a chain."""
    objects = iter(object_colours([obj.name for obj in chain.objects]))
    carrying = {BodyKind.ROBOT: ROBOT, BodyKind.PLATE: PLATE}
    return [carrying.get(body.kind) or next(objects) for body in chain.bodies]


def circle(center: FloatArray, radius: float) -> FloatArray:
    """Return a polygon (v, 2) through points of a circle, counter-clockwise."""
    angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_CORNERS, endpoint=False)
    return center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def filled(outline: FloatArray, z: float, paint: Paint) -> TriangleListPrimitive:
    """Return the inside of a simple polygon (v, 2) at height `z`, m, as triangles."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    rings = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)
    primitive = TriangleListPrimitive(pose=identity(), color=paint.color)
    return _with_points(primitive, rings[:, :3].reshape(-1, 2), z)


def line(points: FloatArray, z: float, paint: Paint, kind: int = LinePrimitive.LINE_STRIP) -> LinePrimitive:
    """Return a line through points (k, 2) at height `z`, m, of the same width at every zoom."""
    primitive = LinePrimitive(
        type=kind,  # type: ignore[arg-type]
        pose=identity(),
        thickness=2.0,  # pixels
        scale_invariant=True,
        color=paint.color,
    )
    return _with_points(primitive, points, z)


def loop(outline: FloatArray, z: float, paint: Paint) -> LinePrimitive:
    """Return the closed line around a polygon (v, 2)."""
    return line(outline, z, paint, LinePrimitive.LINE_LOOP)


def _with_points(primitive: Primitive, points: FloatArray, z: float) -> Primitive:
    """Return the primitive with points (k, 2) at height `z` added, by joining serialised messages."""
    places = np.column_stack([points, np.full(len(points), z)])
    times = np.zeros(len(points), dtype=np.int64)
    primitive.MergeFromString(_ONE_POINT[type(primitive)].fill(times, places).tobytes())
    return primitive


def _one_point(kind: type[LinePrimitive | TriangleListPrimitive]) -> MessageTemplate:
    """A primitive of one point."""
    return MessageTemplate(lambda _, place: kind(points=[Point3(x=place[0], y=place[1], z=place[2])]), 3)


_ONE_POINT = {kind: _one_point(kind) for kind in (LinePrimitive, TriangleListPrimitive)}


def identity() -> Pose:
    """Return the pose of what stands in its frame's origin."""
    return Pose(position=Vector3(), orientation=Quaternion(w=1.0))


def corners(shape: LinePrimitive | TriangleListPrimitive) -> FloatArray:
    """Return the points (k, 3) of a primitive."""
    return np.array([(point.x, point.y, point.z) for point in shape.points]).reshape(-1, 3)
