"""Where records go on behind damage: some bytes that begin a record whose successors are records, too."""

from __future__ import annotations

import re
from typing import BinaryIO

from pushplan.logging.mcap import opcodes
from pushplan.logging.mcap.budget import RECORD_LIMIT
from pushplan.logging.mcap.opcodes import MAGIC, PREFIX

_WINDOW = 1 << 20
_CANDIDATE = re.compile(rb"[\x02-\x0f][\x00-\xff]{3}\x00{5}", re.DOTALL)
"""A kind and a length of less than 16 MiB, little-endian in eight bytes."""

_CHAIN = 3
"""Records that have to follow one another: by chance hardly ever, as each has five zero bytes at its place."""

_MOST_CANDIDATES = 1000
"""Places tried in one search; a file made of nothing but beginnings would take for ever."""


def next_sound(stream: BinaryIO, begin: int, size: int) -> int | None:
    """Return the first place behind `begin` where records begin, in a file of `size` bytes; None when there is none.

    Chunks and attachments that are found have checksums of their own; this needs to be a good guess only.
    """
    left = _MOST_CANDIDATES
    for window in range(begin + 1, size, _WINDOW):
        stream.seek(window)
        data = stream.read(_WINDOW + PREFIX)
        at = -1
        while left and (found := _CANDIDATE.search(data, at + 1)):
            at, left = found.start(), left - 1
            if at < _WINDOW and _chained(stream, window + at, size):
                return window + at
    return None


def _chained(stream: BinaryIO, at: int, size: int) -> bool:
    """Tell whether records follow one another from `at` on, up to the end of the file or for a while."""
    for _ in range(_CHAIN):
        stream.seek(at)
        prefix = stream.read(PREFIX)
        if prefix.startswith(MAGIC) and at + len(MAGIC) == size:
            return True
        if len(prefix) < PREFIX:
            return len(prefix) == 0  # the file of a killed run ends with a record
        length = int.from_bytes(prefix[1:], "little")
        if not opcodes.FOOTER <= prefix[0] <= opcodes.DATA_END or length > RECORD_LIMIT:
            return False
        at += PREFIX + length
        if at > size:
            return False
    return True
