"""Logs rewritten by other tools, and logs of older versions of pushplan: read and verified."""

import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import Patch
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap import records
from mcap.writer import CompressionType, Writer
from store.conftest import Case, record_names, rewritten

import pushplan.logging.metadata as metadata
import pushplan.logging.schemas as schemas
import pushplan.logging.verify as verify
from pushplan.errors import RunLogError
from pushplan.logging.reader import load_run
from pushplan.logging.topics import messages
from pushplan.verification import verify_log

Records = list[tuple[str, Any]]


def _sorted_by_name(found: Records) -> Records:
    return sorted(found, key=lambda one: one[0])


def _shuffled(found: Records) -> Records:
    """Return attachments and metadata in random order between the messages; messages of a topic keep their order."""
    topics = [one for one in found if isinstance(one[1], records.Message)]
    others = [one for one in found if not isinstance(one[1], records.Message)]
    random.Random(1).shuffle(others)
    return [*others[::2], *_sorted_by_name(topics), *others[1::2]]


WAYS: dict[str, tuple[Callable[[Records], Records], dict[str, Any]]] = {
    "sort": (_sorted_by_name, {}),
    "rechunk by topic": (_shuffled, {"chunk_size": 4096}),
    "compress lz4": (list, {"compression": CompressionType.LZ4}),
    "compress none": (list, {"compression": CompressionType.NONE}),
    "without chunks": (list, {"use_chunking": False}),
}


def _again(log: Path, to: Path, order: Callable[[Records], Records], options: dict[str, Any], foreign: bool) -> Path:
    """Write a log again with its records in another order, other chunks, and foreign records."""
    names = record_names(log)
    ids = {channel.id: channel for channel in names.pop("channel")}
    kinds = {schema.id: schema for schema in names.pop("schema")}
    with to.open("wb") as target:
        writer = Writer(target, **options)
        writer.start()
        known: dict[int, int] = {}
        for number, channel in ids.items():
            kind = kinds[channel.schema_id]
            schema = writer.register_schema(kind.name, kind.encoding, kind.data)
            known[number] = writer.register_channel(channel.topic, channel.message_encoding, schema)
        if foreign:
            camera = writer.register_channel("/camera", "json", 0)
            writer.add_message(camera, 5, b"{}", 5)
            writer.add_attachment(0, 0, "calibration.yaml", "text/plain", b"focal: 1")
            writer.add_metadata("robot", {"name": "of somebody"})
        for name, one in order([(name, one) for name, several in names.items() for one in several]):
            if isinstance(one, records.Message):
                writer.add_message(known[one.channel_id], one.log_time, one.data, one.publish_time, one.sequence)
            elif isinstance(one, records.Attachment):
                writer.add_attachment(one.create_time, one.log_time, name, one.media_type, one.data)
            else:
                writer.add_metadata(name, one.metadata)
        writer.finish()  # type: ignore[no-untyped-call]
    return to


@pytest.mark.parametrize("way", WAYS)
def test_a_log_that_another_tool_wrote_again_is_verified(way: str, logs: dict[str, Path], tmp_path: Path) -> None:
    order, options = WAYS[way]
    log = _again(logs["push"], tmp_path / "run.mcap", order, options, foreign=False)
    assert [check.text for check in verify_log(log).mismatches] == []


def test_foreign_records_in_a_log_are_named_and_not_compared(logs: dict[str, Path], tmp_path: Path) -> None:
    log = _again(logs["push"], tmp_path / "run.mcap", _sorted_by_name, {}, foreign=True)
    report = verify_log(log)
    assert report.matches
    assert {"topic /camera (not of pushplan)", "calibration.yaml (not of pushplan)"} <= {*report.not_compared}
    plan = record_names(logs["push"])["plan.bin"]
    two = rewritten(logs["push"], tmp_path / "two.mcap", lambda one: iter([one, one] if one in plan else [one]))
    with pytest.raises(RunLogError, match=r"plan\.bin.*the name is used twice"):
        load_run(two)


def test_a_damaged_lz4_chunk_is_refused(logs: dict[str, Path], tmp_path: Path) -> None:
    log = _again(logs["push"], tmp_path / "run.mcap", list, WAYS["compress lz4"][1], foreign=False)
    data = log.read_bytes()
    at = data.index(b"\x04\x22\x4d\x18")  # the first bytes of a frame
    for bad in (b"\0" * 40, data[at : at + 40][::-1]):
        log.write_bytes(data[:at] + bad + data[at + 40 :])
        with pytest.raises(RunLogError, match="lz4 data"):
            load_run(log)


def test_older_logs_are_verified_after_a_topic_is_added(
    logs: dict[str, Path], cases: dict[str, Case], tmp_path: Path, monkeypatch: Patch
) -> None:
    new = schemas.Topic("/new", schemas.PUSHER_TWIST.message, since=schemas.REVISION + 1)

    def more(run: Any) -> Iterator[Any]:
        yield 0, new, schemas.PUSHER_TWIST.message(vx=1.0).SerializeToString()
        yield from messages(run)

    monkeypatch.setattr(schemas, "TOPICS", (*schemas.TOPICS, new))
    monkeypatch.setattr(verify, "messages", more)
    report = verify_log(logs["push"])
    assert [check.text for check in report.mismatches] == []
    assert "topic /new (the log is older)" in report.not_compared
    monkeypatch.setattr(schemas, "REVISION", new.since)  # a current log must have it
    report = verify_log(cases["push"].write(tmp_path / "run.mcap"))
    assert [check.text for check in report.mismatches] == ["/new: 0 messages instead of 1"]


def test_older_logs_are_verified_after_a_field_is_added(logs: dict[str, Path], tmp_path: Path) -> None:
    """The log is one of a version without `omega`; a log with another type of it is refused."""

    def without(record: Any, number: int = 5) -> Iterator[Any]:
        if isinstance(record, records.Schema) and record.name == "pushplan.Twist":
            told = FileDescriptorSet.FromString(record.data)
            (message,) = next(file for file in told.file if file.name == "pushplan/Twist.proto").message_type
            if number == 5:
                del message.field[4]
            else:
                message.field[4].number = number
            record = replace(record, data=told.SerializeToString())
        elif isinstance(record, records.Message) and record.channel_id in twists:
            message = schemas.PUSHER_TWIST.message.FromString(record.data)
            message.ClearField("omega")
            record = replace(record, data=message.SerializeToString(deterministic=True))
        yield record

    twists = {one.channel_id for one in record_names(logs["push"])["/pusher/twist"]}
    report = verify_log(rewritten(logs["push"], tmp_path / "older.mcap", without))
    assert [check.text for check in report.mismatches] == []
    assert "field Twist.omega (the log has none)" in report.not_compared
    other = rewritten(logs["push"], tmp_path / "other.mcap", lambda record: without(record, 7))
    assert "/pusher/twist schema: declared differently" in [c.text for c in verify_log(other).mismatches]


def test_a_log_of_another_format_is_reported(logs: dict[str, Path], tmp_path: Path) -> None:
    def aged(record: Any) -> Iterator[Any]:
        if isinstance(record, records.Metadata) and record.name == metadata.RUN:
            record = replace(record, metadata={**record.metadata, "format": "2", "version.pushplan": "0.1"})
        yield record

    with pytest.raises(RunLogError, match=r"format 2 from pushplan 0\.1; this version reads format 3"):
        load_run(rewritten(logs["push"], tmp_path / "old.mcap", aged))
