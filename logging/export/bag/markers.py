"""The scene of a run as RViz draws it: markers whose lines are wide enough to be seen in a view of everything."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive

from pushplan.logging.export.bag.frames import Frames, turn
from pushplan.logging.view.window import Window

Message = dict[str, Any]

LINE_STRIP, LINE_LIST, TRIANGLES = 4, 5, 11
"""Types of visualization_msgs/Marker."""

_PIXELS, _VIEW = 2.0, 800.0
"""Width of a line, pixels, in a view of so many pixels in which everything is seen."""


def line_width(view: Window) -> float:
    """Return the width of lines that are seen in a view of all of `view`, m."""
    return _PIXELS / _VIEW * max(view.xmax - view.xmin, view.ymax - view.ymin)


def markers(entities: Iterable[SceneEntity], frames: Frames, width: float) -> Message:
    """Return a message of the markers of scene entities, each in the frame of its body, with lines of a width, m."""
    return {"markers": [marker for entity in entities for marker in _of(entity, frames, width)]}


def _of(entity: SceneEntity, frames: Frames, width: float) -> Iterator[Message]:
    for i, triangles in enumerate(entity.triangles):
        yield _marker(entity, frames, i, TRIANGLES, 1.0, triangles)
    for i, line in enumerate(entity.lines, start=len(entity.triangles)):
        kind = LINE_LIST if line.type == LinePrimitive.LINE_LIST else LINE_STRIP
        marker = _marker(entity, frames, i, kind, width, line)
        if line.type == LinePrimitive.LINE_LOOP:
            marker["points"].append(marker["points"][0])
        yield marker


def _marker(
    entity: SceneEntity, frames: Frames, i: int, kind: int, scale: float,
    shape: LinePrimitive | TriangleListPrimitive,
) -> Message:  # fmt: skip
    color = shape.color
    return {
        "header": {"frame_id": frames.named(entity.frame_id)},
        "ns": entity.id,
        "id": i,
        "type": kind,
        "pose": {"orientation": turn(0.0)},
        "scale": {"x": scale, "y": scale, "z": scale},
        "color": {"r": color.r, "g": color.g, "b": color.b, "a": color.a},
        "frame_locked": True,
        "points": [{"x": point.x, "y": point.y, "z": point.z} for point in shape.points],
    }
