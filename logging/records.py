"""The records of an MCAP file, read in file order, within bounds, and checked before anyone sees them.

Nothing in the file is trusted: no length beyond the file or `RECORD_LIMIT`, no claim of a compressed frame,
no index. Checksums of chunks, attachments and the summary are compared. The format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from pushplan.logging.cursor import Cursor, DamageError
from pushplan.logging.inflate import inflate
from pushplan.logging.opcodes import FOOTER, MAGIC, PREFIX

_PREFIX = struct.Struct("<BQ")

RECORD_LIMIT = 16 << 20
"""Largest record and largest chunk once inflated, bytes; the writer's own stay below 1 MiB."""

TOTAL_LIMIT = 2 << 30
"""Most bytes that all chunks of a file may inflate to."""

_FREE_BYTES, _INFLATION = 64 << 20, 300
"""A file of s bytes may inflate to 64 MiB + 300 s bytes ..."""

_FREE_RECORDS, _BYTES_PER_RECORD = 10_000, 20
"""... and hold 10,000 + s/20 records (a message's entry in an index takes 16 bytes already), so that reading
takes time in proportion to the size."""


class Frame(NamedTuple):
    """A record as it lies in the file: its kind, where it begins, and its content."""

    opcode: int
    offset: int
    body: memoryview

    @property
    def cursor(self) -> Cursor:
        """A cursor at the beginning of the content."""
        return Cursor(self.body, self.offset + PREFIX)


def frames(stream: BinaryIO, size: int) -> Iterator[Frame]:
    """Yield the records of a file of `size` bytes up to its footer; chunks are yielded whole.

    Raises:
        DamageError: Where the file is not MCAP, is cut short, or goes on behind its end.
    """
    if stream.read(len(MAGIC)) != MAGIC:
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


class Budget:
    """What is left of the records and inflated bytes that a file of `size` bytes may have."""

    def __init__(self, size: int) -> None:
        self._records = _FREE_RECORDS + size // _BYTES_PER_RECORD
        self._bytes = min(TOTAL_LIMIT, _FREE_BYTES + _INFLATION * size)

    def spend(self, records: int, size: int, offset: int) -> None:
        """Take `records` and `size` bytes for what begins at `offset`.

        Raises:
            DamageError: When that is more than is left.
        """
        self._records -= records
        self._bytes -= size
        if self._records < 0 or self._bytes < 0:
            raise DamageError("the file holds far more data than its size allows", offset)


def chunk_frames(chunk: Frame, budget: Budget) -> list[Frame]:
    """Return the records in `chunk`, each with the offset of the chunk.

    Raises:
        DamageError: When it is damaged, larger than allowed, or its checksum does not fit.
    """
    cursor = chunk.cursor
    cursor.take(16)  # times of the first and last message: an index, not trusted
    size, checksum = cursor.number("Q"), cursor.number("I")
    if size > RECORD_LIMIT:
        raise DamageError(f"a chunk claims {size} bytes; at most {RECORD_LIMIT} are allowed", chunk.offset)
    budget.spend(0, size, chunk.offset)
    compression = cursor.text()
    data = cursor.take(cursor.number("Q"))
    try:
        inflated = inflate(data, compression, size)
    except ValueError as error:
        raise DamageError(str(error), chunk.offset) from error
    if checksum and zlib.crc32(inflated) != checksum:
        raise DamageError("the checksum of a chunk does not fit", chunk.offset)
    return list(_split(inflated, chunk.offset, budget))


def _split(data: memoryview, offset: int, budget: Budget) -> Iterator[Frame]:
    at = 0
    while at < len(data):
        budget.spend(1, 0, offset)
        begin = at + PREFIX
        opcode, length = _PREFIX.unpack_from(data, at) if begin <= len(data) else (0, len(data))
        at = begin + length
        if at > len(data):
            raise DamageError("a chunk ends inside a record", offset)
        yield Frame(opcode, offset, data[begin:at])


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
