"""The ROS 2 message types that an exported bag holds, field by field (as from ROS 2 Humble on)."""

from __future__ import annotations

TF = "tf2_msgs/msg/TFMessage"
MARKERS = "visualization_msgs/msg/MarkerArray"
PATH = "nav_msgs/msg/Path"
LOG = "rcl_interfaces/msg/Log"
NUMBER = "std_msgs/msg/Float64"
TWIST = "geometry_msgs/msg/TwistStamped"
POLYGON = "geometry_msgs/msg/PolygonStamped"

TYPES: dict[str, tuple[str, ...]] = {
    "builtin_interfaces/Time": ("int32 sec", "uint32 nanosec"),
    "builtin_interfaces/Duration": ("int32 sec", "uint32 nanosec"),
    "std_msgs/Float64": ("float64 data",),
    "std_msgs/Header": ("builtin_interfaces/Time stamp", "string frame_id"),
    "std_msgs/ColorRGBA": ("float32 r", "float32 g", "float32 b", "float32 a"),
    "geometry_msgs/Vector3": ("float64 x", "float64 y", "float64 z"),
    "geometry_msgs/Point": ("float64 x", "float64 y", "float64 z"),
    "geometry_msgs/Point32": ("float32 x", "float32 y", "float32 z"),
    "geometry_msgs/Polygon": ("geometry_msgs/Point32[] points",),
    "geometry_msgs/PolygonStamped": ("std_msgs/Header header", "geometry_msgs/Polygon polygon"),
    "geometry_msgs/Quaternion": ("float64 x", "float64 y", "float64 z", "float64 w"),
    "geometry_msgs/Pose": ("geometry_msgs/Point position", "geometry_msgs/Quaternion orientation"),
    "geometry_msgs/PoseStamped": ("std_msgs/Header header", "geometry_msgs/Pose pose"),
    "geometry_msgs/Twist": ("geometry_msgs/Vector3 linear", "geometry_msgs/Vector3 angular"),
    "geometry_msgs/TwistStamped": ("std_msgs/Header header", "geometry_msgs/Twist twist"),
    "geometry_msgs/Transform": ("geometry_msgs/Vector3 translation", "geometry_msgs/Quaternion rotation"),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header",
        "string child_frame_id",
        "geometry_msgs/Transform transform",
    ),
    "tf2_msgs/TFMessage": ("geometry_msgs/TransformStamped[] transforms",),
    "nav_msgs/Path": ("std_msgs/Header header", "geometry_msgs/PoseStamped[] poses"),
    "rcl_interfaces/Log": (
        "builtin_interfaces/Time stamp",
        "uint8 level",
        "string name",
        "string msg",
        "string file",
        "string function",
        "uint32 line",
    ),
    "sensor_msgs/CompressedImage": ("std_msgs/Header header", "string format", "uint8[] data"),
    "visualization_msgs/UVCoordinate": ("float32 u", "float32 v"),
    "visualization_msgs/MeshFile": ("string filename", "uint8[] data"),
    "visualization_msgs/Marker": (
        "std_msgs/Header header",
        "string ns",
        "int32 id",
        "int32 type",
        "int32 action",
        "geometry_msgs/Pose pose",
        "geometry_msgs/Vector3 scale",
        "std_msgs/ColorRGBA color",
        "builtin_interfaces/Duration lifetime",
        "bool frame_locked",
        "geometry_msgs/Point[] points",
        "std_msgs/ColorRGBA[] colors",
        "string texture_resource",
        "sensor_msgs/CompressedImage texture",
        "visualization_msgs/UVCoordinate[] uv_coordinates",
        "string text",
        "string mesh_resource",
        "visualization_msgs/MeshFile mesh_file",
        "bool mesh_use_embedded_materials",
    ),
    "visualization_msgs/MarkerArray": ("visualization_msgs/Marker[] markers",),
}
"""Fields of each type, in the order in which they are serialised."""


def key_of(name: str) -> str:
    """Return the key in `TYPES` of a type's full name."""
    return name.replace("/msg/", "/")


def definition(name: str) -> str:
    """Return the type's definition with those that it needs, as an MCAP schema (`ros2msg`) holds it."""
    needed: list[str] = []
    _collect(key_of(name), needed)
    first, *rest = ("\n".join(TYPES[key]) + "\n" for key in needed)
    parts = [f"{'=' * 80}\nMSG: {key}\n{text}" for key, text in zip(needed[1:], rest, strict=True)]
    return first + "".join(parts)


def _collect(key: str, found: list[str]) -> None:
    if key in found:
        return
    found.append(key)
    for field in TYPES[key]:
        kind = field.split()[0].removesuffix("[]")
        if kind in TYPES:
            _collect(kind, found)
