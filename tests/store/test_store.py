"""Logs of every kind: read back bit for bit and verified; every change is noticed."""

import dataclasses
import json
import math
import random
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Patch, calls_of, there
from mcap import records
from store.conftest import KINDS, Case, record_names, rewritten

import pushplan.logging.metadata as metadata
import pushplan.logging.schemas as schemas
from pushplan.errors import RunLogError
from pushplan.logging.reader import load_run
from pushplan.logging.recording import recover
from pushplan.logging.verify import verify
from pushplan.logging.writer import RunLogWriter
from pushplan.plans.execution import Execution, StabilityLoss
from pushplan.plans.load import Load
from pushplan.scenario.model import Scenario
from pushplan.verification import execute_again, verify_log

EVERY = pytest.mark.parametrize("kind", KINDS)


def assert_same(first: Any, second: Any) -> None:
    """Compare objects, arrays and numbers bit for bit, and loads and scenarios by their contents."""
    if isinstance(first, Load):
        assert first.links == second.links
        assert_same(first.chain.places, second.chain.places)
    elif isinstance(first, Scenario):
        assert first == second
    elif dataclasses.is_dataclass(first):
        for field in dataclasses.fields(first):
            assert_same(getattr(first, field.name), getattr(second, field.name))
    elif isinstance(first, np.ndarray):
        assert (first.shape, first.dtype, first.tobytes()) == (second.shape, second.dtype, second.tobytes())
    elif isinstance(first, tuple):
        assert len(first) == len(second)
        for a, b in zip(first, second, strict=True):
            assert_same(a, b)
    elif isinstance(first, dict):
        assert first.keys() == second.keys()
        for key in first:
            assert_same(first[key], second[key])
    else:
        assert first == second or (first != first and second != second)


@EVERY
def test_logs_are_read_back_bit_for_bit(kind: str, cases: dict[str, Case], logs: dict[str, Path]) -> None:
    run, case = load_run(logs[kind]), cases[kind]
    assert_same(run.plan, dataclasses.replace(case.plan, execution=case.execution))
    assert_same(run.execution, case.execution)
    assert run.losses == ()
    if case.feedback is not None:
        assert run.feedback is not None
        assert_same(run.feedback.measured, case.feedback.measured)
        assert_same(run.feedback.events, case.feedback.events)
        assert [replan.reason for replan in run.feedback.replans] == ["", "nothing found"]
    assert "a line of somebody" in [line.text for line in run.lines]
    if run.execution is not None:
        assert not run.execution.objects.flags.writeable


@EVERY
def test_every_kind_of_log_is_verified_by_reading_it_once(kind: str, logs: dict[str, Path]) -> None:
    assert calls_of(partial(verify_log, logs[kind]), "McapFile.__init__") == 1
    report = verify_log(logs[kind])
    assert [check.text for check in report.mismatches] == []
    assert report.versions == ()
    assert ("measured pose (it does not follow from the plan)" in report.not_compared) == (kind == "closed loop")
    expected = {"push", "multi-push", "rearrangement", "trial"}
    assert ({"pose", "margin", "goal error"} <= {check.quantity for check in report.checks}) == (kind in expected)


@pytest.mark.parametrize(("off", "which"), [((0.1, 0.5, 0.2), 1), ((0.5, math.nan, 1e-12), 1), ((0.5, 0.1, 0.2), 0)])
def test_the_largest_difference_of_a_quantity_is_reported(
    off: tuple[float, ...], which: int, logs: dict[str, Path]
) -> None:
    run = load_run(logs["push"], messages=True)
    twists = [k for k, message in enumerate(run.messages) if message.topic == "/pusher/twist"][5:8]
    altered = list(run.messages)
    for k, difference in zip(twists, off, strict=True):
        message = schemas.PUSHER_TWIST.message.FromString(altered[k].data)
        message.vx += difference
        altered[k] = altered[k]._replace(data=message.SerializeToString(deterministic=True))
    (check,) = verify(dataclasses.replace(run, messages=tuple(altered)), execute_again).mismatches
    assert check.quantity == "/pusher/twist vx"
    assert check.difference == pytest.approx(off[which], nan_ok=True)
    assert check.time == pytest.approx(1e-9 * run.messages[twists[which]].time)


def test_lost_contacts_are_compared(logs: dict[str, Path]) -> None:
    run = load_run(logs["push"], messages=True)

    def lost(time: float | None, contact: str = "a-b") -> Execution:
        loss = None if time is None else StabilityLoss(time, 0, "b", contact, 0.0, (0.0, 0.0, 0.0))
        return dataclasses.replace(there(run.execution), loss=loss)

    def apart(recorded: Execution, again: Execution) -> list[float]:
        report = verify(dataclasses.replace(run, execution=recorded), lambda _: again)
        return [check.difference for check in report.checks if check.quantity == "lost contact"]

    assert apart(lost(None), lost(None)) == []
    assert apart(lost(1.0), lost(1.25)) == [0.25]
    assert apart(lost(1.0), lost(None)) == apart(lost(None), lost(1.0)) == [math.inf]
    assert apart(lost(1.0), lost(1.0, "plate-a")) == [math.inf]


def noticed(path: Path) -> bool:
    try:
        return not verify_log(path).matches
    except RunLogError:
        return True


def changed(record: Any, topic: str) -> list[Any]:
    """Return a record with one value or one bit changed; None for an empty record."""
    if isinstance(record, records.Metadata):
        key = next(key for key in record.metadata if key not in ("format", "sha256"))
        words = {**record.metadata, key: record.metadata[key] + "1"}
        return [dataclasses.replace(record, metadata=words)]
    if isinstance(record, records.Schema):
        return [dataclasses.replace(record, data=record.data + b"\0")]
    if isinstance(record, records.Channel):
        return [dataclasses.replace(record, metadata={"topic": "of somebody"})]
    if isinstance(record, records.Message):
        message = KINDS_OF[topic].message.FromString(record.data)
        altered = _alter(message)
        return [dataclasses.replace(record, data=message.SerializeToString())] if altered else []
    data = bytearray(record.data)
    data[len(data) // 2] ^= 1
    return [dataclasses.replace(record, data=bytes(data))]


KINDS_OF = {topic.name: topic for topic in schemas.TOPICS}


def _alter(message: Any) -> bool:
    """Change the last value of a message; return whether it has one."""
    for field, value in reversed(message.ListFields()):
        several = hasattr(value, "extend")
        if field.message_type is not None:
            if _alter(value[len(value) // 2] if several else value):
                return True
            continue
        old = value[0] if several else value
        new = f"{old}x" if isinstance(old, str) else type(old)(not old)
        if several:
            value[0] = new
        else:
            setattr(message, field.name, new)
        return True
    return False


def test_every_change_of_a_topic_attachment_or_metadata_is_noticed(logs: dict[str, Path], tmp_path: Path) -> None:
    """One record of each is changed or dropped, some are repeated or moved, in the smallest log with such a record;
    the file stays valid MCAP.
    """
    passed = []
    groups: dict[str, tuple[str, list[Any]]] = {}
    for kind in sorted(KINDS, key=lambda kind: logs[kind].stat().st_size):
        for name, found in record_names(logs[kind]).items():
            groups.setdefault(re.sub(r"\d+", "N", name), (kind, found))
    assert {kind for kind, _ in groups.values()} >= {"multi-push", "closed loop", "trial"}
    for name, (kind, found) in groups.items():
        victim = found[len(found) // 2]
        edits = {"changed": changed(victim, name), "dropped": []}
        edits |= {"twice": [victim, victim]} if name in ("/tf", "execution/N.bin") else {}
        for word in ("log_time", "publish_time", "sequence") if name == "/tf" else ():
            edits[word] = [dataclasses.replace(victim, **{word: getattr(victim, word) + 1})]
        if name in ("schema", "channel"):
            del edits["dropped"]  # no file at all
        for how, instead in edits.items():

            def edit(record: Any, victim: Any = victim, instead: list[Any] = instead) -> Iterator[Any]:
                yield from instead if record == victim else [record]

            altered = rewritten(logs[kind], tmp_path / "altered.mcap", edit)
            if not noticed(altered):
                passed.append((name, how))
    assert passed == []


def test_a_resolved_scenario_that_contradicts_its_file_is_noticed_though_the_digest_fits(
    logs: dict[str, Path], tmp_path: Path
) -> None:
    digest = metadata.Digest()

    def forged(record: Any) -> Iterator[Any]:
        if isinstance(record, records.Attachment):
            if record.name == "scenario.json":
                told = json.loads(record.data)
                told["objects"][0]["mass"] = 1.3
                record = dataclasses.replace(record, data=json.dumps(told).encode())
            digest.add(record.name, record.data)
        elif isinstance(record, records.Metadata):
            digest.add_words(record.name, record.metadata)
            if metadata.DIGEST in record.metadata:
                words = {**record.metadata, metadata.DIGEST: digest.hexdigest()}
                record = dataclasses.replace(record, metadata=words)
        yield record

    report = verify_log(rewritten(logs["push"], tmp_path / "run.mcap", forged))
    assert "scenario.json: differs from the resolved scenario file" in [c.text for c in report.mismatches]


def test_a_truncated_log_is_read_up_to_its_end_or_refused(
    cases: dict[str, Case], logs: dict[str, Path], tmp_path: Path
) -> None:
    data, rng, read = logs["push"].read_bytes(), random.Random(2), 0
    whole = there(cases["push"].execution)
    for k in range(10):
        cut = tmp_path / f"{k}.mcap.partial"
        cut.write_bytes(data[: rng.randrange(len(data))])
        with pytest.raises(RunLogError):
            load_run(cut, recover=False)
        try:
            run = load_run(cut)
        except RunLogError:
            continue
        read += 1
        assert run.losses
        if run.execution is not None:
            np.testing.assert_array_equal(run.execution.poses, whole.poses[: len(run.execution.t)])
            assert not any("segment" in check.quantity for check in verify_log(cut).mismatches)
        recover(cut, tmp_path / f"{k}.mcap")
        assert load_run(tmp_path / f"{k}.mcap").fields["pushplan.recovery"]["from"] == cut.name
    assert read > 3


def test_every_written_part_is_in_the_file_at_once(
    cases: dict[str, Case], tmp_path: Path, monkeypatch: Patch
) -> None:
    """After a kill at any attachment, the file has every attachment up to it."""
    case, attach, names, files = cases["closed loop"], RunLogWriter._attach, list[str](), list[bytes]()

    def noted(log: RunLogWriter, name: str, data: bytes, *more: Any) -> None:
        attach(log, name, data, *more)
        names.append(name)
        files.append((tmp_path / "run.mcap.partial").read_bytes())

    monkeypatch.setattr(RunLogWriter, "_attach", noted)
    case.write(tmp_path / "run.mcap")
    cut = tmp_path / "cut.mcap.partial"
    for count in range(4, len(files) + 1):
        cut.write_bytes(files[count - 1])
        run = load_run(cut)
        assert (run.plan is not None) == ("plan.bin" in names[:count])
        seconds = sum(name.startswith("execution/") for name in names[:count])
        samples = 0 if run.execution is None else len(run.execution.t)
        assert samples >= min(100 * seconds, len(there(case.execution).t))


def test_the_same_run_gives_the_same_bytes_but_for_the_clock(cases: dict[str, Case], tmp_path: Path) -> None:
    case = cases["multi-push"]
    slower = dataclasses.replace(case.plan, planning_s=123.0, first_solution_s=4.0, iterations=7)
    logs = [
        one.write(tmp_path / f"{k}.mcap").read_bytes()
        for k, one in enumerate((case, dataclasses.replace(case, plan=slower)))
    ]
    assert len(logs[0]) == len(logs[1])
    first, second = (record_names(tmp_path / f"{k}.mcap") for k in (0, 1))
    assert first.keys() == second.keys()
    for name in first:
        for a, b in zip(first[name], second[name], strict=True):
            if not isinstance(a, records.Metadata):
                assert a == b
                continue
            differing = {key for key in a.metadata if a.metadata[key] != b.metadata[key]}
            assert all(key.endswith(("_s", "_at")) or key in ("sha256", "iterations") for key in differing)
