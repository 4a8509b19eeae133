"""Logs, small on disk, that would take much memory or time to read if nothing bounded that.

`python tests/logs/bombs.py SOUND.mcap FOLDER` writes one of each kind, of up to 95 MB where PUSHPLAN_PADDING=6.
"""

from __future__ import annotations

import importlib.util
import os
import random
import struct
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import zstandard
from pushplan.logging.old.messages import schemas

BOMBS: dict[str, Callable[[bytes], bytes]] = {}

PADDING = int(os.environ.get("PUSHPLAN_PADDING", "0"))
"""15 MB each: six make files of 95 MB, and budgets to match, at the cost of minutes."""


def _load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


h: Any = _load("hostile_files")


def bomb(maker: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    BOMBS[maker.__name__] = maker
    return maker


@cache
def number_of(log: bytes, topic: str) -> int:
    found: int = h.channels(h.loose(log))[topic]
    return found


def message(log: bytes, topic: str, data: bytes) -> bytes:
    """Return a record of a message on a topic."""
    head: bytes = struct.pack("<HIQQ", number_of(log, topic), 0, 0, 0)
    return bytes(h.raw(h.MESSAGE, head + data))


def packed(data: bytes) -> tuple[int, bytes]:
    return h.CHUNK, h.chunk(b"", "zstd", len(data), zstandard.compress(data))


def padding() -> Iterator[tuple[int, bytes]]:
    """Attachments of others that let the file be large, and so its budget."""
    data = random.Random(1).randbytes(15 << 20)
    for k in range(PADDING):
        yield h.ATTACHMENT, h.attachment(f"padding{k}", data)


def exploding(log: bytes, chunks: list[tuple[int, bytes]], padded: bool = True) -> bytes:
    """Return the log with chunks behind its own records."""
    made: bytes = h.rebuild([*h.loose(log), *(padding() if padded else ()), *chunks])
    return made


def repeated(record: bytes, size: int = 15 << 20) -> bytes:
    return record * (size // len(record))


@bomb
def lines_of_16_megabytes(log: bytes) -> bytes:
    line = message(log, "/log", b"\x10\x02\x1a" + h._field(3, b"x" * (16_700_000))[1:])
    return exploding(log, [packed(line)] * 50, padded=False)


@bomb
def lines_of_megabytes(log: bytes) -> bytes:
    words = "\u5317".encode() * 650_000
    line = message(log, "/log", b"\x10\x02" + h._field(3, words))
    return exploding(log, [packed(line * 7)] * 70)


@bomb
def hundreds_of_thousands_of_lines(log: bytes) -> bytes:
    return exploding(log, [packed(repeated(message(log, "/log", b"\x10\x02\x1a\x01x")))] * 60)


@bomb
def hundreds_of_thousands_of_improvements(log: bytes) -> bytes:
    point = schemas.Progress(cost=1.0)
    point.path.start.extend([0.0] * 3)
    point.path.twists.extend([1.0, 0.0, 0.0])
    point.path.lengths.append(1.0)
    improvement = message(log, "/planner/progress", point.SerializeToString())
    return exploding(log, [packed(repeated(improvement))] * 60)


@bomb
def millions_of_records_in_chunks(log: bytes) -> bytes:
    return exploding(log, [packed(repeated(h.raw(0x80, b"")))] * 60)


@bomb
def millions_of_messages_for_viewers(log: bytes) -> bytes:
    return exploding(log, [packed(repeated(message(log, "/tf", b"")))] * 60)


@bomb
def a_million_records(log: bytes) -> bytes:
    made: bytes = h.rebuild([*h.loose(log), *padding(), *[(0x80, b"")] * (250_000 * (1 + PADDING))])
    return made


@bomb
def blocks_of_one_sample(log: bytes) -> bytes:
    """Blocks as they should be, of so few samples that there are tens of thousands."""
    planes = {"t": (1,), "poses": (1, 3), "twists": (1, 3), "margins": (1, 2)}
    arrays = b""
    for name, shape in planes.items():
        size = 8
        for side in shape:
            size *= side
        array = h._field(1, name.encode()) + h._field(2, bytes(shape)) + h._field(3, bytes(size))
        arrays += h._field(3, array)
    records = [record for record in h.loose(log) if record[0] != h.MESSAGE]
    blocks = [message(log, "/execution/samples", _varint(2, k) + arrays) for k in range(18_000)]
    chunks = [packed(b"".join(blocks[k : k + 10_000])) for k in range(0, len(blocks), 10_000)]
    made: bytes = h.rebuild([*records, *padding(), *chunks])
    return made


def _varint(field: int, value: int) -> bytes:
    out = bytearray([field << 3])
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


@bomb
def plans_of_a_million_reasons(log: bytes) -> bytes:
    plan = message(log, "/plan/result", h._field(12, b"") * 1_000_000)
    return exploding(log, [packed(plan * 7)] * 70)


@bomb
def schemas_of_megabytes(log: bytes) -> bytes:
    schemas = [
        packed(
            h.raw(h.SCHEMA, struct.pack("<H", 100 + k) + h.text("n" * 1_000_000) + h.text("") + h.text(data))
        )
        for k, data in enumerate([bytes(14 << 20)] * 60)
    ]
    return exploding(log, schemas)


@bomb
def metadata_of_a_million_words(log: bytes) -> bytes:
    words = h.metadata("pushplan.more", {f"{k}": "" for k in range(70_000)})
    made: bytes = h.rebuild([*h.loose(log), *[(h.METADATA, words)] * (15 * (1 + PADDING))])
    return made


@bomb
def scenario_of_a_megabyte(log: bytes) -> bytes:
    words = b"".join(b"k%d: 1\n" % k for k in range(45_000))
    return bytes(h.edit_body(log, h.ATTACHMENT, lambda body: h.attachment("scenario.yaml", words)))


@bomb
def thousands_of_runs(log: bytes) -> bytes:
    run = [record for record in h.loose(log) if record[0] in (h.METADATA, h.ATTACHMENT)]
    made: bytes = h.rebuild([*h.loose(log), *run * 3000])
    return made


@bomb
def files_of_the_scenario(log: bytes) -> bytes:
    files = [(h.ATTACHMENT, h.attachment(f"scenario/{k}.csv", bytes(15 << 20))) for k in range(6)]
    made: bytes = h.rebuild([*h.loose(log), *files])
    return made


@bomb
def gigabytes_for_nobody(log: bytes) -> bytes:
    return exploding(log, [packed(message(log, "/tf", bytes(16_700_000)))] * 130)


@bomb
def a_thousand_damaged_chunks(log: bytes) -> bytes:
    junk = h.CHUNK, h.chunk(b"", "zstd", 16 << 20, zstandard.compress(bytes(15 << 20)))
    return exploding(log, [junk] * 5000)


if __name__ == "__main__":
    sound = Path(sys.argv[1]).read_bytes()
    for name, maker in BOMBS.items():
        (Path(sys.argv[2]) / f"{name}.mcap").write_bytes(maker(sound))
