"""The MCAP file of a bag in the making: CDR messages, stamped from an epoch on."""

from __future__ import annotations

import io
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from mcap.writer import CompressionType, Writer

from pushplan.logging.export.bag import messages
from pushplan.logging.export.bag.cdr import encode

_NANO = 1_000_000_000

_VOLATILE, _LATCHED = 2, 1
"""Values of a durability in a QoS profile: only for those who listen, also for those who come later."""


class BagFile:
    """Writes messages of ROS 2; fields called `stamp` in headers need not be filled in.

    Args:
        stream: Where to.
        epoch: What 0 simulated seconds are in ROS time, ns.
    """

    def __init__(self, stream: io.BytesIO, epoch: int) -> None:
        self._epoch = epoch
        self._writer = Writer(stream, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library=f"pushplan {version('pushplan')}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def send(
        self, topic: str, kind: str, time: float, message: Mapping[str, Any], latched: bool = False
    ) -> None:
        """Write a message at a simulated time, s; one that is `latched` is also for those who come later."""
        if kind not in self._schemas:
            data = messages.definition(kind).encode()
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", data)
        if topic not in self._channels:
            quality = {"offered_qos_profiles": _quality(_LATCHED if latched else _VOLATILE)}
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind], quality)
        stamp = self._epoch + round(_NANO * time)
        self._writer.add_message(self._channels[topic], stamp, encode(kind, _stamped(message, stamp)), stamp)

    def finish(self) -> None:
        """Write the end of the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]


def _stamped(message: Any, stamp: int) -> Any:
    """Return a message with `stamp`, ns, in all its headers."""
    if isinstance(message, list):
        return [_stamped(part, stamp) for part in message]
    if not isinstance(message, Mapping):
        return message
    filled = {key: _stamped(part, stamp) for key, part in message.items() if key != "points"}
    if "frame_id" in message or "msg" in message:
        filled["stamp"] = {"sec": stamp // _NANO, "nanosec": stamp % _NANO}
    return {**message, **filled}


def _quality(durability: int) -> str:
    """A QoS profile as bags hold it: YAML, enumerations as numbers, reliable, the last 10 messages kept."""
    never = "{sec: 9223372036, nsec: 854775807}"
    return (
        f"- {{history: 1, depth: 10, reliability: 1, durability: {durability}, deadline: {never}, "
        f"lifespan: {never}, liveliness: 1, liveliness_lease_duration: {never}, "
        "avoid_ros_namespace_conventions: false}"
    )
