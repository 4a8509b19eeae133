"""Writes an MCAP file: messages in compressed chunks with an index, and a summary at the end.

Messages that come in hundreds are taken as one block of bytes, for which the `mcap` package's own writer has no
door: a call for every number of every message would cost more than planning a short push.
"""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from collections.abc import Mapping

import numpy as np
import zstandard

from pushplan.arrays import IntArray
from pushplan.logging import message_head, opcodes, record_bytes
from pushplan.logging.batch import Batch
from pushplan.logging.partial_file import PartialFile
from pushplan.logging.stencil import ByteRows

CHUNK_SIZE = 256 << 10
"""A chunk is written when it has grown so large, bytes; until then its messages exist in memory only."""

_ENTRY = struct.Struct("<QQ")


class RecordWriter:
    """Writes records to a file; the times of messages never go back."""

    def __init__(self, file: PartialFile, library: str) -> None:
        self._file = file
        self._compressor = zstandard.ZstdCompressor()
        self._chunk = bytearray()
        self._times: list[int] = []
        self._index: dict[int, list[bytes]] = defaultdict(list)
        self._messages: Counter[int] = Counter()
        self._span: list[int] = []
        self._declared: dict[int, list[bytes]] = {opcodes.SCHEMA: [], opcodes.CHANNEL: []}
        self._indexes: dict[int, list[bytes]] = {
            opcode: [] for opcode in (opcodes.CHUNK_INDEX, opcodes.ATTACHMENT_INDEX, opcodes.METADATA_INDEX)
        }
        file.write(opcodes.MAGIC + record_bytes.header(library))

    def add_schema(self, name: str, data: bytes) -> int:
        """Declare a protobuf schema and return its number."""
        schemas = self._declared[opcodes.SCHEMA]
        schemas.append(record_bytes.schema(len(schemas) + 1, name, data))
        self._chunk += schemas[-1]
        return len(schemas)

    def add_channel(self, topic: str, schema: int) -> int:
        """Declare a channel and return its number."""
        channels = self._declared[opcodes.CHANNEL]
        channels.append(record_bytes.channel(len(channels) + 1, schema, topic))
        self._chunk += channels[-1]
        return len(channels)

    def add_message(self, channel: int, time: int, data: bytes) -> None:
        """Write a message."""
        self._index[channel].append(_ENTRY.pack(time, len(self._chunk)))
        self._chunk += message_head.packed(channel, self._messages[channel], time, len(data))
        self._chunk += data
        self._messages[channel] += 1
        self._note(time, time)

    def prepare(self, rows: Mapping[int, ByteRows], times: IntArray) -> Batch:
        """Return messages of each channel at each of the times (n,), to be written bit by bit.

        Args:
            rows: (n, bytes) messages by channel; these channels get no others before all of them are written.
            times: Nanoseconds, in order.
        """
        return Batch.from_messages(
            {(channel, self._messages[channel]): rows[channel] for channel in rows}, times
        )

    def add_batch(self, batch: Batch, begin: int, end: int) -> None:
        """Write the messages of a batch at its times from `begin` to `end`, excluded."""
        if begin == end:
            return
        shift = np.array([0, len(self._chunk) - begin * batch.records.shape[1]]).astype("<u8")
        for channel, entries in batch.entries.items():
            self._index[channel].append((entries[begin:end] + shift).tobytes())
            self._messages[channel] += end - begin
        self._chunk += batch.records[begin:end].tobytes()
        self._note(int(batch.times[begin]), int(batch.times[end - 1]))

    def _note(self, first: int, last: int) -> None:
        self._times = [*(self._times[:1] or [first]), last]
        if len(self._chunk) > CHUNK_SIZE:
            self.flush()

    def add_attachment(self, time: int, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment."""
        place = self._write(record_bytes.attachment(time, name, media_type, data))
        index = record_bytes.attachment_index(place, time, name, media_type, len(data))
        self._indexes[opcodes.ATTACHMENT_INDEX].append(index)

    def add_metadata(self, name: str, words: Mapping[str, str]) -> None:
        """Write metadata."""
        place = self._write(record_bytes.metadata(name, words))
        self._indexes[opcodes.METADATA_INDEX].append(record_bytes.metadata_index(place, name))

    def _write(self, record: bytes) -> tuple[int, int]:
        """Write a record and return where it begins, and its length."""
        begin = self._file.tell()
        self._file.write(record)
        return begin, len(record)

    def flush(self) -> None:
        """Write the chunk in progress, if it holds a message."""
        if not self._times:
            return
        times, data = (self._times[0], self._times[-1]), bytes(self._chunk)
        compressed = self._compressor.compress(data)
        chunk = record_bytes.chunk(times, data, compressed)
        begin, places, indexes = self._file.tell(), {}, b""
        for channel, entries in self._index.items():
            places[channel] = begin + len(chunk) + len(indexes)
            indexes += record_bytes.message_index(channel, b"".join(entries))
        self._file.write(chunk + indexes)
        index = record_bytes.chunk_index(
            times, (begin, len(chunk)), places, len(indexes), (len(compressed), len(data))
        )
        self._indexes[opcodes.CHUNK_INDEX].append(index)
        self._span = [*(self._span[:1] or times[:1]), times[1]]
        self._chunk.clear()
        self._index.clear()
        self._times = []

    def finish(self) -> None:
        """Write the end of the file."""
        self.flush()
        self._file.write(record_bytes.record(opcodes.DATA_END, bytes(4)))
        begin = self._file.tell()
        groups = {**self._declared, opcodes.STATISTICS: [self._statistics()], **self._indexes}
        summary, offsets = b"", b""
        for opcode, records in groups.items():
            group = b"".join(records)
            place = struct.pack("<BQQ", opcode, begin + len(summary), len(group))
            offsets += record_bytes.record(opcodes.SUMMARY_OFFSET, place)
            summary += group
        end = record_bytes.footer(begin, begin + len(summary), summary + offsets)
        self._file.write(summary + offsets + end + opcodes.MAGIC)

    def _statistics(self) -> bytes:
        schemas, channels = map(len, self._declared.values())
        chunks, attachments, metadata = map(len, self._indexes.values())
        span = (self._span[0], self._span[-1]) if self._span else (0, 0)
        return record_bytes.statistics(
            self._messages, (schemas, channels, attachments, metadata, chunks), span
        )
