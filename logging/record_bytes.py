"""The records of an MCAP file as bytes, field by field as https://mcap.dev/spec lists them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping

from pushplan.logging import opcodes

COMPRESSION = "zstd"


def record(opcode: int, *parts: bytes) -> bytes:
    """Return a record: its kind, its length, its content."""
    content = b"".join(parts)
    return struct.pack("<BQ", opcode, len(content)) + content


def text(words: str) -> bytes:
    """Return a string with its length."""
    return block(words.encode())


def block(data: bytes) -> bytes:
    """Return bytes with their length."""
    return struct.pack("<I", len(data)) + data


def header(library: str) -> bytes:
    """Return the header of a file without a profile."""
    return record(opcodes.HEADER, text(""), text(library))


def schema(number: int, name: str, data: bytes) -> bytes:
    """Return a schema of protobuf."""
    return record(opcodes.SCHEMA, struct.pack("<H", number), text(name), text("protobuf"), block(data))


def channel(number: int, schema: int, topic: str) -> bytes:
    """Return a channel of protobuf messages."""
    return record(
        opcodes.CHANNEL, struct.pack("<HH", number, schema), text(topic), text("protobuf"), block(b"")
    )


def chunk(times: tuple[int, int], data: bytes, compressed: bytes) -> bytes:
    """Return a chunk of the records `data`."""
    head = struct.pack("<QQQI", *times, len(data), zlib.crc32(data))
    return record(opcodes.CHUNK, head, text(COMPRESSION), struct.pack("<Q", len(compressed)), compressed)


def message_index(channel: int, entries: bytes) -> bytes:
    """Return the index of a channel's messages in a chunk; `entries` are pairs of time and place."""
    return record(opcodes.MESSAGE_INDEX, struct.pack("<H", channel), block(entries))


def chunk_index(
    times: tuple[int, int],
    place: tuple[int, int],
    indexes: Mapping[int, int],
    index_size: int,
    sizes: tuple[int, int],
) -> bytes:
    """Return the index of a chunk.

    Args:
        times: Of its first and last message.
        place: Where the chunk begins, and its length.
        indexes: Where the index of each channel begins.
        index_size: Bytes of all these.
        sizes: Of its content, compressed and not.
    """
    offsets = b"".join(struct.pack("<HQ", *pair) for pair in indexes.items())
    head = struct.pack("<QQQQ", *times, *place)
    tail = struct.pack("<QQ", *sizes)
    return record(
        opcodes.CHUNK_INDEX, head, block(offsets), struct.pack("<Q", index_size), text(COMPRESSION), tail
    )


def attachment(time: int, name: str, media_type: str, data: bytes) -> bytes:
    """Return an attachment with its checksum."""
    size = struct.pack("<Q", len(data))
    content = b"".join([struct.pack("<QQ", time, time), text(name), text(media_type), size, data])
    return record(opcodes.ATTACHMENT, content, struct.pack("<I", zlib.crc32(content)))


def attachment_index(place: tuple[int, int], time: int, name: str, media_type: str, size: int) -> bytes:
    """Return the index of an attachment of `size` bytes."""
    return record(
        opcodes.ATTACHMENT_INDEX, struct.pack("<5Q", *place, time, time, size), text(name), text(media_type)
    )


def metadata(name: str, words: Mapping[str, str]) -> bytes:
    """Return words under a name."""
    return record(
        opcodes.METADATA, text(name), block(b"".join(text(key) + text(value) for key, value in words.items()))
    )


def metadata_index(place: tuple[int, int], name: str) -> bytes:
    """Return the index of metadata."""
    return record(opcodes.METADATA_INDEX, struct.pack("<QQ", *place), text(name))


def statistics(
    messages: Mapping[int, int], others: tuple[int, int, int, int, int], times: tuple[int, int]
) -> bytes:
    """Return the numbers of records in a file.

    Args:
        messages: By channel.
        others: Schemas, channels, attachments, metadata, chunks.
        times: Of the first and last message.
    """
    head = struct.pack("<QHIIII", sum(messages.values()), *others)
    counts = b"".join(struct.pack("<HQ", *pair) for pair in messages.items())
    return record(opcodes.STATISTICS, head, struct.pack("<QQ", *times), block(counts))


def footer(begin: int, offsets: int, summary: bytes) -> bytes:
    """Return the footer behind a summary that begins at `begin`, with its offsets at `offsets`."""
    covered = struct.pack("<BQQQ", opcodes.FOOTER, 20, begin, offsets)
    return covered + struct.pack("<I", zlib.crc32(covered, zlib.crc32(summary)))
