"""How much of a file is read: memory and time in proportion to its size, whatever it claims.

A file below 100 MB takes less than 500 MB of memory and 10 s of a processor to be read or refused. Logs of this
project stay far below every limit: an hour of two bodies takes 30 MB, 90 bytes a record, and keeps 50 MB.
"""

from __future__ import annotations

from pushplan.logging.mcap.cursor import DamageError

RECORD_LIMIT = 16 << 20
"""Largest record, and largest chunk once inflated, bytes; the writer's own stay below 1 MiB."""

MESSAGE_LIMIT = 2 << 20
"""Largest message that is decoded, bytes: a protobuf message takes up to 50 times its size in memory."""

TOTAL_LIMIT = 1 << 30
"""Most bytes that all chunks of a file below 100 MB may inflate to."""

KEPT_LIMIT = 192 << 20
"""Most bytes of memory that the content of a file below 100 MB may take."""

WORDS_MEMORY = 32
"""Bytes of memory charged for each byte of metadata, which may be a hundred thousand short words."""

_FREE_BYTES, _INFLATION = 64 << 20, 300
"""A file of s bytes may inflate to 64 MiB + 300 s bytes, ..."""

_FREE_RECORDS, _BYTES_PER_RECORD = 10_000, 40
"""... hold 10,000 + s/40 messages ..."""

_BYTES_PER_OUTER_RECORD = 100
"""... and 10,000 + s/100 records that lie outside of chunks, which take longer to read."""


class ExhaustedError(DamageError):
    """A budget is used up: nothing more may be read."""


class Budget:
    """What is left of the records, the inflated bytes and the memory that a file of `size` bytes may have."""

    def __init__(self, size: int) -> None:
        self._outer = _FREE_RECORDS + size // _BYTES_PER_OUTER_RECORD
        self._records = _FREE_RECORDS + size // _BYTES_PER_RECORD
        self._bytes = min(max(TOTAL_LIMIT, 10 * size), _FREE_BYTES + _INFLATION * size)
        self._kept = max(KEPT_LIMIT, 2 * size)

    def outer_record(self, offset: int) -> None:
        """Take a record at `offset` that lies outside of chunks.

        Raises:
            ExhaustedError: When there are more than may be, here as below.
        """
        self._outer -= 1
        _require(self._outer >= 0, offset)

    def chunk(self, size: int, offset: int) -> None:
        """Take a chunk of `size` bytes, inflated, that begins at `offset`."""
        self._bytes -= size
        _require(self._bytes >= 0, offset)

    @property
    def records(self) -> int:
        """How many records in chunks may still come."""
        return self._records

    def inner_records(self, count: int, offset: int) -> None:
        """Take records of the chunk at `offset`."""
        self._records -= count
        _require(self._records >= 0, offset)

    def keep(self, size: int, offset: int) -> None:
        """Take `size` bytes of memory for what comes from `offset`."""
        self._kept -= size
        if self._kept < 0:
            raise ExhaustedError("the file holds more than fits the memory that its size allows", offset)


def _require(holds: bool, offset: int) -> None:
    if not holds:
        raise ExhaustedError("the file holds far more data than its size allows", offset)
