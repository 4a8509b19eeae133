"""Hostile files end in one typed error after little work; a run is recorded as it grows, in the right folder."""

import json
import os
import resource
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from conftest import Patch, calls_of, there
from store.conftest import Case

import pushplan
from pushplan.errors import OutputError, RunLogError
from pushplan.logging.codec import CodecError, decode
from pushplan.logging.mcap_file import MAGIC, McapFile
from pushplan.logging.reader import load_run
from pushplan.logging.recording import IncompleteLogError, Recording, recover
from pushplan.logging.runs import FOLDER, runs_folder, runs_of
from pushplan.logging.writer import RunLogWriter
from pushplan.scenario.file import load_scenario
from pushplan.verification import verify_log

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, METADATA, DATA_END = 1, 2, 3, 4, 5, 6, 12, 15


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(value: str) -> bytes:
    return struct.pack("<I", len(value.encode())) + value.encode()


def chunk(data: bytes, size: int, compression: str = "zstd", checksum: int = 0) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, checksum)
    return record(CHUNK, head + text(compression) + struct.pack("<Q", len(data)) + data)


def mcap(*parts: bytes) -> bytes:
    end = record(DATA_END, bytes(4)) + record(FOOTER, bytes(20))
    return MAGIC + record(HEADER, text("") + text("")) + b"".join(parts) + end + MAGIC


CHANNELS = record(SCHEMA, struct.pack("<H", 1) + text("a") + text("protobuf") + text("")) + record(
    CHANNEL, struct.pack("<HH", 1, 1) + text("/a") + text("protobuf") + struct.pack("<I", 0)
)
TINY = record(MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0))
ZEROS = zstandard.compress(bytes(32 << 20))
MANY = chunk(zstandard.compress(TINY * 500_000), 500_000 * len(TINY))
FILES: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", "not an MCAP file"),
    "another kind": (lambda: b"%PDF-1.7" + bytes(99), "not an MCAP file"),
    "no end": (lambda: MAGIC + record(HEADER, text("") + text("")), "without a footer"),
    "more behind the end": (lambda: mcap() + b"x", "does not end after its footer"),
    "a record beyond the file": (lambda: MAGIC + record(METADATA, b"", 1 << 40), "ends inside a record"),
    "a chunk that claims exabytes": (lambda: mcap(chunk(ZEROS, 1 << 60)), "claims 1152921504606846976 bytes"),
    "a chunk that lies": (lambda: mcap(chunk(ZEROS, 1000)), "claims 1000 bytes and holds 33554432"),
    "bombs": (lambda: mcap(*[chunk(ZEROS, 32 << 20)] * 40), "far more (data|records) than its size"),
    "junk": (lambda: mcap(chunk(b"junk" * 9, 100)), "damaged zstd data|claims"),
    "another compression": (lambda: mcap(chunk(b"", 0, "br")), "compression 'br'; pushplan reads '', 'lz4' and"),
    "lz4 junk": (lambda: mcap(chunk(b"junk" * 9, 100, "lz4")), "damaged lz4 data"),
    "lz4 that lies": (lambda: mcap(chunk(lz4.frame.compress(bytes(32 << 20)), 1000, "lz4")), "claims 1000 bytes"),
    "lz4 cut short": (lambda: mcap(chunk(lz4.frame.compress(bytes(99))[:-9], 99, "lz4")), "and holds|lz4 data"),
    "a wrong checksum": (lambda: mcap(chunk(b"1234", 4, "", 7)), "checksum of a chunk is wrong"),
    "a cut record in a chunk": (lambda: mcap(chunk(record(MESSAGE, b"", 99), 9, "")), "ends inside a record"),
    "a message of nobody": (lambda: mcap(chunk(TINY, len(TINY), "")), "channel 1, which is not declared"),
    "a million messages": (lambda: mcap(CHANNELS, *[MANY] * 5), "far more records than its size allows"),
    "a million records": (lambda: mcap(record(128, b"") * 300_000), "far more records than its size allows"),
    "text that is none": (lambda: mcap(record(METADATA, b"\2\0\0\0\xff\xff")), "damaged metadata"),
    "a field beyond its record": (lambda: mcap(record(METADATA, struct.pack("<I", 999))), "damaged metadata"),
    "metadata of megabytes": (lambda: mcap(record(METADATA, bytes(2 << 20))), "metadata of 2097152 bytes"),
    "no run": (lambda: mcap(), "without the metadata 'pushplan.run'"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_hostile_file_ends_in_one_error_with_its_place(name: str, tmp_path: Path) -> None:
    make, expected = FILES[name]
    path = tmp_path / "evil.mcap"
    path.write_bytes(make())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(RunLogError, match=expected) as caught:
        load_run(path, messages=True)
    assert caught.value.offset is not None
    assert calls_of(partial(load_run, path, messages=True)) < 300_000
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400_000  # kB
    with pytest.raises(RunLogError):  # nothing in it can be recovered
        load_run(path, recover=True)


def _attachment(value: object, arrays: object = (), size: int = 0, data: bytes = b"") -> bytes:
    head = json.dumps({"value": value, "arrays": arrays}).encode()
    return b"pushplan-arrays/1 %d\n" % size + head + b"\n" + zstandard.compress(data)


EVENT: dict[str, object] = {"type": "Event", "time": 0.0, "kind": "plan"}
VALUES = {
    "another version": b"pushplan-arrays/2 0\n{}\n",
    "no line": b"pushplan-arrays/1 8\n{",
    "a size that lies": _attachment(1, size=1 << 40),
    "more than it states": _attachment(1, size=8, data=bytes(64)),
    "an array beyond its bytes": _attachment({"array": 0}, [["<f8", [9]]], 8, bytes(8)),
    "an array of exabytes": _attachment({"array": 0}, [["<f8", [1 << 60, 0]]]) + b"rest",
    "an array of objects": _attachment({"array": 0}, [["|O", [1]]], 8, bytes(8)),
    "no such array": _attachment({"array": 5}),
    "no such type": _attachment({"type": "Popen", "args": "true"}),
    "no such field": _attachment({**EVENT, "text": "", "x": 1}),
    "a field of another type": _attachment({**EVENT, "time": "now", "text": ""}),
    "fields that are missing": _attachment({"type": "Event"}),
    "no such load": _attachment({"type": "Load", "names": ["x"], "face": "", "offset": 0.0}),
    "nested deeply": b"pushplan-arrays/1 0\n" + b"[" * 100_000 + b"\n" + zstandard.compress(b""),
}


@pytest.mark.parametrize("name", VALUES)
def test_a_foreign_attachment_is_refused(name: str) -> None:
    scenario = load_scenario("one-box")
    with pytest.raises(CodecError):
        decode(VALUES[name], scenario)


@pytest.mark.parametrize("what", ["missing", "folder", "pipe", "link to itself", "device"])
def test_folders_pipes_links_and_devices_are_refused(what: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    match what:
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "link to itself":
            path.symlink_to(path)
        case "device":
            path.symlink_to("/dev/zero")
    with pytest.raises(RunLogError) as caught:
        list(McapFile(path).items())
    assert str(caught.value).startswith(f"{path}: ")


def test_a_recorded_run_is_found_in_the_folder_and_verified(cases: dict[str, Case], tmp_path: Path) -> None:
    plan = cases["rearrangement"].plan
    with Recording(plan.scenario, {"seed": plan.seed, "planner": plan.planner}, runs=tmp_path) as recording:
        for improvement in plan.improvements:
            recording.improved(improvement)
        recording.end(plan)
    run = recording.finished(plan)
    assert there(run.log).parent == tmp_path
    assert verify_log(there(run.log)).matches
    (entry,) = runs_of(tmp_path)
    assert (entry.outcome, entry.seed, entry.cost) == ("solved", str(plan.seed), plan.cost)


def test_an_unwritable_log_is_an_error_only_if_it_was_named(
    cases: dict[str, Case], tmp_path: Path, monkeypatch: Patch
) -> None:
    plan = cases["push"].plan
    with pytest.raises(OutputError, match="there is no folder"):
        Recording(plan.scenario, {"seed": 1}, tmp_path / "no" / "run.mcap")

    def full(*_: object) -> None:
        raise OutputError("the log", "No space left on device")

    monkeypatch.setattr("pushplan.logging.writer.RunLogWriter.plan", full)
    told: list[str] = []
    with Recording(plan.scenario, {"seed": 1}, runs=tmp_path, message=told.append) as recording:
        recording.end(plan)
    assert recording.finished(plan).log is None
    assert "this run is not recorded: the log: No space left" in told[0]
    with Recording(plan.scenario, {"seed": 1}, tmp_path / "run.mcap") as recording:
        recording.end(plan)
    with pytest.raises(IncompleteLogError, match=r"incomplete log is in .*run\.mcap\.partial") as caught:
        recording.finished(plan)
    assert caught.value.run.plan is plan


@pytest.mark.parametrize("value", [None, "", ".", "state", "../state", "~/state"])
def test_an_unset_empty_or_relative_folder_of_states_is_not_in_the_working_directory(
    value: str | None, monkeypatch: Patch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", "/home/somebody")
    monkeypatch.setenv(FOLDER, "")
    if value is None:
        monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    else:
        monkeypatch.setenv("XDG_STATE_HOME", value)
    assert runs_folder() == Path("/home/somebody/.local/state/pushplan/runs")


def test_a_run_that_fails_is_recorded_as_failed(tmp_path: Path) -> None:
    def broken(improvement: object) -> None:
        raise ValueError("of the user")

    log = tmp_path / "run.mcap"
    with pytest.raises(ValueError, match="of the user"):
        pushplan.run(load_scenario("one-box"), log=log, observer=pushplan.Observer(improved=broken), time_limit=9.0)
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]
    run = load_run(log)
    assert run.outcome == "failed"
    assert run.lines[-1].text == "failed: ValueError: of the user"
    assert verify_log(log).matches


def test_a_recovery_that_fails_leaves_nothing_behind(
    cases: dict[str, Case], tmp_path: Path, monkeypatch: Patch
) -> None:
    source, folder = cases["push"].write(tmp_path / "run.mcap"), tmp_path / "out"
    folder.mkdir()

    def full(*_: object) -> None:
        raise OutputError("out.mcap", "No space left on device")

    monkeypatch.setattr(RunLogWriter, "execution", full)
    with pytest.raises(OutputError, match="No space"):
        recover(source, folder / "out.mcap")
    assert [*folder.iterdir()] == []
