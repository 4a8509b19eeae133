"""Messages of several channels at the same times, ready to be written: rows of bytes, and what the index says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pushplan.logging.mcap import message_head, opcodes
from pushplan.logging.mcap.message_template import ByteRows
from pushplan.util.arrays import IntArray


@dataclass(frozen=True)
class Batch:
    """Messages of several channels at the same times.

    Attributes:
        records: (n, bytes) what is to be written for each time.
        entries: (n, 2) by channel: time, and place of its message in `records`, for the index.
        times: (n,) ns.
    """

    records: ByteRows
    entries: Mapping[int, NDArray[np.uint64]]
    times: IntArray

    @classmethod
    def from_messages(cls, messages: Mapping[tuple[int, int], ByteRows], times: IntArray) -> Batch:
        """Return messages (n, size) at times (n,), ns, by channel and number of its first message."""
        records = [_records(channel, first, data, times) for (channel, first), data in messages.items()]
        begins = np.cumsum([0, *(part.shape[1] for part in records)])
        rows = begins[-1] * np.arange(len(times))
        entries = [np.stack([times, rows + begin], axis=1).astype("<u8") for begin in begins[:-1]]
        channels = [channel for channel, _ in messages]
        return cls(np.concatenate(records, axis=1), dict(zip(channels, entries, strict=True)), times)


def _records(channel: int, sequence: int, data: ByteRows, times: IntArray) -> ByteRows:
    """Return the records (n, bytes) of messages (n, size), numbered from `sequence` on."""
    heads = np.zeros(len(times), dtype=message_head.ROW)
    heads["opcode"], heads["channel"] = opcodes.MESSAGE, channel
    heads["length"] = message_head.FIELDS.size + data.shape[1]
    heads["sequence"] = sequence + np.arange(len(times))
    heads["log"] = heads["publish"] = times
    return np.concatenate([heads.view(np.uint8).reshape(len(times), -1), data], axis=1)
