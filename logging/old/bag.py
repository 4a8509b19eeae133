"""A run as a ROS 2 bag (MCAP), which `ros2 bag play` plays, and beside it a file that makes RViz show it.

Topics: /tf_static and /tf, /scene and /contacts (markers), /plan/path and /plan/smoothed, or /plan/nearest where
there is no plan, /pusher/twist, /margins/... (a number each), /log; of the base, for path followers, /base/path,
/base/twist and /footprint, the outline of all that moves with it. Scene, paths and footprint are offered as transient
local, and sent again every second for programs that only listen.

Frames are nested as in ROS (REP 105): map -> odom -> base_link -> chain -> objects. Only odom -> base_link changes.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Self

import numpy as np
import yaml
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from pushplan.drawing import palette
from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.logging.old.messages import metadata
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.messages.schemas import LEVELS
from pushplan.logging.old.view.contact_messages import contact_messages
from pushplan.logging.old.view.contacts import PushedContacts, resting
from pushplan.logging.old.view.scene import CHAIN, PATH_SPACING, WORLD, nearest, scene
from pushplan.logging.old.view.views import viewed
from pushplan.logging.old.view.window import Window, smoothed_times, window
from pushplan.mechanics.body import outline_of_all
from pushplan.mechanics.chain import Chain
from pushplan.plans.execution import Execution
from pushplan.util.arrays import FloatArray
from pushplan.util.extras import optional
from pushplan.util.files import check_output, write_whole
from pushplan.util.names import BESIDE_A_BAG, PUSHER

_NANO = 1_000_000_000
_EARLIEST = 1.0
"""Epoch of a run whose log does not say when it began, s: tf2 takes 0 for `latest`."""
_AGAIN = 1.0
"""Time after which scene and paths are sent again, s."""
_LINE_STRIP, _LINE_LIST, _TRIANGLES = 4, 5, 11
"""Types of visualization_msgs/Marker."""
_PIXELS, _VIEW = 2.0, 800.0
"""Width of a line, pixels, in a view of so many pixels in which everything is seen."""

Point = tuple[float, float, float]


class FrameNamesError(PushplanError, ValueError):
    """Names of frames that cannot be used."""


@dataclass(frozen=True)
class Frames:
    """Names of the frames above the chain.

    Attributes:
        map: The world's frame, in which scenarios are specified.
        odom: In which the robot's motion is measured; here the same as `map`.
        base: The robot's frame.
    """

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return the frames named `MAP,BASE` or `MAP,ODOM,BASE`.

        Raises:
            FrameNamesError: When they are not two or three different names.
        """
        names = [name.strip() for name in text.split(",")]
        if len(names) == 2:
            names.insert(1, cls.odom)
        if len(names) != 3 or len(set(names)) < 3 or not all(name and name[0] != "/" for name in names):
            raise FrameNamesError(
                f"frames {text!r}; allowed: MAP,BASE or MAP,ODOM,BASE, all different, without a leading /"
            )
        return cls(*names)

    def check(self, chain: Chain) -> None:
        """Find out whether the chain has a frame of one of these names.

        Raises:
            FrameNamesError: When it has.
        """
        taken = {CHAIN, PUSHER, *(obj.name for obj in chain.objects)} & {self.map, self.odom, self.base}
        if taken:
            raise FrameNamesError(
                f"the chain has a frame {sorted(taken)[0]!r} already; name others with --frames"
            )


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
        FrameNamesError: When the chain has a frame of one of these names.
        OutputError: When a file cannot be written.
    """
    frames = Frames() if frames is None else frames
    frames.check(run.scenario.chain)
    with tempfile.TemporaryDirectory() as folder:
        with _Bag(Path(folder) / "bag", round(_NANO * (_begun(run) if epoch is None else epoch))) as bag:
            _Contents(bag, run, frames).write()
        write_whole(path, (Path(folder) / "bag" / "bag.mcap").read_bytes())
    if not check_output(Path(path)).streamed:
        write_whole(Path(path).with_suffix(BESIDE_A_BAG), rviz_file(run, frames).encode())


def _begun(run: RecordedRun) -> float:
    words = run.words.get(metadata.RUN, {})
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
        self._bag, self._run, self._frames = bag, run, frames
        self._chain = run.scenario.chain
        self._width = line_width(window(run.scenario, run.plan))
        execution = run.execution
        self._execution = execution if execution is not None and len(execution.t) else None
        slipped = execution is not None and execution.object_poses is not None
        self._attached = run.scenario.pushes is None and not slipped

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
        ghost = () if run.plan is None else nearest(self._chain, run.plan).entities
        if ghost:
            still.append(("/plan/nearest", lambda time: self._markers(ghost, time)))
        self._bag.send("/tf_static", 0.0, self._rigid(), latched=True)
        end = 1e-9 if self._execution is None else self._execution.t[-1] + 1e-9
        for time in np.arange(0.0, end, _AGAIN).tolist():
            for topic, message in still:
                self._bag.send(topic, time, message(time), latched=True)

    def _motion(self) -> None:
        """Send frames, contacts and twists at each sample to show; the start where nothing was executed."""
        run, chain, execution = self._run, self._chain, self._execution
        if execution is None:
            shapes, times, samples = resting(chain), np.zeros(1), np.zeros(1, dtype=np.int64)
            poses, twists = run.scenario.first_pose[None], np.zeros((1, 3))
            objects = se2.compose(run.scenario.start[None, None], chain.places)
        else:
            samples = viewed(execution)
            shapes, times = PushedContacts(chain, execution).at(samples), execution.t[samples]
            poses, twists = execution.poses[samples], execution.twists[samples]
            placed = execution.object_poses
            loads = execution.load_poses[samples]
            objects = se2.compose(loads[:, None], chain.places) if placed is None else placed[samples]
        contacts = contact_messages(chain, shapes, np.zeros(len(samples), dtype=np.int64))
        base = chain.pusher.base_pose
        for time, pose, places, twist, row in zip(
            times.tolist(), poses, objects, twists, contacts, strict=True
        ):
            entities = SceneUpdate.FromString(row.tobytes()).entities if run.scenario.pushes is None else ()
            self._bag.send("/tf", time, self._moving(pose, places, time))
            self._bag.send("/contacts", time, self._markers(entities, time))
            self._bag.send("/pusher/twist", time, self._twist(twist, CHAIN, time))
            moved = self._twist(se2.twist_of(base, twist), self._frames.base, time)
            self._bag.send("/base/twist", time, moved)

    def _margins(self, execution: Execution) -> None:
        """Send the margin of each contact as a number of its own."""
        for i in viewed(execution):
            for topic, margin in zip(margin_topics(self._chain), execution.margins[i], strict=True):
                number = self._bag.make("std_msgs/Float64", float(margin))
                self._bag.send(topic, float(execution.t[i]), number)

    def _paths(self) -> Iterator[tuple[str, FloatArray]]:
        run = self._run
        if run.plan is not None and run.plan.path is not None:
            yield "/plan/path", run.plan.path.sampled(PATH_SPACING)
        if run.trajectory is not None:
            times = smoothed_times(run.trajectory)
            yield "/plan/smoothed", run.trajectory.poses_at(times)
            yield "/base/path", run.trajectory.base_poses_at(times)

    def _rigid(self) -> Any:
        """Return the message for /tf_static; objects are in it where the plate is always in contact."""
        frames, chain = self._frames, self._chain
        pairs = [
            (frames.map, frames.odom, np.zeros(3)),
            (frames.base, CHAIN, se2.inverse(chain.pusher.base_pose)),
            (CHAIN, PUSHER, np.zeros(3)),
        ]
        if self._attached:
            pairs += [(CHAIN, obj.name, obj.pose_chain) for obj in chain.objects]
        return self._bag.make("tf2_msgs/TFMessage", [self._transform(*pair, 0.0) for pair in pairs])

    def _moving(self, pose: FloatArray, objects: FloatArray, time: float) -> Any:
        """Return the message for /tf: the base, and the objects (n, 3) where they move on their own."""
        frames, chain = self._frames, self._chain
        base = se2.compose(pose, chain.pusher.base_pose)
        moved = [self._transform(frames.odom, frames.base, base, time)]
        if not self._attached:
            pairs = zip(chain.objects, objects, strict=True)
            moved += [self._transform(frames.map, obj.name, place, time) for obj, place in pairs]
        return self._bag.make("tf2_msgs/TFMessage", moved)

    def _transform(self, parent: str, child: str, pose: FloatArray, time: float) -> Any:
        x, y, theta = map(float, pose)
        there = self._bag.make("geometry_msgs/Vector3", x, y, 0.0)
        transform = self._bag.make("geometry_msgs/Transform", there, self._turn(theta))
        return self._bag.make(
            "geometry_msgs/TransformStamped", self._bag.header(parent, time), child, transform
        )

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
        linear, angular = (
            self._bag.make("geometry_msgs/Vector3", *v) for v in ((vx, vy, 0.0), (0.0, 0.0, omega))
        )
        moved = self._bag.make("geometry_msgs/Twist", linear, angular)
        return self._bag.make("geometry_msgs/TwistStamped", self._bag.header(frame, time), moved)

    def _footprint(self, time: float) -> Any:
        """Return the outline of robot and plate, and of the objects if they stay there, in the frame of the base."""
        chain, attached = self._chain, self._run.scenario.pushes is None
        around = outline_of_all(chain.bodies if attached else chain.carried)
        corners = se2.transform_points(se2.inverse(chain.pusher.base_pose), around)
        points = [self._bag.make("geometry_msgs/Point32", x, y, 0.0) for x, y in corners.tolist()]
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
        self,
        entity: SceneEntity,
        number: int,
        kind: int,
        scale: float,
        shape: Any,
        points: list[Point],
        time: float,
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


def margin_topics(chain: Chain) -> list[str]:
    """Return the topic of each contact's margin; names in ROS have letters, digits and underscores only."""
    names = (chain.contact_name(k) for k in range(len(chain.contacts)))
    return [f"/margins/c{k:02d}_{re.sub('[^A-Za-z0-9]+', '_', name)}" for k, name in enumerate(names)]


def line_width(view: Window) -> float:
    """Return the width of lines that are seen in a view of all of `view`, m."""
    return _PIXELS / _VIEW * max(view.xmax - view.xmin, view.ymax - view.ymin)


def rviz_file(run: RecordedRun, frames: Frames) -> str:
    """Return a configuration of RViz (ROS 2): the scene from above, all of it."""
    view = window(run.scenario, run.plan)
    side = max(view.xmax - view.xmin, view.ymax - view.ymin)
    displays = [
        *(_display("MarkerArray", topic, latched) for topic, latched in _MARKERS),
        {**_display("Path", "/plan/path", True), **_path(palette.PATH, line_width(view))},
        {**_display("Path", "/plan/smoothed", True), **_path(palette.SMOOTHED, line_width(view))},
        {"Class": "rviz_default_plugins/TF", "Name": "frames", "Enabled": False, "Marker Scale": side / 10},
    ]
    camera = {
        "Class": "rviz_default_plugins/TopDownOrtho",
        "Name": "Current View",
        "Scale": _VIEW / side,
        "Angle": 0,
        "X": 0.5 * (view.xmin + view.xmax),
        "Y": 0.5 * (view.ymin + view.ymax),
        "Target Frame": frames.map,
    }
    options = {"Fixed Frame": frames.map, "Background Color": "251; 250; 247", "Frame Rate": 30}
    manager = {
        "Class": "",
        "Displays": displays,
        "Enabled": True,
        "Global Options": options,
        "Tools": [{"Class": f"rviz_default_plugins/{tool}"} for tool in ("MoveCamera", "Measure")],
        "Views": {"Current": camera, "Saved": None},
    }
    panels = [{"Class": f"rviz_common/{name}", "Name": name} for name in ("Displays", "Time")]
    config = {"Panels": panels, "Visualization Manager": manager, "Window Geometry": _WINDOW}
    return yaml.safe_dump(config, sort_keys=False)


_MARKERS = (("/scene", True), ("/plan/nearest", True), ("/contacts", False))
_WINDOW = {"Width": 1400, "Height": 1000}


def _display(kind: str, topic: str, latched: bool) -> dict[str, Any]:
    durability = "Transient Local" if latched else "Volatile"
    quality = {"Depth": 5, "Durability Policy": durability, "Reliability Policy": "Reliable", "Value": topic}
    return {
        "Class": f"rviz_default_plugins/{kind}",
        "Name": topic,
        "Enabled": True,
        "Topic": {**quality, "History Policy": "Keep Last"},
    }


def _path(colour: str, width: float) -> dict[str, Any]:
    parts = "; ".join(map(str, palette.red_green_blue(colour)))
    return {"Line Style": "Billboards", "Line Width": width, "Color": parts, "Pose Style": "None"}
