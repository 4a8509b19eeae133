"""The end of an MCAP file checked: it counts the records before it and holds a checksum of itself."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from typing import BinaryIO

from pushplan.logging.mcap import opcodes, records
from pushplan.logging.mcap.budget import RECORD_LIMIT
from pushplan.logging.mcap.cursor import DamageError
from pushplan.logging.mcap.records import Frame

_FOOTER_SIZE = opcodes.PREFIX + 20

_MOST_RECORDS = 50_000
"""Records of a summary, at most: an index of as many chunks, a second of simulated time each."""


class SummaryCheck:
    """Counts the records of a file and compares the counts and the checksum that its summary holds.

    Attributes:
        counting: Compare the counts; of no use any more once records were lost.
    """

    def __init__(self) -> None:
        self.counting = True
        self._seen: Counter[int] = Counter()
        self._checksum: int | None = None

    def count(self, opcode: int, number: int = 1) -> None:
        """Take the next record of a chunk, or a number of them."""
        self._seen[opcode] += number

    def note(self, frame: Frame) -> None:
        """Take the next record of the file.

        Raises:
            DamageError: When the summary's counts or checksum do not fit.
        """
        if self._checksum is None:
            self.count(frame.opcode)
            if frame.opcode == opcodes.DATA_END:
                self._checksum = 0
        elif frame.opcode == opcodes.FOOTER:
            _check_footer(frame, self._checksum)
        else:
            self._checksum = zlib.crc32(frame.body, zlib.crc32(_prefix(frame), self._checksum))
            if frame.opcode == opcodes.STATISTICS:
                self._check_counts(frame)

    def _check_counts(self, frame: Frame) -> None:
        cursor = frame.cursor
        counts = {opcodes.MESSAGE: cursor.number("Q")}
        cursor.take(6)  # schemas and channels
        for opcode in (opcodes.ATTACHMENT, opcodes.METADATA, opcodes.CHUNK):
            counts[opcode] = cursor.number("I")
        if self.counting and any(self._seen[opcode] != count for opcode, count in counts.items()):
            raise DamageError("the file holds other records than its summary counts", frame.offset)


def repeated_declarations(stream: BinaryIO, size: int) -> list[Frame]:
    """Return the schemas and channels that the summary repeats, if it is there and intact; `stream` is rewound.

    With them messages can be understood whose declaration is lost.
    """
    try:
        return _declarations(stream, size)
    except DamageError:
        return []
    finally:
        stream.seek(0)


def _declarations(stream: BinaryIO, size: int) -> list[Frame]:
    stream.seek(max(0, size - len(opcodes.MAGIC) - _FOOTER_SIZE))
    footer = records.next_frame(stream, size)
    begin = footer.cursor.number("Q")
    if footer.opcode != opcodes.FOOTER or not 0 < begin < footer.offset:
        return []
    stream.seek(begin)
    checksum, found, left, room = 0, [], _MOST_RECORDS, RECORD_LIMIT
    while stream.tell() < footer.offset and left and room > 0:
        frame = records.next_frame(stream, size)
        checksum = zlib.crc32(frame.body, zlib.crc32(_prefix(frame), checksum))
        left -= 1
        if frame.opcode in (opcodes.SCHEMA, opcodes.CHANNEL):
            found.append(frame)
            room -= len(frame.body)
    _check_footer(footer, checksum)
    return found


def _check_footer(frame: Frame, checksum: int) -> None:
    """Raise DamageError unless `checksum`, of what lies before `frame`, leads to the one it holds, if any."""
    cursor = frame.cursor
    covered = cursor.take(16)
    stated = cursor.number("I")
    if stated and zlib.crc32(covered, zlib.crc32(_prefix(frame), checksum)) != stated:
        raise DamageError("the checksum of the summary does not fit", frame.offset)


def _prefix(frame: Frame) -> bytes:
    return struct.pack("<BQ", frame.opcode, len(frame.body))
