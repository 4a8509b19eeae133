"""A run as a ROS 2 bag (MCAP), which `ros2 bag play` plays, and beside it a file that makes RViz show it.

Topics: /tf_static and /tf, /scene and /contacts (markers), /plan/path and /plan/smoothed, or /plan/nearest where
there is no plan, /pusher/twist, /margins/... (a number each), /log; of the base, for path followers, /base/path,
/base/twist and /footprint, the outline of all that moves with it. Scene, paths and footprint are offered as transient
local, and sent again every second for programs that only listen.

Frames are nested as in ROS (REP 105): map -> odom -> base_link -> pusher, and map -> each object; what
does not change is on /tf_static.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, Self

import numpy as np
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

import pushplan.logging.metadata as metadata
from pushplan.drawing.scene import PATH_SPACING, Scene
from pushplan.geometry import se2
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.rviz import Frames, line_width, rviz_file
from pushplan.logging.scene import contact_messages, nearest, scene
from pushplan.logging.schemas import LEVELS
from pushplan.logging.shown import CHAIN, WORLD, ContactShapes, LoadContacts, contact_names, smoothed_times, viewed
from pushplan.logging.tables import base_in_plate, footprint_of
from pushplan.logging.topics import pushed_at_samples
from pushplan.plans.execution import Execution
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray
from pushplan.util.files import check_output, write_whole
from pushplan.util.names import BESIDE_A_BAG, PUSHER
from pushplan.util.naming import optional

_NANO = 1_000_000_000
_EARLIEST = 1.0
"""Epoch of a run whose log does not say when it began, s: tf2 takes 0 for `latest`."""
_AGAIN = 1.0
"""Time after which scene and paths are sent again, s."""
_LINE_STRIP, _LINE_LIST, _TRIANGLES = 4, 5, 11
"""Types of visualization_msgs/Marker."""

Point = tuple[float, float, float]


def write_ros2(
    run: RecordedRun, path: Path | str, *, frames: Frames | None = None, epoch: float | None = None
) -> None:
    """Write the bag, an .mcap file, and beside it an `.rviz` file of the same name.

    Args:
        run: What to write.
        path: The bag. Where it is streamed, as into a pipe, there is nothing beside it.
        frames: Names of the frames above the chain.
        epoch: ROS time, s, at which the simulated time begins; by default when the run was begun.

    Raises:
        MissingExtraError: When rosbags is not installed.
        FrameNamesError: When the run has a frame of one of these names.
        OutputError: When a file cannot be written.
    """
    frames = Frames() if frames is None else frames
    frames.check(run.scenario)
    with tempfile.TemporaryDirectory() as folder:
        with _Bag(Path(folder) / "bag", round(_NANO * (_begun(run) if epoch is None else epoch))) as bag:
            _Contents(bag, run, frames).write()
        write_whole(path, (Path(folder) / "bag" / "bag.mcap").read_bytes())
    if not check_output(Path(path)).streamed:
        write_whole(Path(path).with_suffix(BESIDE_A_BAG), rviz_file(run, frames).encode())


def _begun(run: RecordedRun) -> float:
    words = run.fields.get(metadata.RUN, {})
    try:
        return max(_EARLIEST, datetime.fromisoformat(words["started_at"]).timestamp())
    except (KeyError, ValueError):
        return _EARLIEST


class _Bag:
    """A bag being written: a context manager; messages are those of ROS 2 Humble, which later versions read."""

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
        """Return a message of the type `package/Name` with values for its fields, in their order."""
        return self._store.types[kind.replace("/", "/msg/")](*values)

    def stamp(self, time: float) -> Any:
        """Return a simulated time, s, in the time of the bag."""
        now = self._epoch + round(_NANO * time)
        return self.make("builtin_interfaces/Time", now // _NANO, now % _NANO)

    def header(self, frame: str, time: float) -> Any:
        """Return the header of a message in a frame."""
        return self.make("std_msgs/Header", self.stamp(time), frame)

    def send(self, topic: str, time: float, message: Any, latched: bool = False) -> None:
        """Write a message at a simulated time, s; one that is `latched` is also for those who come later."""
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store, offered_qos_profiles=[self._quality(latched)]
            )
        data = self._store.serialize_cdr(message, kind)
        self._writer.write(self._connections[topic], self._epoch + round(_NANO * time), data)

    def _quality(self, latched: bool) -> Any:
        """Return a QoS profile: reliable, the last 10 messages kept."""
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
    """What a bag says of a run."""

    def __init__(self, bag: _Bag, run: RecordedRun, frames: Frames) -> None:
        self._bag, self._run, self._frames, self._scenario = bag, run, frames, run.scenario
        self._width = line_width(Scene.of(run.scenario, run.plan).window)
        self._base = base_in_plate(run.scenario)
        execution = run.execution
        self._execution = execution if execution is not None and len(execution.t) else None

    def write(self) -> None:
        """Write all messages."""
        self._still()
        self._motion()
        if self._execution is not None:
            self._margins(self._execution)
        for line in self._run.lines:
            level = 10 * (1 + LEVELS.index(line.level))
            stamp = self._bag.stamp(line.time)
            message = self._bag.make("rcl_interfaces/Log", stamp, level, "pushplan", line.text, "", "", 0)
            self._bag.send("/log", line.time, message)

    def _still(self) -> None:
        """Send what stands still, at once and again and again."""
        run = self._run
        still: list[tuple[str, Callable[[float], Any]]] = [
            ("/scene", lambda time: self._markers(scene(run.scenario).entities, time)),
            ("/footprint", self._footprint),
        ]
        for topic, poses in self._paths():
            still.append((topic, lambda time, poses=poses: self._path(poses, time)))  # type: ignore[misc]
        ghost = () if run.plan is None else nearest(self._scenario, run.plan).entities
        if ghost:
            still.append(("/plan/nearest", lambda time: self._markers(ghost, time)))
        self._bag.send("/tf_static", 0.0, self._rigid(), latched=True)
        end = 1e-9 if self._execution is None else self._execution.t[-1] + 1e-9
        for time in np.arange(0.0, end, _AGAIN).tolist():
            for topic, message in still:
                self._bag.send(topic, time, message(time), latched=True)

    def _motion(self) -> None:
        """Send frames, contacts and twists at each sample to show; the start where nothing was executed."""
        scenario, execution = self._scenario, self._execution
        if execution is None:
            times, plates, twists = [0.0], scenario.plate_start[None], np.zeros((1, 3))
            objects = np.stack(list(scenario.poses.values()))[None]
        else:
            samples = viewed(execution)
            times, plates = execution.t[samples].tolist(), execution.poses[samples]
            twists, objects = execution.twists[samples], execution.objects[samples]
        for time, plate, places, twist, entities in zip(
            times, plates, objects, twists, self._contacts(), strict=True
        ):
            self._bag.send("/tf", time, self._moving(plate, places, time))
            self._bag.send("/contacts", time, self._markers(entities, time))
            self._bag.send("/pusher/twist", time, self._twist(twist, PUSHER, time))
            moved = self._twist(se2.twist_of(self._base, twist), self._frames.base, time)
            self._bag.send("/base/twist", time, moved)

    def _contacts(self) -> Iterator[Any]:
        """Yield the entities of the contacts that are closed at each sample to show."""
        drawn, execution = LoadContacts(self._scenario, self._execution), self._execution
        samples = np.zeros(1, dtype=np.int64) if execution is None else viewed(execution)
        for load, part in pushed_at_samples(self._run, samples):
            shapes: list[ContactShapes] = []
            if load is not None:
                shapes = drawn.at(load, None if execution is None else samples[part])
            stamps = np.zeros(len(part), dtype=np.int64)
            for data in contact_messages(shapes, len(self._scenario.poses), stamps):
                yield SceneUpdate.FromString(data).entities

    def _margins(self, execution: Execution) -> None:
        """Send the margin of each contact as a number of its own."""
        for i in viewed(execution):
            for topic, margin in zip(margin_topics(self._scenario), execution.margins[i], strict=True):
                number = self._bag.make("std_msgs/Float64", float(margin))
                self._bag.send(topic, float(execution.t[i]), number)

    def _paths(self) -> Iterator[tuple[str, FloatArray]]:
        run = self._run
        if run.plan is None:
            return
        if run.plan.segments:
            poses = [segment.path.sampled(PATH_SPACING) for segment in run.plan.segments]
            yield "/plan/path", np.concatenate(poses)
        if run.plan.trajectory is not None:
            smoothed = run.plan.trajectory.poses_at(smoothed_times(run.plan.trajectory))
            yield "/plan/smoothed", smoothed
            yield "/base/path", se2.compose(smoothed, self._base)

    def _rigid(self) -> Any:
        """Return the message for /tf_static."""
        frames, scenario = self._frames, self._scenario
        pairs = [(frames.map, frames.odom, np.zeros(3)), (frames.base, PUSHER, se2.inverse(self._base))]
        if scenario.kind == "push":
            pairs.append((PUSHER, CHAIN, se2.inverse(scenario.pusher.plate_pose)))
        return self._bag.make("tf2_msgs/TFMessage", [self._transform(*pair, 0.0) for pair in pairs])

    def _moving(self, plate: FloatArray, objects: FloatArray, time: float) -> Any:
        """Return the message for /tf: the base, with the plate at a pose (3,), and the objects (n, 3)."""
        frames = self._frames
        moved = [self._transform(frames.odom, frames.base, se2.compose(plate, self._base), time)]
        pairs = zip(self._scenario.poses, objects, strict=True)
        moved += [self._transform(frames.map, name, place, time) for name, place in pairs]
        return self._bag.make("tf2_msgs/TFMessage", moved)

    def _transform(self, parent: str, child: str, pose: FloatArray, time: float) -> Any:
        x, y, theta = map(float, pose)
        there = self._bag.make("geometry_msgs/Vector3", x, y, 0.0)
        transform = self._bag.make("geometry_msgs/Transform", there, self._turn(theta))
        return self._bag.make("geometry_msgs/TransformStamped", self._bag.header(parent, time), child, transform)

    def _turn(self, theta: float) -> Any:
        half = 0.5 * theta
        return self._bag.make("geometry_msgs/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half))

    def _pose(self, x: float, y: float, theta: float) -> Any:
        point = self._bag.make("geometry_msgs/Point", x, y, 0.0)
        return self._bag.make("geometry_msgs/Pose", point, self._turn(theta))

    def _path(self, poses: FloatArray, time: float) -> Any:
        header = self._bag.header(self._frames.map, time)
        make = self._bag.make
        stamped = [make("geometry_msgs/PoseStamped", header, self._pose(*pose)) for pose in poses.tolist()]
        return make("nav_msgs/Path", header, stamped)

    def _twist(self, twist: FloatArray, frame: str, time: float) -> Any:
        vx, vy, omega = map(float, twist)
        linear, angular = (self._bag.make("geometry_msgs/Vector3", *v) for v in ((vx, vy, 0.0), (0.0, 0.0, omega)))
        moved = self._bag.make("geometry_msgs/Twist", linear, angular)
        return self._bag.make("geometry_msgs/TwistStamped", self._bag.header(frame, time), moved)

    def _footprint(self, time: float) -> Any:
        """Return the outline of robot and plate, and of the objects if they stay there, in the frame of the base."""
        points = [
            self._bag.make("geometry_msgs/Point32", x, y, 0.0) for x, y in footprint_of(self._scenario).tolist()
        ]
        polygon = self._bag.make("geometry_msgs/Polygon", points)
        header = self._bag.header(self._frames.base, time)
        return self._bag.make("geometry_msgs/PolygonStamped", header, polygon)

    def _markers(self, entities: Iterable[SceneEntity], time: float) -> Any:
        """Return markers of scene entities, each in the frame of its body."""
        markers = [
            self._marker(entity, i, kind, scale, shape, points, time)
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
        self, entity: SceneEntity, number: int, kind: int, scale: float, shape: Any, points: list[Point], time: float
    ) -> Any:
        bag, color = self._bag, shape.color
        frame = self._frames.map if entity.frame_id == WORLD else entity.frame_id
        nothing = np.zeros(0, dtype=np.uint8)
        return bag.make(
            "visualization_msgs/Marker",
            bag.header(frame, time),
            entity.id,
            number,
            kind,
            0,  # add
            self._pose(0.0, 0.0, 0.0),
            bag.make("geometry_msgs/Vector3", scale, scale, scale),
            bag.make("std_msgs/ColorRGBA", color.r, color.g, color.b, color.a),
            bag.make("builtin_interfaces/Duration", 0, 0),
            True,  # moves with its frame
            [bag.make("geometry_msgs/Point", *point) for point in points],
            [],
            "",
            bag.make("sensor_msgs/CompressedImage", bag.header("", time), "", nothing),
            [],
            "",
            "",
            bag.make("visualization_msgs/MeshFile", "", nothing),
            False,
        )


def margin_topics(scenario: Scenario) -> list[str]:
    """Return the topic of each contact's margin; names in ROS have letters, digits and underscores only."""
    names = enumerate(contact_names(scenario))
    return [f"/margins/c{k:02d}_{re.sub('[^A-Za-z0-9]+', '_', name)}" for k, name in names]
