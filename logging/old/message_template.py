"""Messages that differ in their time and numbers only: serialised once, then filled by the hundred.

Protobuf writes doubles in eight bytes each, and reads integers in more bytes than they need, so the time can take
the same room in all of them; then the messages are the rows of one array of bytes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

import numpy as np
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from pushplan.util.arrays import FloatArray, IntArray

ByteRows = NDArray[np.uint8]
"""(n, bytes): a message in each row."""

_DIGITS = 5
"""Groups of seven bits in which seconds and nanoseconds are written; seconds reach 2^35."""

_LONGEST = Timestamp(seconds=(1 << 7 * _DIGITS) - 1, nanos=999_999_999)

_NANO = 1_000_000_000


class MessageTemplate:
    """A message with holes.

    Args:
        make: Returns the message for a time stamp and `count` numbers.
        count: How many numbers.
    """

    def __init__(self, make: Callable[[Timestamp, list[float]], Message], count: int) -> None:
        marks = [float.fromhex(f"0x1.{k:04x}5eed5eedp-777") for k in range(count)]
        data: bytes = make(_LONGEST, marks).SerializeToString(deterministic=True)
        self._data = np.frombuffer(data, dtype=np.uint8)
        stamp = _LONGEST.SerializeToString()
        self._stamps = [found.start() for found in re.finditer(re.escape(stamp), data)]
        self._numbers = [_place(data, struct.pack("<d", mark)) for mark in marks]

    def fill(self, times: IntArray, numbers: FloatArray) -> ByteRows:
        """Return the messages at times (n,), ns from 0 on, of numbers (n, count)."""
        rows = np.tile(self._data, (len(times), 1))
        for stamp in self._stamps:
            for part, begin in ((times // _NANO, stamp + 1), (times % _NANO, stamp + 2 + _DIGITS)):
                rows[:, begin : begin + _DIGITS] = _varints(part)
        octets = np.ascontiguousarray(numbers, dtype="<f8").view(np.uint8).reshape(*numbers.shape, 8)
        for k, begin in enumerate(self._numbers):
            rows[:, begin : begin + 8] = octets[:, k]
        return rows


def _varints(values: IntArray) -> ByteRows:
    """Return protobuf's encoding of integers (n,) in `_DIGITS` bytes each, leading zeros included."""
    groups = values[:, None] >> 7 * np.arange(_DIGITS) & 0x7F
    groups[:, :-1] |= 0x80
    return groups.astype(np.uint8)


def _place(data: bytes, piece: bytes) -> int:
    """Return where the only `piece` in `data` begins."""
    if data.count(piece) != 1:
        raise ValueError(f"a message holds {data.count(piece)} times what it should hold once")
    return data.index(piece)
