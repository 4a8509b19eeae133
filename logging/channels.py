"""The channels of a run log in the making: messages in, records of an MCAP file out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib.metadata import version

from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import build_file_descriptor_set

from pushplan.errors import RunLogError
from pushplan.logging.metadata import sealed
from pushplan.logging.partial_file import PartialFile
from pushplan.logging.schemas import TOPICS, MessageClass, Topic

CHUNK_SIZE = 256 << 10
"""A chunk is written when it has grown so large, bytes; until then its messages exist in memory only."""

_NANO = 1_000_000_000


class Channels:
    """Writes messages on all `TOPICS` to a file; the time stands still or goes on, but never back."""

    def __init__(self, file: PartialFile) -> None:
        self._file = file
        self._writer = Writer(file, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._writer.start(profile="", library=f"pushplan {version('pushplan')}; mcap {version('mcap')}")
        self._sequence = dict.fromkeys(TOPICS, 0)
        self._now = 0
        self._channels: dict[Topic, int] = {}

    def declare(self) -> None:
        """Write the schemas and channels."""
        schemas: dict[str, int] = {}
        for topic in TOPICS:
            name = topic.message.DESCRIPTOR.full_name
            if name not in schemas:
                data = build_file_descriptor_set(topic.message).SerializeToString()
                schemas[name] = self._writer.register_schema(name, "protobuf", data)
            self._channels[topic] = self._writer.register_channel(topic.name, "protobuf", schemas[name])

    def advance(self, time: float) -> Timestamp:
        """Set the simulated time, s, for the messages to come and return it as a time stamp.

        Raises:
            RunLogError: When it is before the last one, or not a number: such a time would spoil the file.
        """
        nanoseconds = round(time * _NANO) if math.isfinite(time) else -1
        if not self._now <= nanoseconds < 1 << 63:
            raise RunLogError(str(self._file.final), f"time {time} s cannot follow {self._now / _NANO} s")
        self._now = nanoseconds
        return self.stamp

    @property
    def stamp(self) -> Timestamp:
        """The simulated time of the messages to come."""
        return Timestamp(seconds=self._now // _NANO, nanos=self._now % _NANO)

    def send(self, topic: Topic, message: MessageClass) -> None:
        """Write `message` at the current simulated time."""
        self._writer.add_message(
            channel_id=self._channels[topic],
            log_time=self._now,
            publish_time=self._now,
            sequence=self._sequence[topic],
            data=message.SerializeToString(deterministic=True),
        )
        self._sequence[topic] += 1

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment."""
        self._writer.add_attachment(self._now, self._now, name, media_type, data)

    def note(self, name: str, words: Mapping[str, str]) -> None:
        """Write metadata."""
        self._writer.add_metadata(name, sealed(words))

    def flush(self) -> None:
        """Hand everything written so far to the operating system, where a killed process cannot lose it."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self) -> None:
        """Write the end of the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
