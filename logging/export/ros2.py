"""A run as a ROS 2 bag: one MCAP file of CDR messages that `ros2 bag play` plays and RViz shows.

Topics: /tf (every frame at every sample shown), /scene (markers, once), /plan/path and /plan/smoothed (once),
/pusher/twist, /log. The scene and the paths are offered as transient local, so that programs that come later get
them as well. All times are simulated and begin at 0.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from mcap.writer import CompressionType, Writer

from pushplan.basics.arrays import FloatArray
from pushplan.basics.names import PUSHER
from pushplan.logging.export import ros2_messages as ros2
from pushplan.logging.export.cdr import encode
from pushplan.logging.messages.recorded import LogLine, RecordedRun
from pushplan.logging.messages.schemas import LEVELS
from pushplan.logging.view.scene import CHAIN, WORLD, scene
from pushplan.logging.view.views import viewed
from pushplan.logging.view.window import PATH_SPACING, smoothed_times
from pushplan.mechanics.chain import Chain
from pushplan.outputs.write import write_whole

Message = dict[str, Any]

_LINE_STRIP, _TRIANGLES = 4, 11
"""Types of visualization_msgs/Marker."""

_LINE_WIDTH = 0.004
"""m."""

_VOLATILE, _LATCHED = 2, 1
"""Values of a durability in a QoS profile: only for those who listen, also for those who come later."""


def write_ros2(run: RecordedRun, path: Path | str) -> None:
    """Write the bag, an .mcap file.

    Raises:
        OutputError: When the file cannot be written.
    """
    buffer = io.BytesIO()
    bag = _Bag(buffer)
    bag.send("/scene", ros2.MARKERS, 0.0, {"markers": list(_markers(run))}, _LATCHED)
    for topic, poses in _paths(run):
        bag.send(topic, ros2.PATH, 0.0, _path(poses), _LATCHED)
    for time, pose, twist in _samples(run):
        bag.send("/tf", ros2.TF, time, _transforms(run.scenario.chain, pose, time))
        bag.send("/pusher/twist", ros2.TWIST, time, _twist(twist, time))
    for line in run.lines:
        bag.send("/log", ros2.LOG, line.time, _line(line))
    bag.finish()
    write_whole(path, buffer.getvalue())


class _Bag:
    """The MCAP file of a bag in the making."""

    def __init__(self, stream: io.BytesIO) -> None:
        self._writer = Writer(stream, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library=f"pushplan {version('pushplan')}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def send(self, topic: str, kind: str, time: float, message: Message, durability: int = _VOLATILE) -> None:
        if kind not in self._schemas:
            data = ros2.definition(kind).encode()
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", data)
        if topic not in self._channels:
            quality = {"offered_qos_profiles": _quality(durability)}
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind], quality)
        stamp = round(1e9 * time)
        self._writer.add_message(self._channels[topic], stamp, encode(kind, message), stamp)

    def finish(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]


def _quality(durability: int) -> str:
    """A QoS profile as bags hold it: YAML, enumerations as numbers, reliable, the last 10 messages kept."""
    never = "{sec: 9223372036, nsec: 854775807}"
    return (
        f"- {{history: 1, depth: 10, reliability: 1, durability: {durability}, deadline: {never}, "
        f"lifespan: {never}, liveliness: 1, liveliness_lease_duration: {never}, "
        "avoid_ros_namespace_conventions: false}"
    )


def _samples(run: RecordedRun) -> Iterator[tuple[float, FloatArray, FloatArray]]:
    """Yield time, pose (3,) and twist (3,) of each sample to show; the start where nothing was executed."""
    execution = run.execution
    if execution is None or len(execution.t) == 0:
        yield 0.0, run.scenario.start, np.zeros(3)
        return
    for i in sorted(viewed(execution)):
        yield float(execution.t[i]), execution.poses[i], execution.twists[i]


def _paths(run: RecordedRun) -> Iterator[tuple[str, FloatArray]]:
    if run.plan is not None and run.plan.path is not None:
        yield "/plan/path", run.plan.path.sampled(PATH_SPACING)
    if run.trajectory is not None:
        yield "/plan/smoothed", run.trajectory.poses_at(smoothed_times(run.trajectory))


def _header(frame: str, time: float = 0.0) -> Message:
    seconds, nanoseconds = divmod(round(1e9 * time), 1_000_000_000)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame}


def _turn(theta: float) -> Message:
    return {"z": math.sin(0.5 * theta), "w": math.cos(0.5 * theta)}


def _path(poses: FloatArray) -> Message:
    stamped = [
        {"header": _header(WORLD), "pose": {"position": {"x": x, "y": y}, "orientation": _turn(theta)}}
        for x, y, theta in poses
    ]
    return {"header": _header(WORLD), "poses": stamped}


def _line(line: LogLine) -> Message:
    level = 10 * (1 + LEVELS.index(line.level))
    return {"stamp": _header("", line.time)["stamp"], "level": level, "name": "pushplan", "msg": line.text}


def _transforms(chain: Chain, pose: FloatArray, time: float) -> Message:
    frames = [(WORLD, CHAIN, pose), (CHAIN, PUSHER, np.zeros(3))]
    frames += [(CHAIN, obj.name, obj.pose_chain) for obj in chain.objects]
    return {
        "transforms": [
            {
                "header": _header(parent, time),
                "child_frame_id": child,
                "transform": {"translation": {"x": x, "y": y}, "rotation": _turn(theta)},
            }
            for parent, child, (x, y, theta) in frames
        ]
    }


def _twist(twist: FloatArray, time: float) -> Message:
    vx, vy, omega = twist
    return {
        "header": _header(CHAIN, time),
        "twist": {"linear": {"x": vx, "y": vy}, "angular": {"z": omega}},
    }


def _markers(run: RecordedRun) -> Iterator[Message]:
    """Yield the markers of the scene: filled shapes and their outlines, each in the frame of its body."""
    for entity in scene(run.scenario).entities:
        for i, triangles in enumerate(entity.triangles):
            yield _marker(entity, i, _TRIANGLES, 1.0, triangles)
        for i, line in enumerate(entity.lines, start=len(entity.triangles)):
            marker = _marker(entity, i, _LINE_STRIP, _LINE_WIDTH, line)
            if line.type == LinePrimitive.LINE_LOOP:
                marker["points"].append(marker["points"][0])
            yield marker


def _marker(
    entity: SceneEntity, i: int, kind: int, scale: float, shape: LinePrimitive | TriangleListPrimitive
) -> Message:
    color = shape.color
    return {
        "header": _header(entity.frame_id),
        "ns": entity.id,
        "id": i,
        "type": kind,
        "pose": {"orientation": _turn(0.0)},
        "scale": {"x": scale, "y": scale, "z": scale},
        "color": {"r": color.r, "g": color.g, "b": color.b, "a": color.a},
        "frame_locked": True,
        "points": [{"x": point.x, "y": point.y, "z": point.z} for point in shape.points],
    }
