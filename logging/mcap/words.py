"""The metadata of an MCAP file without the rest: a millisecond where reading all takes a hundred."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path

from pushplan.logging.mcap.cursor import TEXT_LIMIT, Cursor, DamageError
from pushplan.logging.mcap.opcodes import DATA_END, MAGIC, METADATA, PREFIX

_PREFIX = struct.Struct("<BQ")
_MOST_RECORDS = 200_000
"""Records outside of chunks that are passed over, at most: those of a run of five hours."""
_MOST_BYTES = 4 << 20
"""Bytes of metadata that are read, at most."""


def metadata_words(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield name and words of each metadata up to the end of the data, or to where a file is cut short.

    Nothing else is read or checked.

    Raises:
        DamageError: When the file is not MCAP or a metadata is damaged.
        OSError: When the file cannot be read.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        if os.pread(descriptor, len(MAGIC), 0) != MAGIC:
            raise DamageError("not an MCAP file", 0)
        yield from _walk(descriptor, len(MAGIC))
    finally:
        os.close(descriptor)


def _walk(descriptor: int, at: int) -> Iterator[tuple[str, dict[str, str]]]:
    room = _MOST_BYTES
    for _ in range(_MOST_RECORDS):
        prefix = os.pread(descriptor, PREFIX, at)
        if len(prefix) < PREFIX:
            return
        opcode, length = _PREFIX.unpack(prefix)
        if opcode == DATA_END or length > 1 << 62:
            return
        if opcode == METADATA:
            room -= length
            if length > TEXT_LIMIT or room < 0:
                raise DamageError("more metadata than a log has", at)
            body = os.pread(descriptor, length, at + PREFIX)
            if len(body) < length:
                return
            cursor = Cursor(memoryview(body), at + PREFIX)
            yield cursor.text(), cursor.texts()
        at += PREFIX + length
