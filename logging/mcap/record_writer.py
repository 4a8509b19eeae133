"""Writes an MCAP file: messages in compressed chunks with an index, and a summary at the end.

The records are the `mcap` package's. Its own writer has no door for the hundreds of messages that come as one block
of bytes: its call for every number of a message, 13 us in all, doubles the time that the log of a run takes.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter, defaultdict
from collections.abc import Mapping

import numpy as np
import zstandard

from mcap import records
from mcap.data_stream import RecordBuilder
from pushplan.logging.mcap import message_head, opcodes
from pushplan.logging.mcap.batch import Batch
from pushplan.logging.mcap.message_template import ByteRows
from pushplan.util.arrays import IntArray
from pushplan.util.outputs.open_file import OpenFile

CHUNK_SIZE = 256 << 10
"""A chunk is written when it has grown so large, bytes; until then its messages exist in memory only."""

_COMPRESSION, _ENCODING = "zstd", "protobuf"
_ENTRY = struct.Struct("<QQ")
_INDEX_HEAD = struct.Struct("<BQHI")


def encoded(record: records.McapRecord) -> bytes:
    """Return a record as it lies in the file."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


class RecordWriter:
    """Writes records to a file; the times of messages never go back."""

    def __init__(self, file: OpenFile, library: str) -> None:
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
        file.write(opcodes.MAGIC + encoded(records.Header("", library)))

    def add_schema(self, name: str, data: bytes) -> int:
        """Declare a protobuf schema and return its number."""
        number = len(self._declared[opcodes.SCHEMA]) + 1
        return self._declare(opcodes.SCHEMA, records.Schema(number, data, _ENCODING, name))

    def add_channel(self, topic: str, schema: int) -> int:
        """Declare a channel and return its number."""
        number = len(self._declared[opcodes.CHANNEL]) + 1
        return self._declare(opcodes.CHANNEL, records.Channel(number, topic, _ENCODING, {}, schema))

    def _declare(self, opcode: int, record: records.Schema | records.Channel) -> int:
        self._declared[opcode].append(encoded(record))
        self._chunk += self._declared[opcode][-1]
        return record.id

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
        place = self._write(encoded(records.Attachment(time, time, name, media_type, data)))
        index = records.AttachmentIndex(*place, time, time, len(data), name, media_type)
        self._indexes[opcodes.ATTACHMENT_INDEX].append(encoded(index))

    def add_metadata(self, name: str, words: Mapping[str, str]) -> None:
        """Write metadata."""
        place = self._write(encoded(records.Metadata(name, dict(words))))
        self._indexes[opcodes.METADATA_INDEX].append(encoded(records.MetadataIndex(*place, name)))

    def _write(self, record: bytes) -> tuple[int, int]:
        """Write a record and return where it begins, and its length."""
        begin = self._file.tell()
        self._file.write(record)
        return begin, len(record)

    def flush(self) -> None:
        """Write the chunk in progress, if it holds a message."""
        if not self._times:
            return
        first, last = self._times[0], self._times[-1]
        compressed = self._compressor.compress(self._chunk)
        size = len(self._chunk)
        chunk = encoded(records.Chunk(_COMPRESSION, compressed, last, first, zlib.crc32(self._chunk), size))
        begin, places, indexes = self._file.tell(), {}, b""
        for channel, entries in self._index.items():
            places[channel] = begin + len(chunk) + len(indexes)
            indexes += _message_index(channel, b"".join(entries))
        self._file.write(chunk + indexes)
        index = records.ChunkIndex(
            chunk_length=len(chunk),
            chunk_start_offset=begin,
            compression=_COMPRESSION,
            compressed_size=len(compressed),
            message_end_time=last,
            message_index_length=len(indexes),
            message_index_offsets=places,
            message_start_time=first,
            uncompressed_size=size,
        )
        self._indexes[opcodes.CHUNK_INDEX].append(encoded(index))
        self._span = [*(self._span[:1] or [first]), last]
        self._chunk.clear()
        self._index.clear()
        self._times = []

    def finish(self) -> None:
        """Write the end of the file."""
        self.flush()
        self._file.write(encoded(records.DataEnd(0)))
        begin = self._file.tell()
        groups = {**self._declared, opcodes.STATISTICS: [self._statistics()], **self._indexes}
        summary, offsets = b"", b""
        for opcode, members in groups.items():
            group = b"".join(members)
            offsets += encoded(records.SummaryOffset(opcode, begin + len(summary), len(group)))
            summary += group
        end = encoded(records.Footer(begin, begin + len(summary), 0))[:-4]  # what its own checksum covers
        checksum = zlib.crc32(end, zlib.crc32(summary + offsets))
        self._file.write(summary + offsets + end + struct.pack("<I", checksum) + opcodes.MAGIC)

    def _statistics(self) -> bytes:
        schemas, channels = map(len, self._declared.values())
        chunks, attachments, metadata = map(len, self._indexes.values())
        return encoded(
            records.Statistics(
                attachment_count=attachments,
                channel_count=channels,
                channel_message_counts=self._messages,
                chunk_count=chunks,
                message_count=self._messages.total(),
                message_end_time=self._span[-1] if self._span else 0,
                message_start_time=self._span[0] if self._span else 0,
                metadata_count=metadata,
                schema_count=schemas,
            )
        )


def _message_index(channel: int, entries: bytes) -> bytes:
    """Return the index of a channel's messages in a chunk; `entries` are pairs of time and place."""
    return _INDEX_HEAD.pack(opcodes.MESSAGE_INDEX, 6 + len(entries), channel, len(entries)) + entries
