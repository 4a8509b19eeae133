"""Protobuf messages of a run log: Foxglove's if a viewer knows them, otherwise small ones of pushplan.

The messages of pushplan (package `pushplan`) are declared in `_MESSAGES` and built here, without generated code.
Field numbers never change their meaning; new fields get new numbers. Units are SI and radians.

- `Plan`: numbers of a plan, or the reason why there is none. `Segment`: a part of a plan, sent when it begins.
- `Progress`: one improvement of the best path. `Costs`: all of them in one message, for a plot over iterations.
- `Margins`: margin of every contact. `Twist`, `Wrench` and so on: series of the plate (see `signals`).
- `ExecutionEnd`: result of the execution.

Messages are for viewers; the attachments of the log hold the run itself (see `codec`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FieldDescriptorProto as Field
from google.protobuf.message import DecodeError
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.logging.signals import MARGINS as MARGINS_TOPIC
from pushplan.logging.signals import SIGNALS, Signal
from pushplan.plans.execution import Execution

MessageClass = Any
"""A generated protobuf class; protobuf publishes no type for its dynamic attributes."""

_STAMP = "1 google.protobuf.Timestamp timestamp"
_OF_CONTACTS = [
    f"{'optional double' if len(one.columns) == 1 else 'foxglove.Vector2'} {one.field}"
    for one in SIGNALS[Execution].values()
    if one.topic == MARGINS_TOPIC and one.name != "margins"
]
_MESSAGES: dict[str, tuple[str, ...]] = {
    "ContactMargin": ("1 string name", "2 double margin", *(f"{k} {one}" for k, one in enumerate(_OF_CONTACTS, 3))),
    "Margins": (_STAMP, "2 double smallest", "3 repeated pushplan.ContactMargin contacts"),
    "Progress": (_STAMP, "2 uint64 iterations", "3 double cost"),
    "Costs": (_STAMP, "2 repeated double iterations", "3 repeated double cost"),
    "Plan": (
        _STAMP,
        "2 bool solved",
        "3 string reason",
        "4 string planner",
        "5 string stable_set",
        "6 int64 seed",
        "7 optional double cost",
        "8 optional double lower_bound",
        "9 optional double duration",
        "10 optional double margin_asked",
        "11 optional double margin",
        "12 optional double min_margin",
    ),
    "Segment": (
        _STAMP,
        "2 string kind",
        "3 repeated string objects",
        "4 string face",
        "5 double offset",
        "6 double cost",
        "7 double margin",
        "8 double t0",
        "9 double t1",
    ),
    "Loss": ("1 double time", "2 string contact", "3 double margin", "4 repeated double pose"),
    "ExecutionEnd": (
        _STAMP,
        "2 uint64 samples",
        "3 double goal_position_error",
        "4 double goal_angle_error",
        "5 pushplan.Loss loss",
    ),
}

_SCALARS = {
    "double": Field.TYPE_DOUBLE,
    "int64": Field.TYPE_INT64,
    "uint64": Field.TYPE_UINT64,
    "uint32": Field.TYPE_UINT32,
    "bool": Field.TYPE_BOOL,
    "string": Field.TYPE_STRING,
}


def _file_of(kind: str) -> str:
    """Return the name of the file that declares a message with a full name."""
    known = {one.DESCRIPTOR.full_name: one.DESCRIPTOR.file.name for one in (Timestamp, Vector2)}
    return known.get(kind) or f"{kind.replace('.', '/')}.proto"


def _file_descriptor(name: str) -> descriptor_pb2.FileDescriptorProto:
    """Return the file of one message; each has its own file, so that a new one does not change the others.

    A field is declared as `NUMBER [optional | repeated] TYPE NAME`.
    """
    file = descriptor_pb2.FileDescriptorProto(name=_file_of(f"pushplan.{name}"), package="pushplan", syntax="proto3")
    message = file.message_type.add(name=name)
    for declaration in _MESSAGES[name]:
        number, *label, kind, title = declaration.split()
        field = message.field.add(name=title, number=int(number))
        field.label = Field.LABEL_REPEATED if label == ["repeated"] else Field.LABEL_OPTIONAL
        field.type = _SCALARS.get(kind, Field.TYPE_MESSAGE)
        if kind not in _SCALARS:
            field.type_name = f".{kind}"
            if _file_of(kind) not in file.dependency:
                file.dependency.append(_file_of(kind))
        if label == ["optional"]:  # proto3 stores the presence of a number in a separate oneof
            field.proto3_optional = True
            field.oneof_index = len(message.oneof_decl)
            message.oneof_decl.add(name=f"_{title}")
    return file


_POOL = descriptor_pool.Default()
for _name in _MESSAGES:  # messages stand behind those that they use
    _POOL.Add(_file_descriptor(_name))


def _message_class(name: str) -> MessageClass:
    return message_factory.GetMessageClass(_POOL.FindMessageTypeByName(f"pushplan.{name}"))


Margins = _message_class("Margins")
Progress = _message_class("Progress")
Costs = _message_class("Costs")
Plan = _message_class("Plan")
Segment = _message_class("Segment")
ExecutionEnd = _message_class("ExecutionEnd")

LEVELS = ("debug", "info", "warning", "error", "fatal")
"""Levels of a line on /log, least serious first, numbered from 1."""


@dataclass(frozen=True)
class Topic:
    """A channel of the log.

    Attributes:
        name: Name of the topic.
        message: Class of its messages.
        since: Revision that introduced the topic: `REVISION` plus 1 at that time. Logs of earlier ones lack it.
    """

    name: str
    message: MessageClass
    since: int = 0

    @property
    def kind(self) -> str:
        """Full name of the messages' type."""
        name: str = self.message.DESCRIPTOR.full_name
        return name

    @property
    def schema(self) -> bytes:
        """Declarations of the messages' type and its dependencies as a serialised FileDescriptorSet."""
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


def older(topic: Topic, schema: bytes) -> tuple[MessageClass | None, list[str]]:
    """Return the type of a topic's messages in an older log, and the names of the fields that it lacks.

    Older declarations are the current ones without some fields; for others the type is None.

    Args:
        topic: Current topic.
        schema: Declarations of the log, as in `Topic.schema`.
    """
    try:
        declared = descriptor_pb2.FileDescriptorSet.FromString(schema)
        ours = descriptor_pb2.FileDescriptorSet.FromString(topic.schema)
        known = {file.name: file for file in declared.file}
        missing: list[str] = []
        for file in list(ours.file):
            if file.name not in known:
                ours.file.remove(file)
                continue
            was = known[file.name]
            _without(file.dependency, set(was.dependency))
            for message, before in zip(file.message_type, was.message_type, strict=True):
                fields = {field.name for field in before.field}
                missing += [f"{message.name}.{field.name}" for field in message.field if field.name not in fields]
                _without(message.field, fields)
                _without(message.oneof_decl, {one.name for one in before.oneof_decl})
        if ours != declared:
            return None, []
        pool = descriptor_pool.DescriptorPool()
        for file in declared.file:
            pool.Add(file)
        return message_factory.GetMessageClass(pool.FindMessageTypeByName(topic.kind)), missing
    except (DecodeError, ValueError, TypeError, KeyError):
        return None, []


def _without(members: Any, kept: set[str]) -> None:
    """Remove all texts, or named declarations, that are not in `kept`."""
    for member in list(members):
        if (member if isinstance(member, str) else member.name) not in kept:
            members.remove(member)


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
MARGINS = Topic(MARGINS_TOPIC, Margins)
SEGMENT = Topic("/segment", Segment)
EXECUTION_END = Topic("/execution/result", ExecutionEnd)
LOG = Topic("/log", Log)
MEASURED = Topic("/measured", PosesInFrame)
EVENTS = Topic("/events", Log)
REPLANS = Topic("/plan/replans", Plan)


@cache
def signal_topic(signal: Signal) -> Topic:
    """Return the separate topic of a series; the fields of its message are the columns.

    Raises:
        TypeError: If another message has the same name.
    """
    name = signal.topic.rpartition("/")[2].title()
    if name in _MESSAGES:
        raise TypeError(f"series {signal.name!r}: its topic needs another name; a message {name} already exists")
    numbers = (f"{k} double {column}" for k, column in enumerate(signal.columns, 3))
    _MESSAGES[name] = (_STAMP, "2 string frame_id", *numbers)
    _POOL.Add(_file_descriptor(name))
    return Topic(signal.topic, _message_class(name), signal.since)


PUSHER_TWIST = signal_topic(SIGNALS[Execution]["twists"])

_SERIES = [signal_topic(signal) for signal in SIGNALS[Execution].values() if signal.frame]
TOPICS = tuple(dict.fromkeys([*(one for one in list(vars().values()) if isinstance(one, Topic)), *_SERIES]))
REVISION = max(
    [topic.since for topic in TOPICS] + [one.since for table in SIGNALS.values() for one in table.values()]
)
"""Revision of topics and series, which every log states."""
