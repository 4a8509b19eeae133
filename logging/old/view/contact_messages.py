"""The contacts as messages for viewers: an entity for each, which replaces the one before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.drawing.palette import contact_colours
from pushplan.logging.old.message_template import ByteRows, MessageTemplate
from pushplan.logging.old.view.contacts import ContactShapes
from pushplan.logging.old.view.scene import CHAIN
from pushplan.logging.old.view.shapes import Paint, identity
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import FloatArray, IntArray

_Z_CONE, _Z_SEGMENT, _Z_ARROW = 0.003, 0.004, 0.005
"""Above the bodies, m."""
_SEGMENT_PIXELS, _SHAFT_PIXELS, _CONE_OPACITY = 4.0, 3.0, 0.3


def contact_messages(chain: Chain, shapes: Sequence[ContactShapes], instants: IntArray) -> ByteRows:
    """Return a serialised `SceneUpdate` for each of the `instants` (n,), ns, at which the `shapes` are."""
    columns = [_numbers(one) for one in shapes]
    counts = [column.shape[1] for column in columns]
    paints = [Paint.of(colour) for colour in contact_colours(len(shapes))]

    def message(stamp: Timestamp, numbers: list[float]) -> SceneUpdate:
        places, update = iter(numbers), SceneUpdate()
        for k, (one, paint) in enumerate(zip(shapes, paints, strict=True)):
            update.entities.append(_entity(chain.contact_name(k), stamp, one, paint, places))
        return update

    return MessageTemplate(message, sum(counts)).fill(instants, np.concatenate(columns, axis=1))


def _numbers(shapes: ContactShapes) -> FloatArray:
    """Return what changes of a contact, (n, count), in the order in which `_entity` takes it."""
    known = [part for part in (shapes.cones, shapes.shafts, shapes.heads) if part is not None]
    return np.concatenate([part.reshape(len(part), -1) for part in known], axis=1)


def _entity(
    name: str, stamp: Timestamp, shapes: ContactShapes, paint: Paint, places: Iterator[float]
) -> SceneEntity:
    entity = SceneEntity(id=f"contact/{name}", frame_id=CHAIN, frame_locked=True, timestamp=stamp)
    for _ in range(shapes.cones.shape[1]):
        entity.triangles.append(_triangle(places, _Z_CONE, paint._replace(a=_CONE_OPACITY)))
    segment = iter(shapes.segment.ravel().tolist())
    entity.lines.append(_line(segment, _Z_SEGMENT, paint, _SEGMENT_PIXELS))
    if shapes.shafts is not None:
        entity.lines.append(_line(places, _Z_ARROW, paint, _SHAFT_PIXELS))
        entity.triangles.append(_triangle(places, _Z_ARROW, paint))
    return entity


def _triangle(places: Iterator[float], z: float, paint: Paint) -> TriangleListPrimitive:
    return TriangleListPrimitive(pose=identity(), color=paint.color, points=_points(places, 3, z))


def _line(places: Iterator[float], z: float, paint: Paint, pixels: float) -> LinePrimitive:
    return LinePrimitive(
        type=LinePrimitive.LINE_STRIP, pose=identity(), color=paint.color,
        thickness=pixels, scale_invariant=True, points=_points(places, 2, z),
    )  # fmt: skip


def _points(places: Iterator[float], count: int, z: float) -> list[Point3]:
    return [Point3(x=next(places), y=next(places), z=z) for _ in range(count)]
