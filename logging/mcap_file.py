"""MCAP files: the library's writer, and a sequential reader that does not trust the file.

The reader never inflates more than a chunk claims, nor a record beyond the limits below. It checks the checksums of
chunks, attachments and summary, and the counts of the summary; it does not use the indexes. Every defect ends in one
typed error with the byte offset. A truncated file is read up to its last whole record. A file below 100 MB takes less
than 500 MB of memory and 10 s of processor time. The format: https://mcap.dev/spec.
"""

from __future__ import annotations

import os
import stat
import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO, Any, BinaryIO, NamedTuple, cast

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.writer import Writer

from pushplan.errors import RunLogError
from pushplan.util.files import Output

MAGIC = b"\x89MCAP0\r\n"

NO_LOG = "not an MCAP file; this command reads logs, `pushplan plan` and `check` read scenarios"

RECORD_LIMIT = 64 << 20
"""Largest record, and largest chunk once inflated, bytes; the writer's own chunks stay near 1 MiB."""

TEXT_LIMIT = 1 << 20
"""Longest metadata, bytes, because it can hold a hundred thousand short fields."""

_FREE_BYTES, _INFLATION, _MOST_BYTES = 64 << 20, 300, 1 << 30
"""A file of s bytes can inflate to at most 64 MiB + 300 s bytes, and to at most the larger of 1 GiB and 10 s."""

_FREE_RECORDS, _BYTES_PER_RECORD, _BYTES_PER_OUTER_RECORD = 10_000, 40, 100
"""It can hold 10,000 + s/40 records in chunks and 10,000 + s/100 outside of them, which take longer to read."""

_KEPT_BYTES = 192 << 20
"""The retained contents can take the larger of 192 MiB and 2 s bytes."""

_PREFIX, _MESSAGE = struct.Struct("<BQ"), struct.Struct("<HIQQ")
"""Kind and length of a record; channel, number, log time and publication time of a message."""

_COUNTED = {
    Opcode.MESSAGE: "message_count",
    Opcode.ATTACHMENT: "attachment_count",
    Opcode.METADATA: "metadata_count",
    Opcode.CHUNK: "chunk_count",
}


class Channel(NamedTuple):
    """Declaration of a topic: encoding of its messages, and name, encoding and text of their schema."""

    topic: str
    encoding: str
    kind: str
    language: str
    schema: bytes
    words: tuple[tuple[str, str], ...] = ()


class Message(NamedTuple):
    """A message with its number in the topic and times in ns; `offset` is that of its chunk in the file."""

    topic: str
    number: int
    time: int
    published: int
    data: bytes
    offset: int


@dataclass(frozen=True)
class Attachment:
    """A file inside the file; its name is never used as a path."""

    name: str
    data: bytes
    offset: int


@dataclass(frozen=True)
class Metadata:
    """A named metadata record of text fields."""

    name: str
    words: dict[str, str]
    offset: int


Item = Message | Attachment | Metadata


class DamageError(Exception):
    """Bytes are invalid; `offset` counts from the beginning of the file."""

    def __init__(self, what: str, offset: int) -> None:
        self.what, self.offset = what, offset
        super().__init__(what, offset)


def mcap_writer(file: Output, library: str) -> Writer:
    """Return the library's started writer for `file`."""
    writer = Writer(cast(IO[Any], file))
    writer.start("", library)
    return writer


class McapFile:
    """Reader of one file, for one pass.

    Attributes:
        path: Path of the file.
        recover: Whether a damaged file is read up to the damage, with a note in `losses`, instead of an error.
        size: Size of the file, bytes; known once reading has begun.
        losses: Descriptions of the parts that could not be read.
    """

    def __init__(self, path: Path, recover: bool = False, topics: Collection[str] | None = None) -> None:
        """Prepare to read.

        Args:
            path: Path of the file.
            recover: Whether a damaged file is read up to the damage.
            topics: Topics whose messages are read; None for all.
        """
        self.path, self.recover, self.size = path, recover, 0
        self.losses: list[str] = []
        self._wanted = topics
        self._schemas: dict[int, records.Schema] = {}
        self._channels: dict[int, records.Channel] = {}
        self._seen: Counter[int] = Counter()
        self._inflated = self._inner = self._outer = self._kept = 0

    @property
    def channels(self) -> frozenset[Channel]:
        """Channels that the file has declared so far."""
        none = records.Schema(0, b"", "", "")
        found = [(one, self._schemas.get(one.schema_id, none)) for one in self._channels.values()]
        return frozenset(
            Channel(
                one.topic, one.message_encoding, of.name, of.encoding, of.data, tuple(sorted(one.metadata.items()))
            )
            for one, of in found
        )

    def items(self) -> Iterator[Item]:
        """Yield the contents of the file.

        Raises:
            RunLogError: If the file cannot be read, or is damaged and `recover` is false.
        """
        try:
            if not stat.S_ISREG(self.path.stat().st_mode):  # a pipe or a device might never end
                raise RunLogError(str(self.path), "not a file")
            with open(self.path, "rb") as stream:
                self.size = os.fstat(stream.fileno()).st_size
                for item in self._walk(stream):
                    yield item
                    if self.losses:
                        return
        except OSError as error:
            raise RunLogError(str(self.path), f"cannot read the log: {error.strerror}") from error
        except DamageError as damage:
            self.lose(damage)

    def lose(self, damage: DamageError) -> None:
        """Record that a damage ends the reading.

        Raises:
            RunLogError: If `recover` is false.
        """
        if not self.recover:
            raise RunLogError(str(self.path), damage.what, damage.offset) from damage
        self.losses.append(f"everything from byte {damage.offset} on: {damage.what}")

    def require(self, there: bool, what: str, vital: bool = False) -> None:
        """Record that `what` is missing unless it is `there`.

        Raises:
            RunLogError: If it is missing, and `recover` is false or it is `vital`.
        """
        if not there and (vital or not self.recover):
            raise RunLogError(str(self.path), f"the file ends without {what}", self.size)
        if not there:
            self.losses.append(what)

    def keep(self, size: int, offset: int) -> None:
        """Count `size` bytes of memory for the contents at `offset`.

        Raises:
            DamageError: If the total exceeds the limit for the file.
        """
        self._kept += size
        if self._kept > max(_KEPT_BYTES, 2 * self.size):
            raise DamageError("the contents of the file exceed the memory limit for its size", offset)

    def _walk(self, stream: BinaryIO) -> Iterator[Item]:
        """Yield the items of the file up to its end; raise DamageError if it is damaged."""
        if stream.read(len(MAGIC)) != MAGIC:
            raise DamageError(NO_LOG, 0)
        checksum: int | None = None  # of the summary, once the data have ended
        opcode = 0
        while opcode != Opcode.FOOTER:
            at = stream.tell()
            opcode, body = _next_record(stream, self.size)
            self._outer += 1
            if self._outer > _FREE_RECORDS + self.size // _BYTES_PER_OUTER_RECORD:
                raise DamageError("the file holds far more records than its size allows", at)
            self._seen[opcode] += 1
            if opcode == Opcode.CHUNK:
                yield from self._chunk(_parse(records.Chunk, body, at), at)
            else:
                yield from self._record(opcode, body, at)
            if opcode == Opcode.DATA_END:
                checksum = 0
            elif opcode == Opcode.FOOTER:
                stated = _parse(records.Footer, body, at).summary_crc
                own = zlib.crc32(body[:16], zlib.crc32(_PREFIX.pack(Opcode.FOOTER, len(body)), checksum or 0))
                if stated and stated != own:
                    raise DamageError("the checksum of the summary is wrong", at)
            elif checksum is not None:
                checksum = zlib.crc32(body, zlib.crc32(_PREFIX.pack(opcode, len(body)), checksum))
        at = stream.tell()
        if stream.read(len(MAGIC)) != MAGIC or stream.tell() != self.size:
            raise DamageError("the file does not end after its footer", at)

    def _record(self, opcode: int, body: bytes, at: int) -> Iterator[Item]:
        """Process a record: yield its contents, store declarations, check counts, skip the rest."""
        if opcode == Opcode.ATTACHMENT:
            found = _parse(records.Attachment, body, at)
            (stated,) = struct.unpack("<I", body[-4:])
            if stated and zlib.crc32(memoryview(body)[:-4]) != stated:
                raise DamageError(f"the checksum of attachment {found.name!r} is wrong", at)
            yield Attachment(found.name, found.data, at)
        elif opcode == Opcode.METADATA:
            if len(body) > TEXT_LIMIT:
                raise DamageError(f"metadata of {len(body)} bytes; at most {TEXT_LIMIT} are allowed", at)
            self.keep(32 * len(body), at)
            words = _parse(records.Metadata, body, at)
            yield Metadata(words.name, words.metadata, at)
        elif opcode == Opcode.MESSAGE:
            yield from self._message(memoryview(body), at)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._declare(opcode, body, at)
        elif opcode == Opcode.STATISTICS:
            counts = _parse(records.Statistics, body, at)
            if any(self._seen[kind] != getattr(counts, name) for kind, name in _COUNTED.items()):
                raise DamageError("the number of records differs from the summary", at)

    def _declare(self, opcode: int, body: bytes, at: int) -> None:
        self.keep(512 + len(body), at)
        known: dict[int, Any] = self._schemas if opcode == Opcode.SCHEMA else self._channels
        new = _parse(records.Schema if opcode == Opcode.SCHEMA else records.Channel, body, at)
        if opcode == Opcode.CHANNEL and new.schema_id and new.schema_id not in self._schemas:
            raise DamageError(f"channel {new.id} has schema {new.schema_id}, which is not declared", at)
        if known.setdefault(new.id, new) != new:
            raise DamageError(f"{type(new).__name__.lower()} {new.id} is declared twice", at)

    def _chunk(self, chunk: records.Chunk, at: int) -> Iterator[Item]:
        data = self._inflate(chunk, at)
        begin, size = 0, len(data)
        while begin < size:
            self._inner += 1
            if self._inner > _FREE_RECORDS + self.size // _BYTES_PER_RECORD:
                raise DamageError("the file holds far more records than its size allows", at)
            opcode, length = _PREFIX.unpack_from(data, begin) if begin + _PREFIX.size <= size else (0, size)
            end = begin + _PREFIX.size + length
            if end > size:
                raise DamageError("a chunk ends inside a record", at)
            body = data[begin + _PREFIX.size : end]
            if opcode == Opcode.MESSAGE:
                self._seen[opcode] += 1
                yield from self._message(body, at)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, bytes(body), at)
            begin = end

    def _message(self, body: memoryview, at: int) -> Iterator[Message]:
        """Yield the message in `body` if its topic is requested."""
        if len(body) < _MESSAGE.size:
            raise DamageError("a message lacks its number, channel and times", at)
        identity, number, time, published = _MESSAGE.unpack_from(body)
        channel = self._channels.get(identity)
        if channel is None:
            raise DamageError(f"a message on channel {identity}, which is not declared", at)
        if self._wanted is None or channel.topic in self._wanted:
            yield Message(channel.topic, number, time, published, bytes(body[_MESSAGE.size :]), at)

    def _inflate(self, chunk: records.Chunk, at: int) -> memoryview:
        """Return the records of a chunk as one block; its claimed size is checked before it is inflated."""
        size = chunk.uncompressed_size
        self._inflated += size
        if size > RECORD_LIMIT:
            raise DamageError(f"a chunk claims {size} bytes; at most {RECORD_LIMIT} are allowed", at)
        if self._inflated > min(_FREE_BYTES + _INFLATION * self.size, max(_MOST_BYTES, 10 * self.size)):
            raise DamageError("the file holds far more data than its size allows", at)
        data = chunk.data
        if chunk.compression == "zstd":
            try:
                stated = zstandard.frame_content_size(data)
                if stated not in (-1, size):
                    raise DamageError(f"a chunk claims {size} bytes and holds {stated}", at)
                data = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
            except zstandard.ZstdError as error:
                raise DamageError(f"damaged zstd data ({error})", at) from error
        elif chunk.compression == "lz4":
            try:
                data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
            except (RuntimeError, EOFError) as error:
                raise DamageError(f"damaged lz4 data ({error})", at) from error
        elif chunk.compression:
            raise DamageError(f"compression {chunk.compression!r}; pushplan reads '', 'lz4' and 'zstd'", at)
        if len(data) != size:
            raise DamageError(f"a chunk claims {size} bytes and holds {len(data)}", at)
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise DamageError("the checksum of a chunk is wrong", at)
        return memoryview(data)


def metadata_of(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield name and fields of each metadata record up to the end of the data, or of a truncated file.

    Nothing else is read or checked, which takes a millisecond instead of a hundred.

    Raises:
        DamageError: If the file is not MCAP or a metadata record is damaged.
        OSError: If the file cannot be read.
    """
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb", buffering=0) as stream:
        size, room = os.fstat(stream.fileno()).st_size, 4 * TEXT_LIMIT
        if stream.read(len(MAGIC)) != MAGIC:
            raise DamageError(NO_LOG, 0)
        for _ in range(_FREE_RECORDS + size // _BYTES_PER_OUTER_RECORD):
            at, prefix = stream.tell(), stream.read(_PREFIX.size)
            opcode, length = _PREFIX.unpack(prefix) if len(prefix) == _PREFIX.size else (Opcode.DATA_END, 0)
            if opcode == Opcode.DATA_END or length > size - stream.tell():
                return
            if opcode == Opcode.METADATA:
                room -= length
                if room < 0:
                    raise DamageError("the file holds more metadata than a log has", at)
                words = _parse(records.Metadata, stream.read(length), at)
                yield words.name, words.metadata
            else:
                stream.seek(length, os.SEEK_CUR)


class _Exact(ReadDataStream):
    """Reader of a record's fields that never reads beyond its end."""

    def read(self, length: int) -> bytes:
        """Return the next `length` bytes.

        Raises:
            ValueError: If fewer are left.
        """
        data = self._stream.read(length)
        if len(data) < length:
            raise ValueError(f"a field claims {length} bytes of the {len(data)} left")
        self._count += length
        return data


def _parse(kind: Any, body: bytes, at: int) -> Any:
    try:
        return kind.read(_Exact(BytesIO(body)))
    except (ValueError, McapError, struct.error, KeyError, OverflowError) as error:
        raise DamageError(f"a damaged {kind.__name__.lower()} ({error})", at) from error


def _next_record(stream: BinaryIO, size: int) -> tuple[int, bytes]:
    """Return kind and contents of the next record of `stream`, a file of `size` bytes."""
    at, prefix = stream.tell(), stream.read(_PREFIX.size)
    if not prefix:
        raise DamageError("the file ends without a footer", at)
    opcode, length = _PREFIX.unpack(prefix) if len(prefix) == _PREFIX.size else (0, size)
    if length > size - at - _PREFIX.size:
        raise DamageError("the file ends inside a record", at)
    if length > RECORD_LIMIT:
        raise DamageError(f"a record claims {length} bytes; at most {RECORD_LIMIT} are allowed", at)
    return opcode, stream.read(length)
