"""What a message begins with, in the layout that https://mcap.dev/spec gives: read, packed, and in rows."""

from __future__ import annotations

import struct

import numpy as np

from pushplan.logging.mcap import opcodes

_PREFIX = {"opcode": "B", "length": "Q"}
_FIELDS = {"channel": "H", "sequence": "I", "log": "Q", "publish": "Q"}

FIELDS = struct.Struct("<" + "".join(_FIELDS.values()))
"""Channel, number, time of the log, time of publication; behind them comes the message."""

ROW = np.dtype([(name, f"<{code}") for name, code in (_PREFIX | _FIELDS).items()])
"""A record's opcode and length, and these fields."""

_HEAD = struct.Struct("<" + "".join((_PREFIX | _FIELDS).values()))


def packed(channel: int, sequence: int, time: int, size: int) -> bytes:
    """Return what comes before the `size` bytes of a message."""
    return _HEAD.pack(opcodes.MESSAGE, FIELDS.size + size, channel, sequence, time, time)
