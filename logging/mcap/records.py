"""The records of an MCAP file, read in file order, within bounds, and checked before anyone sees them.

Nothing in the file is trusted: no length beyond the file or `RECORD_LIMIT`, no claim of a compressed frame,
no index. Checksums of chunks, attachments and the summary are compared. The format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple

from pushplan.logging.mcap.budget import RECORD_LIMIT, Budget
from pushplan.logging.mcap.cursor import Cursor, DamageError
from pushplan.logging.mcap.inflate import inflate
from pushplan.logging.mcap.opcodes import CHANNEL, FOOTER, MAGIC, MESSAGE, PREFIX, SCHEMA

_PREFIX = struct.Struct("<BQ")

_MESSAGE = struct.Struct("<BQHIQQ")
"""A record's kind and length, and of a message: channel, number, time of the log, time of publication."""

_IN_CHUNKS = (MESSAGE, SCHEMA, CHANNEL)

_HEAD_SIZE = _MESSAGE.size - _PREFIX.size


class Frame(NamedTuple):
    """A record as it lies in the file: its kind, where it begins, and its content."""

    opcode: int
    offset: int
    body: memoryview

    @property
    def cursor(self) -> Cursor:
        """A cursor at the beginning of the content."""
        return Cursor(self.body, self.offset + PREFIX)


def frames(stream: BinaryIO, size: int, begin: int = 0) -> Iterator[Frame]:
    """Yield the records of a file of `size` bytes up to its footer; chunks are yielded whole.

    Args:
        stream: The file.
        size: Of it.
        begin: 0, or where a record begins.

    Raises:
        DamageError: Where the file is not MCAP, is cut short, or goes on behind its end.
    """
    stream.seek(begin)
    if begin == 0 and stream.read(len(MAGIC)) != MAGIC:
        raise DamageError("not an MCAP file", 0)
    opcode = 0
    while opcode != FOOTER:
        frame = next_frame(stream, size)
        opcode = frame.opcode
        yield frame
    at = stream.tell()
    if stream.read(len(MAGIC)) != MAGIC or stream.tell() != size:
        raise DamageError("the file does not end where its footer says", at)


def next_frame(stream: BinaryIO, size: int) -> Frame:
    """Return the record at which `stream` stands, in a file of `size` bytes.

    Raises:
        DamageError: When it is cut short or too large.
    """
    at = stream.tell()
    prefix = stream.read(PREFIX)
    if not prefix:
        raise DamageError("the file ends here, without a footer", at)
    if len(prefix) < PREFIX:
        raise DamageError("the file ends inside a record", at)
    opcode, length = _PREFIX.unpack(prefix)
    if length > RECORD_LIMIT:
        raise DamageError(f"a record claims {length} bytes; at most {RECORD_LIMIT} are allowed", at)
    body = stream.read(length) if length <= size - at - PREFIX else b""
    if len(body) < length:
        raise DamageError("the file ends inside a record", at)
    return Frame(opcode, at, memoryview(body))


def inflated(chunk: Frame, budget: Budget) -> memoryview:
    """Return the records in `chunk`, one after another.

    Raises:
        DamageError: When it is damaged, larger than allowed, or its checksum does not fit.
    """
    cursor = chunk.cursor
    cursor.take(16)  # times of the first and last message: an index, not trusted
    size, checksum = cursor.number("Q"), cursor.number("I")
    if size > RECORD_LIMIT:
        raise DamageError(f"a chunk claims {size} bytes; at most {RECORD_LIMIT} are allowed", chunk.offset)
    budget.chunk(size, chunk.offset)
    compression = cursor.text()
    data = cursor.take(cursor.number("Q"))
    try:
        records = inflate(data, compression, size)
    except ValueError as error:
        raise DamageError(str(error), chunk.offset) from error
    if checksum and zlib.crc32(records) != checksum:
        raise DamageError("the checksum of a chunk does not fit", chunk.offset)
    return records


@dataclass
class Unwanted:
    """The channels whose messages are passed over, and how many were: hundreds of thousands in a long log."""

    channels: set[int]
    passed: int = 0


def chunk_frames(data: memoryview, offset: int, budget: Budget, unwanted: Unwanted) -> Iterator[Frame]:
    """Yield the schemas, channels and messages in the chunk at `offset`; other kinds mean nothing there.

    Args:
        data: What `inflated` returned.
        offset: Where the chunk begins in the file; the offset of its records.
        budget: Of the file.
        unwanted: What is passed over; may grow while the records are taken.

    Raises:
        DamageError: When a record is cut, or there are too many.
    """
    at, count, size, most = 0, 0, len(data), budget.records
    unpack, channels = _MESSAGE.unpack_from, unwanted.channels
    while at < size and count <= most:
        count += 1
        if at + _MESSAGE.size <= size:
            opcode, length, channel, *_ = unpack(data, at)
        else:  # too near to the end for a message
            opcode, length = _PREFIX.unpack_from(data, at) if at + PREFIX <= size else (0, size)
            channel = -1
        begin = at + PREFIX
        at = begin + length
        if at > size:
            raise DamageError("a chunk ends inside a record", offset)
        if opcode == MESSAGE and channel in channels and length >= _HEAD_SIZE:
            unwanted.passed += 1
        elif opcode in _IN_CHUNKS:
            yield Frame(opcode, offset, data[begin:at])
    budget.inner_records(count, offset)


def attachment(frame: Frame) -> tuple[str, bytes]:
    """Return name and content of an attachment.

    Raises:
        DamageError: When it is damaged or its checksum does not fit.
    """
    cursor = frame.cursor
    cursor.take(16)  # two times
    name = cursor.text()
    cursor.text()  # media type
    content = cursor.take(cursor.number("Q"))
    covered = len(frame.body) - cursor.left
    checksum = cursor.number("I")
    if checksum and zlib.crc32(frame.body[:covered]) != checksum:
        raise DamageError(f"the checksum of attachment {name!r} does not fit", frame.offset)
    return name, bytes(content)
