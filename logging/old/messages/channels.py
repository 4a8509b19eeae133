"""The channels of a run log in the making: messages in, records of an MCAP file out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp

from pushplan.errors import RunLogError
from pushplan.logging.mcap_file import mcap_writer
from pushplan.logging.old.message_template import ByteRows
from pushplan.logging.old.messages.metadata import version_of
from pushplan.logging.old.messages.schemas import TOPICS, MessageClass, Topic
from pushplan.logging.old.messages.seal import sealed
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.files import Output

_NANO = 1_000_000_000
_LATEST = 1 << 33
"""Simulated time has to be before this, s."""


@dataclass(frozen=True)
class Batch:
    """Messages of several channels at the same times: rows of bytes by channel, and the times (n,), ns."""

    rows: Mapping[int, ByteRows]
    times: IntArray


class Channels:
    """Writes messages on all `TOPICS` to a file; the time stands still or goes on, but never back.

    Attributes:
        began: When the run began that is being written, ns: simulated times of a run begin at 0, those of a log that
            holds several runs go on.
    """

    def __init__(self, file: Output, began: int = 0) -> None:
        self._file = file
        self._writer = mcap_writer(file, f"pushplan {version_of('pushplan')}")
        self._sequence: Counter[int] = Counter()
        self._now = self.began = began
        self._channels: dict[Topic, int] = {}

    def declare(self) -> None:
        """Write the schemas and channels."""
        schemas: dict[str, int] = {}
        for topic in TOPICS:
            if topic.kind not in schemas:
                schemas[topic.kind] = self._writer.register_schema(topic.kind, "protobuf", topic.schema)
            self._channels[topic] = self._writer.register_channel(topic.name, "protobuf", schemas[topic.kind])

    def begin_run(self) -> None:
        """Let a run begin now."""
        self.began = self._now

    def instants(self, times: FloatArray) -> IntArray:
        """Return simulated times (n,) of the run, s, of messages to come, in ns of the log.

        Raises:
            RunLogError: When one is before the last, or not a number: such a time would spoil the file.
        """
        before = np.append((self._now - self.began) / _NANO, times[:-1])
        wrong = np.flatnonzero(~((times >= before) & (times < _LATEST)))
        if len(wrong):
            time, last = times[wrong[0]], before[wrong[0]]
            raise RunLogError(str(self._file.path), f"time {time} s cannot follow {last} s")
        return self.began + np.rint(times * _NANO).astype(np.int64)

    @property
    def stamp(self) -> Timestamp:
        """The simulated time of the messages to come."""
        return Timestamp(seconds=self._now // _NANO, nanos=self._now % _NANO)

    def send(self, topic: Topic, message: MessageClass | bytes) -> None:
        """Write `message` at the current simulated time."""
        data = message if isinstance(message, bytes) else message.SerializeToString(deterministic=True)
        self._add(self._channels[topic], self._now, data)

    def _add(self, channel: int, time: int, data: bytes) -> None:
        self._writer.add_message(channel, time, data, time, self._sequence[channel])
        self._sequence[channel] += 1

    def send_stamped(self, topic: Topic, message: MessageClass) -> None:
        """Write `message` with the current simulated time in its field `timestamp`."""
        message.timestamp.CopyFrom(self.stamp)
        self.send(topic, message)

    def prepare(self, rows: Mapping[Topic, ByteRows], instants: IntArray) -> Batch:
        """Return messages of several topics at each of the `instants` (n,), ns, for `send_batch`.

        Args:
            rows: (n, bytes) for each topic; nothing else may be sent on them before all of these are.
            instants: As `instants` returned them.
        """
        return Batch({self._channels[topic]: data for topic, data in rows.items()}, instants)

    def send_batch(self, batch: Batch, begin: int = 0, end: int | None = None) -> None:
        """Write the messages at the instants from `begin` to `end`, excluded."""
        for k in range(begin, len(batch.times) if end is None else end):
            for channel, rows in batch.rows.items():
                self._add(channel, int(batch.times[k]), rows[k].tobytes())

    def advance(self, instant: int) -> None:
        """Set the simulated time, ns, for the messages to come."""
        self._now = instant

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment."""
        self._writer.add_attachment(self._now, self._now, name, media_type, data)

    def note(self, name: str, words: Mapping[str, str]) -> None:
        """Write metadata."""
        self._writer.add_metadata(name, dict(sealed(words)))

    def flush(self) -> None:
        """Hand everything written so far to the operating system, where a killed process cannot lose it."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self) -> None:
        """Write the end of the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
