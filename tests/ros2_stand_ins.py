"""Stand-ins for the imports of a ROS 2 node, because ROS 2 cannot be installed from a package index.

Messages are generated from the definitions of ROS 2 Humble in rosbags. They have the fields and defaults of generated
messages and refuse other fields; rosbags serialises them and checks the types of all values.
"""

import math
import sys
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest


class Messages:
    """Message classes, and the messages that the node publishes."""

    def __init__(self) -> None:
        typesys = pytest.importorskip("rosbags.typesys")
        self.store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        self.published: dict[str, list[Any]] = {}

    def __call__(self, name: str, **fields: Any) -> Any:
        """Return a message with its defaults and some given fields."""
        values = {field: self._default(kind) for field, kind in self.store.get_msgdef(name).fields}
        assert set(fields) <= set(values), f"{name} has no {set(fields) - set(values)}"
        return SimpleNamespace(**values | fields, type_name=name)

    def _default(self, kind: tuple[Any, ...]) -> Any:
        code, what = int(kind[0]), kind[1]
        if code == 2:
            return self(what)
        if code == 1:
            return {"string": "", "bool": False}.get(what[0], 0.0 if what[0].startswith("float") else 0)
        return []

    def frozen(self, message: Any) -> Any:
        """Return a message as a type of rosbags, with all nested messages."""
        if isinstance(message, list):
            return [self.frozen(member) for member in message]
        if not isinstance(message, SimpleNamespace):
            return message
        known = self.store.types[message.type_name]
        fields = {key: self.frozen(value) for key, value in vars(message).items() if key != "type_name"}
        return known(**fields)

    def sent(self, topic: str) -> list[Any]:
        """Return the messages of a topic after serialisation and deserialisation."""
        found = []
        for message in self.published[topic]:
            name = message.type_name
            data = self.store.serialize_cdr(self.frozen(message), name)
            found.append(self.store.deserialize_cdr(data, name))
        return found


class Robot:
    """A unicycle that follows the last twist, with a tf of its pose."""

    def __init__(self, pose: np.ndarray[Any, np.dtype[np.float64]]) -> None:
        self.pose, self.lost = np.array(pose), False

    def lookup_transform(self, target: str, source: str, time: object) -> Any:
        assert (target, source) == ("map", "base_link")
        if self.lost:
            raise TransformError("no transform")
        x, y, theta = self.pose.tolist()
        rotation = SimpleNamespace(z=math.sin(0.5 * theta), w=math.cos(0.5 * theta))
        return SimpleNamespace(transform=SimpleNamespace(translation=SimpleNamespace(x=x, y=y), rotation=rotation))


class TransformError(Exception):
    """Error of a missing transform."""


def install(monkeypatch: pytest.MonkeyPatch, messages: Messages, robot: Robot) -> SimpleNamespace:
    """Install the modules; return the node's timer and its log."""
    told = SimpleNamespace(lines=[], running=True, step=None)

    def publisher(kind: Any, topic: str, qos: object) -> Any:
        sent = messages.published.setdefault(topic, [])
        return SimpleNamespace(publish=lambda message: sent.append(message))

    class Node:
        def __init__(self, name: str) -> None:
            self.create_publisher = publisher

        def create_timer(self, period: float, step: Callable[[], None]) -> Any:
            told.step, told.period = step, period
            return SimpleNamespace(cancel=lambda: setattr(told, "running", False))

        def get_clock(self) -> Any:
            stamp = messages("builtin_interfaces/msg/Time", sec=7)
            return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: stamp))

        def get_logger(self) -> Any:
            def tell(text: str, throttle_duration_sec: float = 0.0) -> None:
                told.lines.append(text)

            return SimpleNamespace(info=tell, warning=tell)

    class Kinds(ModuleType):
        def __getattr__(self, name: str) -> Callable[..., Any]:
            return lambda **fields: messages(f"{self.__name__.replace('.', '/')}/{name}", **fields)

    names = ("rclpy", "rclpy.node", "rclpy.qos", "rclpy.time", "tf2_ros", "geometry_msgs", "nav_msgs")
    modules: dict[str, Any] = {name: MagicMock() for name in names}
    modules |= {name: Kinds(name) for name in ("geometry_msgs.msg", "nav_msgs.msg")}
    modules["rclpy.node"].Node, modules["tf2_ros"].Buffer = Node, lambda: robot
    modules["tf2_ros"].TransformException = TransformError
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    return told
