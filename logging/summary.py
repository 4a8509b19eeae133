"""The end of an MCAP file checked: it counts the records before it and holds a checksum of itself."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from typing import BinaryIO

from pushplan.logging import records
from pushplan.logging.cursor import DamageError
from pushplan.logging.records import Frame

_FOOTER_SIZE = records.PREFIX + 20


class SummaryCheck:
    """Counts the records of a file and compares the counts and the checksum that its summary holds."""

    def __init__(self) -> None:
        self._seen: Counter[int] = Counter()
        self._checksum: int | None = None

    def note(self, frame: Frame) -> None:
        """Take the next record of the file, or of a chunk.

        Raises:
            DamageError: When the summary's counts or checksum do not fit.
        """
        if self._checksum is None:
            self._seen[frame.opcode] += 1
            if frame.opcode == records.DATA_END:
                self._checksum = 0
        elif frame.opcode == records.FOOTER:
            _check_footer(frame, self._checksum)
        else:
            self._checksum = zlib.crc32(frame.body, zlib.crc32(_prefix(frame), self._checksum))
            if frame.opcode == records.STATISTICS:
                self._check_counts(frame)

    def _check_counts(self, frame: Frame) -> None:
        cursor = frame.cursor
        counts = {records.MESSAGE: cursor.number("Q")}
        cursor.take(6)  # schemas and channels
        for opcode in (records.ATTACHMENT, records.METADATA, records.CHUNK):
            counts[opcode] = cursor.number("I")
        if any(self._seen[opcode] != count for opcode, count in counts.items()):
            raise DamageError("the file holds other records than its summary counts", frame.offset)


def intact_summary(stream: BinaryIO, size: int) -> list[Frame]:
    """Return the records of the summary, if there is one and it is intact; `stream` is rewound.

    Schemas and channels are repeated there, so that messages can be understood whose declaration is lost.
    """
    try:
        return _summary(stream, size)
    except DamageError:
        return []
    finally:
        stream.seek(0)


def _summary(stream: BinaryIO, size: int) -> list[Frame]:
    stream.seek(max(0, size - len(records.MAGIC) - _FOOTER_SIZE))
    footer = records.next_frame(stream, size)
    begin = footer.cursor.number("Q")
    if footer.opcode != records.FOOTER or not 0 < begin < footer.offset:
        return []
    stream.seek(begin)
    found: list[Frame] = []
    checksum = 0
    while stream.tell() < footer.offset:
        found.append(records.next_frame(stream, size))
        checksum = zlib.crc32(found[-1].body, zlib.crc32(_prefix(found[-1]), checksum))
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
