"""Makes damaged and hostile files from a sound log; shares no code with the project's reader or writer."""

from __future__ import annotations

import hashlib
import io
import random
import struct
import zlib
from collections.abc import Callable, Iterator

import zstandard

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)

Record = tuple[int, bytes]
Maker = Callable[[bytes], bytes]
KINDS: dict[str, Maker] = {}


def kind(maker: Maker) -> Maker:
    KINDS[maker.__name__] = maker
    return maker


# --- taking a sound file apart and putting it together ----------------------------------------------------------


def split(log: bytes) -> list[Record]:
    at, found = len(MAGIC), []
    while at < len(log) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", log, at)
        found.append((opcode, log[at + 9 : at + 9 + length]))
        at += 9 + length
    return found


def boundaries(log: bytes) -> Iterator[int]:
    """Yield where each record begins, and where the last one ends."""
    at = len(MAGIC)
    for _, body in split(log):
        yield at
        at += 9 + len(body)
    yield at


def raw(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(value: str | bytes) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def mapping(words: dict[str, str]) -> bytes:
    body = b"".join(text(part) for pair in words.items() for part in pair)
    return struct.pack("<I", len(body)) + body


def metadata(name: str, words: dict[str, str]) -> bytes:
    return text(name) + mapping(words)


def sealed(words: dict[str, str]) -> dict[str, str]:
    """Give metadata the checksum that this project wants."""
    covered = "".join(f"{len(part)}:{part}" for pair in sorted(words.items()) for part in pair)
    return {**words, "crc32": f"{zlib.crc32(covered.encode()):08x}"}


def chunk(data: bytes, compression: str = "", size: int | None = None, packed: bytes | None = None) -> bytes:
    packed = data if packed is None else packed
    head = struct.pack("<QQQI", 0, 0, len(data) if size is None else size, 0)
    return head + text(compression) + struct.pack("<Q", len(packed)) + packed


def unchunk(body: bytes) -> list[Record]:
    (length,) = struct.unpack_from("<I", body, 28)
    packed = body[28 + 4 + length + 8 :]
    return split(MAGIC + zstandard.ZstdDecompressor().decompress(packed) + MAGIC)


def build(records: list[Record]) -> bytes:
    """Put records together as a file whose summary is empty."""
    kept = [record for record in records if record[0] in (HEADER, CHUNK, ATTACHMENT, METADATA)]
    end = raw(DATA_END, bytes(4)) + raw(FOOTER, bytes(20))
    return MAGIC + b"".join(raw(*record) for record in kept) + end + MAGIC


def loose(log: bytes) -> list[Record]:
    """Return the records of the data section with the chunks opened up."""
    found: list[Record] = []
    for opcode, body in split(log):
        if opcode == DATA_END:
            break
        found += unchunk(body) if opcode == CHUNK else [(opcode, body)]
    return [record for record in found if record[0] != MESSAGE_INDEX]


def rebuild(records: list[Record]) -> bytes:
    """Put records that lie loose in the data section together as a file without summary."""
    end = raw(DATA_END, bytes(4)) + raw(FOOTER, bytes(20))
    return MAGIC + b"".join(raw(*record) for record in records) + end + MAGIC


def mutated(log: bytes, rng: random.Random) -> bytes:
    """Return a log with some of its records, or of its bytes, altered at random."""
    if rng.random() < 0.4:
        return _with_mutated_bytes(log, rng)
    records = loose(log) if rng.random() < 0.5 else split(log)
    for _ in range(rng.randint(1, 4)):
        _mutate(records, rng)
    return rebuild([record for record in records if record[0] not in (FOOTER, DATA_END)])


def _with_mutated_bytes(log: bytes, rng: random.Random) -> bytes:
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(log) + 1)
        end = min(len(log), at + rng.randrange(1, 1 << rng.randrange(1, 16)))
        piece = rng.choice((b"", log[at:end] * 2, rng.randbytes(rng.randrange(1, 12))))
        log = log[:at] + piece + log[end:]
    return log


def _mutate(records: list[Record], rng: random.Random) -> None:
    """Alter, drop, repeat or exchange a record."""
    i, j = rng.randrange(len(records)), rng.randrange(len(records))
    opcode, body = records[i]
    match rng.randrange(5):
        case 0:
            at, piece = rng.randint(0, len(body)), rng.randbytes(rng.randint(0, 12))
            records[i] = (opcode, body[:at] + piece + body[at + len(piece) :])
        case 1:
            records[i] = (opcode, body[: rng.randint(0, len(body))])
        case 2:
            records[i], records[j] = records[j], records[i]
        case 3:
            records.insert(j, records[i])
        case 4 if len(records) > 1:
            del records[i]


def with_chunk(log: bytes, body: bytes) -> bytes:
    records = [record for record in split(log) if record[0] != CHUNK]
    return build([*records[:1], (CHUNK, body), *records[1:]])


def channels(records: list[Record]) -> dict[str, int]:
    """Return the number of each topic's channel."""
    found = {}
    for opcode, body in records:
        if opcode == CHANNEL:
            number, _, length = struct.unpack_from("<HHI", body)
            found[body[8 : 8 + length].decode()] = number
    return found


def edit_messages(log: bytes, topic: str, edit: Callable[[list[Record]], list[Record]]) -> bytes:
    """Replace the messages of one topic, all of them at once, where the first one was."""
    records = loose(log)
    number = channels(records)[topic]
    mine = [r for r in records if r[0] == MESSAGE and struct.unpack_from("<H", r[1])[0] == number]
    at = records.index(mine[0])
    others = [record for record in records[at:] if record not in mine]
    return rebuild([*records[:at], *edit(mine), *others])


def edit_payload(log: bytes, topic: str, edit: Callable[[bytes], bytes]) -> bytes:
    def first(messages: list[Record]) -> list[Record]:
        opcode, body = messages[0]
        return [(opcode, body[:22] + edit(body[22:])), *messages[1:]]

    return edit_messages(log, topic, first)


def edit_body(log: bytes, opcode: int, edit: Callable[[bytes], bytes], which: int = 0) -> bytes:
    """Replace the content of the `which`-th record of a kind."""
    records = loose(log)
    places = [i for i, record in enumerate(records) if record[0] == opcode]
    at = places[which]
    records[at] = (opcode, edit(records[at][1]))
    return rebuild(records)


# --- the kinds of damage ----------------------------------------------------------------------------------------


@kind
def empty(log: bytes) -> bytes:
    return b""


@kind
def magic_only(log: bytes) -> bytes:
    return MAGIC


@kind
def other_magic(log: bytes) -> bytes:
    return b"\x89MCAP9\r\n" + log[8:]


@kind
def a_text(log: bytes) -> bytes:
    return b"format: pushplan/1\nname: not a log\n" * 40


@kind
def a_png(log: bytes) -> bytes:
    return b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 8


@kind
def noise(log: bytes) -> bytes:
    return random.Random(1).randbytes(10_000)


@kind
def noise_behind_the_magic(log: bytes) -> bytes:
    return MAGIC + random.Random(2).randbytes(10_000)


@kind
def trailing_garbage(log: bytes) -> bytes:
    return log + b"garbage"


@kind
def two_logs_in_one(log: bytes) -> bytes:
    return log + log


@kind
def no_trailing_magic(log: bytes) -> bytes:
    return log[:-8]


@kind
def no_footer(log: bytes) -> bytes:
    return log[: list(boundaries(log))[-2]] + MAGIC


@kind
def endless_record(log: bytes) -> bytes:
    return log[: list(boundaries(log))[3]] + raw(METADATA, bytes(100), (1 << 64) - 1) + MAGIC


@kind
def record_beyond_the_file(log: bytes) -> bytes:
    return log[: list(boundaries(log))[3]] + raw(METADATA, bytes(100), 101) + MAGIC[:-1]


@kind
def chunk_claims_exabytes(log: bytes) -> bytes:
    return with_chunk(log, chunk(b"", "zstd", 1 << 60, zstandard.compress(bytes(100))))


@kind
def zstd_bomb_that_lies(log: bytes) -> bytes:
    return with_chunk(log, chunk(b"", "zstd", 1000, zstandard.compress(bytes(256 << 20))))


@kind
def zstd_bomb_that_is_honest(log: bytes) -> bytes:
    return with_chunk(log, chunk(b"", "zstd", 256 << 20, zstandard.compress(bytes(256 << 20))))


@kind
def zstd_bomb_within_the_limit(log: bytes) -> bytes:
    return with_chunk(log, chunk(b"", "zstd", 16 << 20, zstandard.compress(bytes(16 << 20))))


@kind
def many_zstd_bombs(log: bytes) -> bytes:
    filler = raw(0x80, bytes((16 << 20) - 9))
    bomb = chunk(b"", "zstd", len(filler), zstandard.compress(filler))
    records = split(log)
    return build([records[0], *[(CHUNK, bomb)] * 150, *records[1:]])


@kind
def zstd_window_of_a_gigabyte(log: bytes) -> bytes:
    parameters = zstandard.ZstdCompressionParameters(window_log=30, compression_level=1)
    packer = zstandard.ZstdCompressor(compression_params=parameters)
    out = io.BytesIO()
    with packer.stream_writer(out, closefd=False) as stream:
        stream.write(bytes(1 << 20))
    return with_chunk(log, chunk(b"", "zstd", 1 << 20, out.getvalue()))


@kind
def zstd_cut(log: bytes) -> bytes:
    data = random.Random(3).randbytes(5000)
    return with_chunk(log, chunk(data, "zstd", None, zstandard.compress(data)[:-100]))


@kind
def zstd_junk(log: bytes) -> bytes:
    return with_chunk(log, chunk(b"", "zstd", 100, b"junk" * 20))


@kind
def chunk_holds_less_than_it_claims(log: bytes) -> bytes:
    return with_chunk(log, chunk(b"", "zstd", 5000, zstandard.compress(bytes(100))))


@kind
def unknown_compression(log: bytes) -> bytes:
    return with_chunk(log, chunk(bytes(100), "rar"))


@kind
def chunk_data_beyond_its_record(log: bytes) -> bytes:
    head = struct.pack("<QQQI", 0, 0, 10, 0) + text("") + struct.pack("<Q", 1 << 62)
    return with_chunk(log, head + bytes(10))


@kind
def chunk_of_a_million_records(log: bytes) -> bytes:
    data = raw(0x80, b"") * 1_500_000
    return with_chunk(log, chunk(data, "zstd", None, zstandard.compress(data)))


@kind
def chunk_with_a_cut_record(log: bytes) -> bytes:
    return with_chunk(log, chunk(raw(SCHEMA, bytes(50), 60)))


@kind
def chunk_checksum_wrong(log: bytes) -> bytes:
    def spoil(body: bytes) -> bytes:
        return body[:24] + bytes([body[24] ^ 1]) + body[25:]

    return build([(op, spoil(body) if op == CHUNK else body) for op, body in split(log)])


@kind
def schema_number_twice(log: bytes) -> bytes:
    return edit_body(log, SCHEMA, lambda body: struct.pack("<H", 1) + body[2:], which=1)


@kind
def channel_number_twice(log: bytes) -> bytes:
    return edit_body(log, CHANNEL, lambda body: struct.pack("<H", 1) + body[2:], which=1)


@kind
def channel_without_its_schema(log: bytes) -> bytes:
    return edit_body(log, CHANNEL, lambda body: body[:2] + struct.pack("<H", 999) + body[4:])


@kind
def no_schemas(log: bytes) -> bytes:
    return rebuild([record for record in loose(log) if record[0] != SCHEMA])


@kind
def no_channels(log: bytes) -> bytes:
    return rebuild([record for record in loose(log) if record[0] != CHANNEL])


@kind
def schema_longer_than_its_record(log: bytes) -> bytes:
    return edit_body(log, SCHEMA, lambda body: body[:-10])


@kind
def short_message(log: bytes) -> bytes:
    return rebuild([*loose(log), (MESSAGE, bytes(5))])


@kind
def message_on_an_unknown_channel(log: bytes) -> bytes:
    return rebuild([*loose(log), (MESSAGE, struct.pack("<HIQQ", 777, 0, 0, 0))])


@kind
def topics_exchanged(log: bytes) -> bytes:
    records = loose(log)
    number = channels(records)
    swapped = {number["/log"]: number["/plan/result"], number["/plan/result"]: number["/log"]}

    def swap(body: bytes) -> bytes:
        (old,) = struct.unpack_from("<H", body)
        return struct.pack("<H", swapped.get(old, old)) + body[2:]

    return rebuild([(op, swap(body) if op == MESSAGE else body) for op, body in records])


@kind
def metadata_beyond_its_record(log: bytes) -> bytes:
    return rebuild([*loose(log), (METADATA, text("x") + struct.pack("<I", 1 << 31))])


@kind
def metadata_not_utf8(log: bytes) -> bytes:
    return rebuild([*loose(log), (METADATA, text(b"\xff\xfe") + struct.pack("<I", 0))])


@kind
def metadata_altered(log: bytes) -> bytes:
    return log.replace(b"two-crates", b"six-crates", 1)


@kind
def metadata_without_checksum(log: bytes) -> bytes:
    return edit_body(log, METADATA, lambda body: metadata("pushplan.run", {"format": "1"}))


@kind
def metadata_of_the_run_twice(log: bytes) -> bytes:
    records = loose(log)
    return rebuild([*records, next(record for record in records if record[0] == METADATA)])


@kind
def no_metadata(log: bytes) -> bytes:
    return rebuild([record for record in loose(log) if record[0] != METADATA])


@kind
def no_result(log: bytes) -> bytes:
    records = loose(log)
    last = max(i for i, record in enumerate(records) if record[0] == METADATA)
    return rebuild(records[:last] + records[last + 1 :])


@kind
def newer_format(log: bytes) -> bytes:
    words = sealed({"format": "999"})
    return edit_body(log, METADATA, lambda body: metadata("pushplan.run", words))


@kind
def format_is_no_number(log: bytes) -> bytes:
    words = sealed({"format": "1; import os"})
    return edit_body(log, METADATA, lambda body: metadata("pushplan.run", words))


@kind
def planning_times_are_words(log: bytes) -> bytes:
    words = sealed({"planning_s": "soon", "first_solution_s": "none", "progress_s": "", "extensions": "1"})
    return edit_body(log, METADATA, lambda body: metadata("pushplan.planning", words), which=1)


@kind
def progress_does_not_fit(log: bytes) -> bytes:
    words = sealed({"planning_s": "1.0", "first_solution_s": "none", "progress_s": "1.0", "extensions": "1"})
    return edit_body(log, METADATA, lambda body: metadata("pushplan.planning", words), which=1)


@kind
def attachment_altered(log: bytes) -> bytes:
    return log.replace(b"mass: 1.2", b"mass: 9.9", 1)


@kind
def attachment_beyond_its_record(log: bytes) -> bytes:
    body = struct.pack("<QQ", 0, 0) + text("scenario.yaml") + text("") + struct.pack("<Q", 1 << 63) + bytes(9)
    return rebuild([(op, body if op == ATTACHMENT else old) for op, old in loose(log)])


@kind
def no_attachments(log: bytes) -> bytes:
    return rebuild([record for record in loose(log) if record[0] != ATTACHMENT])


@kind
def attachment_twice(log: bytes) -> bytes:
    records = loose(log)
    return rebuild([*records, next(record for record in records if record[0] == ATTACHMENT)])


def attachment(name: str, data: bytes) -> bytes:
    body = struct.pack("<QQ", 0, 0) + text(name) + text("") + struct.pack("<Q", len(data)) + data
    return body + struct.pack("<I", zlib.crc32(body))


def attachment_name(body: bytes) -> str:
    (length,) = struct.unpack_from("<I", body, 16)
    return body[20 : 20 + length].decode()


def content(records: list[Record], name: str) -> bytes:
    """Return what the attachment of that name holds."""
    body = next(body for opcode, body in records if opcode == ATTACHMENT and attachment_name(body) == name)
    at = 20 + len(name)
    at += 4 + struct.unpack_from("<I", body, at)[0]
    return body[at + 8 : -4]


@kind
def scenario_is_no_yaml(log: bytes) -> bytes:
    return edit_body(log, ATTACHMENT, lambda body: attachment("scenario.yaml", b"\0\1{[: *&"))


@kind
def scenario_is_a_yaml_bomb(log: bytes) -> bytes:
    bomb = b"a: &a [x, x]\n" + b"".join(
        b"%c: &%c [*%c, *%c]\n" % (98 + i, 98 + i, 97 + i, 97 + i) for i in range(20)
    )
    return edit_body(log, ATTACHMENT, lambda body: attachment("scenario.yaml", bomb))


@kind
def scenario_runs_python(log: bytes) -> bytes:
    evil = b"format: !!python/object/apply:os.system ['touch owned']\n"
    return edit_body(log, ATTACHMENT, lambda body: attachment("scenario.yaml", evil))


def one_object_less(text: bytes) -> bytes:
    return text[: text.index(b"  - name: far")] + text[text.index(b"contacts:") :].replace(b", of: far", b"")


@kind
def another_scenario(log: bytes) -> bytes:
    """Replace the scenario alone."""
    source = one_object_less(content(loose(log), "scenario.yaml"))
    return edit_body(log, ATTACHMENT, lambda body: attachment("scenario.yaml", source))


@kind
def another_scenario_with_its_metadata(log: bytes) -> bytes:
    """Replace the scenario, and everything that would give that away, so that only the contacts do not fit."""
    source = one_object_less(content(loose(log), "scenario.yaml"))
    words = sealed({"format": "1", "scenario_sha256": hashlib.sha256(source).hexdigest()})
    new = {
        "scenario.yaml": attachment("scenario.yaml", source),
        "scenario.json": attachment("scenario.json", source),
    }
    out: list[Record] = []
    for opcode, body in loose(log):
        if opcode == METADATA and b"pushplan.run" in body[:20]:
            body = metadata("pushplan.run", words)
        out.append((opcode, new.get(attachment_name(body), body) if opcode == ATTACHMENT else body))
    return rebuild(out)


@kind
def plan_is_noise(log: bytes) -> bytes:
    return edit_payload(log, "/plan/result", lambda data: random.Random(4).randbytes(len(data)))


@kind
def plan_is_cut(log: bytes) -> bytes:
    return edit_payload(log, "/plan/result", lambda data: data[:-3])


@kind
def plan_twice(log: bytes) -> bytes:
    return edit_messages(log, "/plan/result", lambda messages: messages * 2)


def _field(number: int, payload: bytes) -> bytes:
    """Encode a protobuf field of bytes, a string or packed numbers."""
    size, out = len(payload), bytearray([number << 3 | 2])
    while size > 127:
        out.append(size & 127 | 128)
        size >>= 7
    return bytes(out) + bytes([size]) + payload


def _doubles(*values: float) -> bytes:
    return struct.pack(f"<{len(values)}d", *values)


@kind
def path_with_a_number_too_many(log: bytes) -> bytes:
    return edit_payload(log, "/plan/result", lambda data: data + _field(8, _field(2, _doubles(1.0))))


@kind
def path_with_nan(log: bytes) -> bytes:
    path = _field(1, _doubles(0, 0, float("nan"))) + _field(2, _doubles(1, 0, 0)) + _field(3, _doubles(1))
    return edit_payload(log, "/plan/result", lambda data: _field(8, path))


@kind
def path_of_unscaled_twists(log: bytes) -> bytes:
    path = _field(1, _doubles(0, 0, 0)) + _field(2, _doubles(5, 0, 0)) + _field(3, _doubles(1))
    return edit_payload(log, "/plan/result", lambda data: _field(8, path))


@kind
def trajectory_back_in_time(log: bytes) -> bytes:
    body = (
        _field(1, _doubles(0, 0, 0)) + _field(2, _doubles(0, -1)) + _field(3, bytes(72)) + _field(4, bytes(8))
    )
    return edit_payload(log, "/plan/result", lambda data: _field(9, body))


@kind
def tree_of_half_a_branch(log: bytes) -> bytes:
    return edit_payload(log, "/plan/result", lambda data: data + _field(10, _doubles(1.0)))


@kind
def plan_nested_a_thousand_times(log: bytes) -> bytes:
    data = b""
    for _ in range(1000):
        data = _field(8, data)
    return edit_payload(log, "/plan/result", lambda old: data)


@kind
def samples_missing(log: bytes) -> bytes:
    return edit_messages(log, "/execution/samples", lambda messages: messages[1:])


@kind
def samples_in_another_order(log: bytes) -> bytes:
    return edit_messages(log, "/execution/samples", lambda messages: messages[::-1])


@kind
def last_samples_missing(log: bytes) -> bytes:
    return edit_messages(log, "/execution/samples", lambda messages: messages[:-1])


@kind
def samples_of_impossible_shape(log: bytes) -> bytes:
    array = _field(1, b"t") + _field(2, b"\xff\xff\xff\xff\x0f" * 3) + _field(3, bytes(8))
    return edit_payload(log, "/execution/samples", lambda data: _field(3, array))


@kind
def samples_without_poses(log: bytes) -> bytes:
    array = _field(1, b"t") + _field(2, b"\x01") + _field(3, bytes(8))
    return edit_payload(log, "/execution/samples", lambda data: _field(3, array))


@kind
def samples_of_unknown_name(log: bytes) -> bytes:
    return edit_payload(log, "/execution/samples", lambda data: data.replace(b"margins", b"bargins"))


@kind
def execution_without_end(log: bytes) -> bytes:
    return edit_messages(log, "/execution/result", lambda messages: [])


@kind
def execution_ends_twice(log: bytes) -> bytes:
    return edit_messages(log, "/execution/result", lambda messages: messages * 2)


@kind
def line_of_unknown_level(log: bytes) -> bytes:
    return edit_payload(log, "/log", lambda data: data + b"\x10\x63")


@kind
def summary_checksum_wrong(log: bytes) -> bytes:
    return log[:-12] + bytes([log[-12] ^ 1]) + log[-11:]


@kind
def summary_counts_wrong(log: bytes) -> bytes:
    records = split(log)
    out = b"".join(
        raw(op, struct.pack("<Q", 5) + body[8:] if op == STATISTICS else body) for op, body in records[:-1]
    )
    return MAGIC + out + raw(FOOTER, records[-1][1][:16] + bytes(4)) + MAGIC


@kind
def a_chunk_is_missing(log: bytes) -> bytes:
    records = split(log)
    places = [i for i, record in enumerate(records) if record[0] == CHUNK]
    return MAGIC + b"".join(raw(*record) for i, record in enumerate(records) if i != places[-1]) + MAGIC


@kind
def millions_of_records(log: bytes) -> bytes:
    head = log[: list(boundaries(log))[1]]
    return head + raw(0x80, b"") * 1_000_000 + log[len(head) :]


@kind
def chunk_index_bomb(log: bytes) -> bytes:
    entry = (
        struct.pack("<QQQQI", 0, 0, 8, 8, 0) + struct.pack("<Q", 0) + text("zstd") + struct.pack("<QQ", 0, 0)
    )
    records = split(log)
    out = b"".join(raw(*record) for record in records if record[0] == HEADER) + raw(DATA_END, bytes(4))
    start = len(MAGIC) + len(out)
    out += raw(CHUNK_INDEX, entry) * 1200
    return MAGIC + out + raw(FOOTER, struct.pack("<QQI", start, 0, 0)) + MAGIC


@kind
def summary_that_points_at_itself(log: bytes) -> bytes:
    at = list(boundaries(log))[-2]
    return log[:at] + raw(FOOTER, struct.pack("<QQI", at, at, 1)) + MAGIC


@kind
def summary_beyond_the_file(log: bytes) -> bytes:
    at = list(boundaries(log))[-2]
    return log[:at] + raw(FOOTER, struct.pack("<QQI", (1 << 64) - 1, (1 << 64) - 1, 1)) + MAGIC


@kind
def another_programs_log(log: bytes) -> bytes:
    return rebuild([(HEADER, text("ros2") + text("other")), (METADATA, metadata("rosbag2", {"a": "b"}))])


# --- harmless changes: the run must come back all the same -------------------------------------------------------

HARMLESS: dict[str, Maker] = {}


def harmless(maker: Maker) -> Maker:
    HARMLESS[maker.__name__] = maker
    return maker


@harmless
def without_chunks_or_summary(log: bytes) -> bytes:
    return rebuild(loose(log))


@harmless
def with_records_of_the_future(log: bytes) -> bytes:
    return rebuild([loose(log)[0], (0x70, b"later"), (0xF0, b"private"), *loose(log)[1:]])


@harmless
def with_things_of_others(log: bytes) -> bytes:
    path = (ATTACHMENT, attachment("../../outside.txt", b"x"))
    note = (METADATA, metadata("someone.else", {"a": "b"}))
    return rebuild([*loose(log), path, note])


@harmless
def with_a_looping_message_index(log: bytes) -> bytes:
    loop = struct.pack("<HI", 1, 16) + struct.pack("<QQ", 0, 0)
    return rebuild([*loose(log), (MESSAGE_INDEX, loop)])
