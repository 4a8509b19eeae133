"""Export of a run as a ROS 2 bag (MCAP) for `ros2 bag play`, with an RViz configuration beside it.

Topics: /tf_static and /tf, /scene and /contacts (markers), /plan/path and /plan/smoothed (without a plan:
/plan/nearest), /pusher/twist, /margins/... (one number each), /log. For path followers, /base/path, /base/twist and
/footprint (the outline of robot, plate and load) refer to the base. Scene, paths and footprint have the durability
transient local and are repeated every second for volatile subscribers.

Frames are nested as in ROS (REP 105): map -> odom -> base_link -> pusher, and map -> each object. Constant transforms
are on /tf_static.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

import pushplan.logging.metadata as metadata
import pushplan.logging.schemas as schemas
from pushplan.drawing.scene import Scene
from pushplan.geometry import se2
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.rviz import Frames, line_width, rviz_file
from pushplan.logging.scene import NANO
from pushplan.logging.shown import CHAIN, WORLD, contact_names
from pushplan.logging.tables import base_in_plate
from pushplan.logging.topics import messages
from pushplan.util.arrays import FloatArray
from pushplan.util.files import check_output, write_whole
from pushplan.util.names import BESIDE_A_BAG, PUSHER
from pushplan.util.naming import optional

_EARLIEST = 1.0
"""Epoch of a run without a start time in its log, s; 0 would mean `latest` in tf2."""
_REPEAT_PERIOD = NANO
"""Period of the repeated messages (scene, paths, footprint), ns."""
_LINE_STRIP, _LINE_LIST, _TRIANGLES = 4, 5, 11
"""Types of visualization_msgs/Marker."""

Point = tuple[float, float, float]


def write_ros2(
    run: RecordedRun, path: Path | str, *, frames: Frames | None = None, epoch: float | None = None
) -> None:
    """Write the bag, an .mcap file, and beside it an `.rviz` file of the same name.

    Args:
        run: Run to write.
        path: Path of the bag. A stream, such as a pipe, gets no `.rviz` file.
        frames: Names of the frames above the chain.
        epoch: ROS time of the simulated time 0, s; None for the start of the run.

    Raises:
        MissingExtraError: If rosbags is not installed.
        FrameNamesError: If the run has a frame with one of these names.
        OutputError: If a file cannot be written.
    """
    frames = Frames() if frames is None else frames
    frames.check(run.scenario)
    with tempfile.TemporaryDirectory() as folder:
        with _Bag(Path(folder) / "bag", round(NANO * (_start_time(run) if epoch is None else epoch))) as bag:
            _Contents(bag, run, frames).write()
        write_whole(path, (Path(folder) / "bag" / "bag.mcap").read_bytes())
    if not check_output(Path(path)).streamed:
        write_whole(Path(path).with_suffix(BESIDE_A_BAG), rviz_file(run, frames).encode())


def _start_time(run: RecordedRun) -> float:
    words = run.fields.get(metadata.RUN, {})
    try:
        return max(_EARLIEST, datetime.fromisoformat(words["started_at"]).timestamp())
    except (KeyError, ValueError):
        return _EARLIEST


class _Bag:
    """Context manager that writes a bag with messages of ROS 2 Humble, which later versions read."""

    def __init__(self, folder: Path, epoch: int) -> None:
        rosbag2 = optional("rosbags.rosbag2", "a ROS 2 bag", "rosbags", "ros2")
        typesys = optional("rosbags.typesys", "a ROS 2 bag", "rosbags", "ros2")
        self._interfaces = optional("rosbags.interfaces", "a ROS 2 bag", "rosbags", "ros2")
        self._store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        self._writer = rosbag2.Writer(folder, version=8, storage_plugin=rosbag2.StoragePlugin.MCAP)
        self._writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        self._connections: dict[str, Any] = {}
        self._epoch = epoch

    def __enter__(self) -> Self:
        self._writer.open()
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.close()

    def make(self, kind: str, *values: Any) -> Any:
        """Return a message of type `package/Name` with the values of its fields in order."""
        return self._store.types[kind.replace("/", "/msg/")](*values)

    def stamp(self, instant: int) -> Any:
        """Return the ROS time of a simulated time, ns."""
        return self.make("builtin_interfaces/Time", *divmod(self._epoch + instant, NANO))

    def header(self, frame: str, instant: int) -> Any:
        """Return the header of a message in a frame."""
        return self.make("std_msgs/Header", self.stamp(instant), frame)

    def send(self, topic: str, instant: int, message: Any, latched: bool = False) -> None:
        """Write a message at a simulated time, ns; later subscribers also get a `latched` one."""
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store, offered_qos_profiles=[self._quality(latched)]
            )
        data = self._store.serialize_cdr(message, kind)
        self._writer.write(self._connections[topic], self._epoch + instant, data)

    def _quality(self, latched: bool) -> Any:
        """Return a reliable QoS profile that keeps the last 10 messages."""
        qos = self._interfaces
        durability = qos.QosDurability.TRANSIENT_LOCAL if latched else qos.QosDurability.VOLATILE
        never = qos.QosTime(9223372036, 854775807)
        return qos.Qos(
            qos.QosHistory.KEEP_LAST,
            10,
            qos.QosReliability.RELIABLE,
            durability,
            never,
            never,
            qos.QosLiveliness.AUTOMATIC,
            never,
            False,
        )


class _Contents:
    """Contents of a bag: the messages of the log for viewers, and the pose of the base."""

    def __init__(self, bag: _Bag, run: RecordedRun, frames: Frames) -> None:
        self._bag, self._run, self._frames, self._scenario = bag, run, frames, run.scenario
        self._width = line_width(Scene.of(run.scenario, run.plan).window)
        self._base = base_in_plate(run.scenario)
        names = enumerate(contact_names(run.scenario))  # ROS allows only letters, digits and underscores
        self._margins = [f"/margins/c{k:02d}_{re.sub('[^A-Za-z0-9]+', '_', name)}" for k, name in names]

    def write(self) -> None:
        """Write all messages, and repeat those of the fixed scene."""
        still: dict[str, Callable[[int], Any]] = {"/footprint": self._footprint}
        moving: dict[tuple[schemas.Topic, int], bytes] = {}  # the first sample replaces the initial message
        for instant, topic, data in messages(self._run):
            if topic in (schemas.TF, schemas.CONTACTS, schemas.PUSHER_TWIST, schemas.MARGINS):
                moving[topic, instant] = data
            elif topic is schemas.LOG:
                line = topic.message.FromString(data)
                said = (10 * line.level, "pushplan", line.message, "", "", 0)
                self._bag.send("/log", instant, self._bag.make("rcl_interfaces/Log", self._bag.stamp(instant), *said))
            elif instant == 0:
                still = self._standing(topic, topic.message.FromString(data)) | still
        self._bag.send("/tf_static", 0, self._rigid(), latched=True)
        for instant in range(0, 1 + max((instant for _, instant in moving), default=0), _REPEAT_PERIOD):
            for name, message in still.items():
                self._bag.send(name, instant, message(instant), latched=True)
        for (topic, instant), data in moving.items():
            for name, message in self._moved(topic, topic.message.FromString(data), instant):
                self._bag.send(name, instant, message)

    def _standing(self, topic: schemas.Topic, message: Any) -> dict[str, Callable[[int], Any]]:
        """Return factories of the messages of the fixed scene, by topic."""
        if topic is schemas.SCENE or (topic is schemas.PLAN_NEAREST and message.entities):
            return {topic.name: partial(self._markers, message.entities)}
        if topic not in (schemas.PLAN_PATH, schemas.PLAN_SMOOTHED):
            return {}
        poses = np.array([_planar(pose.position, pose.orientation) for pose in message.poses])
        base = {"/base/path": partial(self._path, se2.compose(poses, self._base))}
        return {topic.name: partial(self._path, poses), **(base if topic is schemas.PLAN_SMOOTHED else {})}

    def _moved(self, topic: schemas.Topic, message: Any, instant: int) -> Iterator[tuple[str, Any]]:
        """Yield topics and messages of a sample: frames, contacts, twists, and a number for each contact's margin."""
        if topic is schemas.TF:
            yield "/tf", self._transforms(message, instant)
        elif topic is schemas.CONTACTS:
            yield "/contacts", self._markers(message.entities, instant)
        elif topic is schemas.PUSHER_TWIST:
            twist = np.array([message.vx, message.vy, message.omega])
            yield "/pusher/twist", self._twist(twist, PUSHER, instant)
            yield "/base/twist", self._twist(se2.twist_of(self._base, twist), self._frames.base, instant)
        else:
            for name, contact in zip(self._margins, message.contacts, strict=True):
                yield name, self._bag.make("std_msgs/Float64", contact.margin)

    def _rigid(self) -> Any:
        frames, scenario = self._frames, self._scenario
        pairs = [(frames.map, frames.odom, np.zeros(3)), (frames.base, PUSHER, se2.inverse(self._base))]
        pairs += [(PUSHER, CHAIN, se2.inverse(load.chain.pusher.plate_pose)) for load in scenario.task.held]
        return self._bag.make("tf2_msgs/TFMessage", [self._transform(*pair, 0) for pair in pairs])

    def _transforms(self, message: FrameTransforms, instant: int) -> Any:
        """Return the message for /tf with the base in place of the plate, and the objects."""
        frames, moved = self._frames, []
        for one in message.transforms:
            pose = _planar(one.translation, one.rotation)
            if one.child_frame_id == PUSHER:
                moved.append(self._transform(frames.odom, frames.base, se2.compose(pose, self._base), instant))
            elif one.child_frame_id != CHAIN:
                moved.append(self._transform(frames.map, one.child_frame_id, pose, instant))
        return self._bag.make("tf2_msgs/TFMessage", moved)

    def _transform(self, parent: str, child: str, pose: FloatArray, instant: int) -> Any:
        x, y, theta = map(float, pose)
        there = self._bag.make("geometry_msgs/Vector3", x, y, 0.0)
        transform = self._bag.make("geometry_msgs/Transform", there, self._turn(theta))
        return self._bag.make("geometry_msgs/TransformStamped", self._bag.header(parent, instant), child, transform)

    def _turn(self, theta: float) -> Any:
        half = 0.5 * theta
        return self._bag.make("geometry_msgs/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half))

    def _pose(self, x: float, y: float, theta: float) -> Any:
        point = self._bag.make("geometry_msgs/Point", x, y, 0.0)
        return self._bag.make("geometry_msgs/Pose", point, self._turn(theta))

    def _path(self, poses: FloatArray, instant: int) -> Any:
        header = self._bag.header(self._frames.map, instant)
        make = self._bag.make
        stamped = [make("geometry_msgs/PoseStamped", header, self._pose(*pose)) for pose in poses.tolist()]
        return make("nav_msgs/Path", header, stamped)

    def _twist(self, twist: FloatArray, frame: str, instant: int) -> Any:
        vx, vy, omega = map(float, twist)
        linear, angular = (self._bag.make("geometry_msgs/Vector3", *v) for v in ((vx, vy, 0.0), (0.0, 0.0, omega)))
        moved = self._bag.make("geometry_msgs/Twist", linear, angular)
        return self._bag.make("geometry_msgs/TwistStamped", self._bag.header(frame, instant), moved)

    def _footprint(self, instant: int) -> Any:
        """Return the outline of robot, plate and held objects in the frame of the base."""
        points = [self._bag.make("geometry_msgs/Point32", x, y, 0.0) for x, y in self._scenario.footprint.tolist()]
        polygon = self._bag.make("geometry_msgs/Polygon", points)
        header = self._bag.header(self._frames.base, instant)
        return self._bag.make("geometry_msgs/PolygonStamped", header, polygon)

    def _markers(self, entities: Iterable[SceneEntity], instant: int) -> Any:
        """Return markers of scene entities, each in the frame of its body."""
        markers = [
            self._marker(entity, i, kind, scale, shape, points, instant)
            for entity in entities
            for i, (kind, scale, shape, points) in enumerate(self._shapes(entity))
        ]
        return self._bag.make("visualization_msgs/MarkerArray", markers)

    def _shapes(self, entity: SceneEntity) -> Iterator[tuple[int, float, Any, list[Point]]]:
        """Yield type, scale, shape and points of the markers of an entity."""
        for triangles in entity.triangles:
            yield _TRIANGLES, 1.0, triangles, [(p.x, p.y, p.z) for p in triangles.points]
        for line in entity.lines:
            points = [(p.x, p.y, p.z) for p in line.points]
            if line.type == LinePrimitive.LINE_LOOP:
                points.append(points[0])
            kind = _LINE_LIST if line.type == LinePrimitive.LINE_LIST else _LINE_STRIP
            yield kind, self._width, line, points

    def _marker(
        self, entity: SceneEntity, number: int, kind: int, scale: float, shape: Any, points: list[Point], instant: int
    ) -> Any:
        bag, color = self._bag, shape.color
        frame = self._frames.map if entity.frame_id == WORLD else entity.frame_id
        nothing = np.zeros(0, dtype=np.uint8)
        return bag.make(
            "visualization_msgs/Marker",
            bag.header(frame, instant),
            entity.id,
            number,
            kind,
            0,  # add
            self._pose(0.0, 0.0, 0.0),
            bag.make("geometry_msgs/Vector3", scale, scale, scale),
            bag.make("std_msgs/ColorRGBA", color.r, color.g, color.b, color.a),
            bag.make("builtin_interfaces/Duration", 0, 0),
            True,  # frame_locked: it moves with its frame
            [bag.make("geometry_msgs/Point", *point) for point in points],
            [],
            "",
            bag.make("sensor_msgs/CompressedImage", bag.header("", instant), "", nothing),
            [],
            "",
            "",
            bag.make("visualization_msgs/MeshFile", "", nothing),
            False,
        )


def _planar(place: Vector3, turn: Quaternion) -> FloatArray:
    """Return the planar pose (3,) of a position and a quaternion."""
    return np.array([place.x, place.y, 2.0 * math.atan2(turn.z, turn.w)])
