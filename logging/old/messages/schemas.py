"""Protobuf messages of a run log: Foxglove's where a viewer knows them, small ones of our own elsewhere.

The messages of our own (package `pushplan`) are declared in `_MESSAGES` and built here, so that no generated
code has to be kept. Field numbers never change their meaning; new fields take new numbers. SI units, radians.

- `Plan`: what planning found, complete: arcs of the path, polynomial of the trajectory, search tree; or why nothing.
- `Progress`: one improvement of the best path. Wall-clock times are in the metadata `pushplan.progress.N` and
  `pushplan.planning`. `Costs`: all of them in one message, as plots of one number over another want it.
- `Twist`, `Wrench`, `Margins`: what the pusher does, with which force, and how far every contact is from slipping,
  for people and plots.
- `Segment`: a part of a plan of several pushes; on its topic when it begins.
- `Execution`: the samples of one stretch of the execution, bit for bit (see `blocks`), and `ExecutionEnd`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from foxglove_schemas_protobuf import Point2_pb2, Vector2_pb2
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
from google.protobuf.descriptor_pb2 import FieldDescriptorProto as Field

MessageClass = Any
"""A generated protobuf class; protobuf publishes no type for its dynamic attributes."""

_STAMP = "1 google.protobuf.Timestamp timestamp"

_MESSAGES: dict[str, tuple[str, ...]] = {
    "Twist": (_STAMP, "2 string frame_id", "3 double vx", "4 double vy", "5 double omega"),
    "Wrench": (_STAMP, "2 string frame_id", "3 double fx", "4 double fy", "5 double torque"),
    "ContactMargin": (
        "1 string name",
        "2 double margin",
        "3 optional double friction_margin",
        "4 optional double lambda",
        "5 foxglove.Vector2 force",
        "6 foxglove.Point2 point",
    ),
    "Margins": (_STAMP, "2 double smallest", "3 repeated pushplan_old.ContactMargin contacts"),
    "Progress": (_STAMP, "2 uint64 iterations", "3 double cost", "4 pushplan_old.Path path"),
    "Costs": (_STAMP, "2 repeated double iterations", "3 repeated double cost"),
    "Path": ("1 repeated double start", "2 repeated double twists", "3 repeated double lengths"),
    "Trajectory": (
        "1 repeated double start",
        "2 repeated double breaks",
        "3 repeated double coefficients",
        "4 repeated double arc",
        "5 double rate",
        "6 repeated double base",
    ),
    "Plan": (
        _STAMP,
        "2 bool solved",
        "3 string reason",
        "4 string planner",
        "5 string stable_set",
        "6 int64 seed",
        "7 optional double min_margin",
        "8 pushplan_old.Path path",
        "9 pushplan_old.Trajectory trajectory",
        "10 repeated double tree",
        "11 optional double lower_bound",
        "12 repeated pushplan_old.Diagnosis diagnosis",
        "13 pushplan_old.Path approximate_path",
        "14 repeated double approximate_error",
        "15 string objective",
        "16 optional double margin_asked",
        "17 optional double margin",
        "20 pushplan_old.Robustness robustness",
        "30 repeated pushplan_old.Segment segments",
        "31 optional double objective_cost",
    ),
    "Robustness": (
        "1 optional double contact_friction",
        "2 optional double floor_friction",
        "3 optional double load",
        "4 optional double position",
        "5 optional double angle",
    ),
    "Segment": (
        _STAMP,
        "2 string kind",
        "3 string face",
        "4 double offset",
        "5 pushplan_old.Path path",
        "6 repeated double robot",
        "7 repeated double load_before",
        "8 repeated double load_after",
        "9 double margin",
        "10 double t0",
        "11 double t1",
    ),
    "Number": ("1 string name", "2 double value"),
    "Diagnosis": (
        "1 string cause",
        "2 string text",
        "3 bool proven",
        "4 repeated pushplan_old.Number numbers",
    ),
    "Array": ("1 string name", "2 repeated uint32 shape", "3 bytes planes"),
    "Execution": (_STAMP, "2 uint64 first", "3 repeated pushplan_old.Array arrays"),
    "Loss": ("1 double time", "2 uint32 contact", "3 double margin", "4 repeated double pose"),
    "ExecutionEnd": (
        _STAMP,
        "2 uint64 samples",
        "3 double goal_position_error",
        "4 double goal_angle_error",
        "5 pushplan_old.Loss loss",
    ),
}

_SCALARS = {
    "double": Field.TYPE_DOUBLE,
    "int64": Field.TYPE_INT64,
    "uint64": Field.TYPE_UINT64,
    "uint32": Field.TYPE_UINT32,
    "bool": Field.TYPE_BOOL,
    "string": Field.TYPE_STRING,
    "bytes": Field.TYPE_BYTES,
}


def _add_field(message: descriptor_pb2.DescriptorProto, declaration: str) -> None:
    """Add the field declared as `NUMBER [optional | repeated] TYPE NAME` to `message`."""
    number, *label, kind, name = declaration.split()
    field = message.field.add(name=name, number=int(number))
    repeated = label == ["repeated"]
    field.label = Field.LABEL_REPEATED if repeated else Field.LABEL_OPTIONAL
    field.type = _SCALARS.get(kind, Field.TYPE_MESSAGE)
    if kind not in _SCALARS:
        field.type_name = f".{kind}"
    if label == ["optional"]:  # proto3 keeps the presence of a number in a oneof of its own
        field.proto3_optional = True
        field.oneof_index = len(message.oneof_decl)
        message.oneof_decl.add(name=f"_{name}")


def _file_descriptor() -> descriptor_pb2.FileDescriptorProto:
    dependencies = (timestamp_pb2, Vector2_pb2, Point2_pb2)
    file = descriptor_pb2.FileDescriptorProto(
        name="pushplan/old.proto", package="pushplan_old", syntax="proto3"
    )
    file.dependency.extend(module.DESCRIPTOR.name for module in dependencies)
    for name, fields in _MESSAGES.items():
        message = file.message_type.add(name=name)
        for declaration in fields:
            _add_field(message, declaration)
    return file


_POOL = descriptor_pool.Default()
_POOL.Add(_file_descriptor())


def _message_class(name: str) -> MessageClass:
    return message_factory.GetMessageClass(_POOL.FindMessageTypeByName(f"pushplan_old.{name}"))


Twist = _message_class("Twist")
Wrench = _message_class("Wrench")
Margins = _message_class("Margins")
Progress = _message_class("Progress")
Costs = _message_class("Costs")
Plan = _message_class("Plan")
Segment = _message_class("Segment")
Diagnosis = _message_class("Diagnosis")
Array = _message_class("Array")
Execution = _message_class("Execution")
ExecutionEnd = _message_class("ExecutionEnd")

LEVELS = ("debug", "info", "warning", "error", "fatal")
"""Levels of a line on /log, least serious first, numbered from 1."""


@dataclass(frozen=True)
class Topic:
    """A channel of the log: its name and what its messages are."""

    name: str
    message: MessageClass

    @property
    def kind(self) -> str:
        """Full name of the messages' type."""
        name: str = self.message.DESCRIPTOR.full_name
        return name

    @property
    def schema(self) -> bytes:
        """The declarations of the messages' type and of all that it uses, as a serialised FileDescriptorSet."""
        return _declarations(self.kind)


@cache
def _declarations(kind: str) -> bytes:
    files: dict[str, descriptor_pb2.FileDescriptorProto] = {}

    def add(file: Any) -> None:
        for used in file.dependencies:
            if used.name not in files:
                add(used)
        files[file.name] = descriptor_pb2.FileDescriptorProto.FromString(file.serialized_pb)

    add(_POOL.FindMessageTypeByName(kind).file)
    return descriptor_pb2.FileDescriptorSet(file=files.values()).SerializeToString()


SCENE = Topic("/scene", SceneUpdate)
CONTACTS = Topic("/contacts", SceneUpdate)
TF = Topic("/tf", FrameTransforms)
PLAN = Topic("/plan/result", Plan)
PLAN_PATH = Topic("/plan/path", PosesInFrame)
PLAN_SMOOTHED = Topic("/plan/smoothed", PosesInFrame)
PLAN_TREE = Topic("/plan/tree", SceneUpdate)
PLAN_NEAREST = Topic("/plan/nearest", SceneUpdate)
PROGRESS = Topic("/planner/progress", Progress)
COSTS = Topic("/planner/costs", Costs)
PUSHER_POSE = Topic("/pusher/pose", PoseInFrame)
PUSHER_TWIST = Topic("/pusher/twist", Twist)
PUSHER_WRENCH = Topic("/pusher/wrench", Wrench)
MARGINS = Topic("/margins", Margins)
ROBOT = Topic("/robot", PoseInFrame)
SEGMENT = Topic("/segment", Segment)
EXECUTION = Topic("/execution/samples", Execution)
EXECUTION_END = Topic("/execution/result", ExecutionEnd)
LOG = Topic("/log", Log)
MEASURED = Topic("/measured", PosesInFrame)
EVENTS = Topic("/events", Log)
REPLANS = Topic("/plan/replans", Plan)

TOPICS = (
    SCENE,
    TF,
    PLAN,
    PLAN_PATH,
    PLAN_SMOOTHED,
    PLAN_TREE,
    PROGRESS,
    PUSHER_POSE,
    PUSHER_TWIST,
    MARGINS,
    ROBOT,
    SEGMENT,
    EXECUTION,
    EXECUTION_END,
    LOG,
    CONTACTS,
    PLAN_NEAREST,
    COSTS,
    MEASURED,
    EVENTS,
    REPLANS,
    PUSHER_WRENCH,
)
