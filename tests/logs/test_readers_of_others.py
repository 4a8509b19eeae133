"""Readers that this project did not write accept the log and understand every message.

The one of JavaScript runs where its packages are: `npm install` in a copy DIR of the folder with `package.json`, and
PUSHPLAN_NODE_MODULES=DIR/node_modules.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import NonSeekingReader, SeekingReader
from mcap_protobuf.decoder import DecoderFactory

NODE_MODULES = os.environ.get("PUSHPLAN_NODE_MODULES", "")
JAVASCRIPT = Path(__file__).with_name("read_with_javascript.cjs")


@pytest.fixture(scope="module")
def decoded(whole_log: bytes, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    """Return the messages of each topic: (record, decoded message)."""
    path = tmp_path_factory.mktemp("others") / "run.mcap"
    path.write_bytes(whole_log)
    found = defaultdict(list)
    with path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, record, message in reader.iter_decoded_messages(log_time_order=False):
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            assert message.DESCRIPTOR.full_name == schema.name
            found[channel.topic].append((record, message))
    return found


def test_every_topic_is_there(decoded: dict[str, list[Any]]) -> None:
    assert set(decoded) == {
        "/scene",
        "/contacts",
        "/tf",
        "/plan/result",
        "/plan/path",
        "/plan/smoothed",
        "/plan/tree",
        "/plan/nearest",
        "/planner/progress",
        "/planner/costs",
        "/pusher/pose",
        "/pusher/twist",
        "/margins",
        "/execution/samples",
        "/execution/result",
        "/log",
    }


def test_times_are_simulated_and_agree_and_messages_are_numbered(
    decoded: dict[str, list[Any]], case: Any
) -> None:
    for pairs in decoded.values():
        times = [record.log_time for record, _ in pairs]
        assert times == sorted(times) == [record.publish_time for record, _ in pairs]
        assert [record.sequence for record, _ in pairs] == list(range(len(pairs)))
        for record, message in pairs:
            if hasattr(message, "timestamp"):
                assert message.timestamp.ToNanoseconds() == record.log_time
    for record, message in decoded["/contacts"]:
        assert {entity.timestamp.ToNanoseconds() for entity in message.entities} == {record.log_time}
    last = max(record.log_time for pairs in decoded.values() for record, _ in pairs)
    assert last == round(case.execution.t[-1] * 1e9)


def test_frames_place_every_body(decoded: dict[str, list[Any]], case: Any) -> None:
    for _, message in decoded["/tf"]:
        pairs = [(t.parent_frame_id, t.child_frame_id) for t in message.transforms]
        assert pairs == [("world", "chain"), ("chain", "pusher"), ("chain", "near"), ("chain", "far")]
    moving = decoded["/tf"][-1][1].transforms[0]
    x, y, theta = case.execution.poses[-1]
    assert (moving.translation.x, moving.translation.y) == (x, y)
    assert 2.0 * math.atan2(moving.rotation.z, moving.rotation.w) == pytest.approx(theta, abs=1e-12)
    frames = {t.child_frame_id for t in decoded["/tf"][0][1].transforms} | {"world"}
    entities = [e for topic in ("/scene", "/plan/tree") for _, m in decoded[topic] for e in m.entities]
    assert {entity.frame_id for entity in entities} <= frames
    assert len({entity.id for entity in entities}) == len(entities)
    assert all(entity.frame_locked and entity.lifetime.ToNanoseconds() == 0 for entity in entities)


def test_triangles_cover_a_body_that_is_not_convex(decoded: dict[str, list[Any]], case: Any) -> None:
    (_, scene) = decoded["/scene"][0]
    (far,) = (entity for entity in scene.entities if entity.id == "object/far")
    points = np.array([(p.x, p.y) for p in far.triangles[0].points]).reshape(-1, 3, 2)
    a, b = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
    assert area == pytest.approx(0.1 * 0.08 - 0.5 * 0.08 * 0.04)
    assert far.lines[0].type == far.lines[0].LINE_LOOP


def test_margins_show_what_is_known(decoded: dict[str, list[Any]], case: Any) -> None:
    shown = {round(record.log_time / 1e7): message for record, message in decoded["/margins"]}
    for i in (0, 100, len(case.execution.t) - 1):
        message = shown[round(case.execution.t[i] * 100)]
        assert [c.name for c in message.contacts] == ["pusher-near", "near-far"]
        for k, contact in enumerate(message.contacts):
            assert contact.margin == case.execution.margins[i, k]
            assert contact.friction_margin == case.execution.friction_margins[i, k]
            assert getattr(contact, "lambda") == case.execution.lambdas[i, k]
            assert (contact.force.x, contact.force.y) == tuple(case.execution.forces[i, k])
            ends = case.scenario.chain.contacts[k]
            expected = ends.right + case.execution.lambdas[i, k] * (ends.left - ends.right)
            assert (contact.point.x, contact.point.y) == tuple(expected)
    smallest = [min(m.contacts[k].margin for m in shown.values()) for k in range(2)]
    assert smallest == case.execution.margins.min(axis=0).tolist()


def test_contacts_show_segment_cone_and_force(decoded: dict[str, list[Any]], case: Any) -> None:
    (first, resting), *pushed = decoded["/contacts"]
    assert first.log_time == 0
    assert {(len(e.triangles), len(e.lines)) for e in resting.entities} == {(2, 1)}  # a cone at either end
    forces, size = case.execution.forces, np.sqrt(np.median([0.10 * 0.08, 0.1 * 0.08 - 0.5 * 0.08 * 0.04]))
    largest = np.hypot(*np.moveaxis(forces, -1, 0)).max()
    for record, message in pushed:
        i = np.flatnonzero(np.rint(case.execution.t * 1e9) == record.log_time)[0]
        for k, (entity, contact) in enumerate(
            zip(message.entities, case.scenario.chain.contacts, strict=True)
        ):
            assert (entity.id, entity.frame_id) == (f"contact/{('pusher-near', 'near-far')[k]}", "chain")
            (cone, head), (segment, shaft) = entity.triangles, entity.lines
            assert [(p.x, p.y) for p in segment.points] == [tuple(contact.right), tuple(contact.left)]
            point = contact.right + case.execution.lambdas[i, k] * (contact.left - contact.right)
            apex, low, high = (np.array([p.x, p.y]) for p in cone.points)
            np.testing.assert_allclose((shaft.points[0].x, shaft.points[0].y), point)
            np.testing.assert_allclose(apex, point)
            tip = np.array([head.points[0].x, head.points[0].y])
            np.testing.assert_allclose(tip - point, 0.9 * size * forces[i, k] / largest, atol=1e-12)
            for edge in (low - apex, high - apex):
                assert abs(edge @ contact.tangent) == pytest.approx(
                    contact.friction * (edge @ contact.normal)
                )
            painted = {(p.color.r, p.color.g, p.color.b) for p in (cone, head, segment, shaft)}
            assert len(painted) == 1


def test_the_costs_are_one_message_of_two_columns(decoded: dict[str, list[Any]], case: Any) -> None:
    ((_, costs),) = decoded["/planner/costs"]
    assert list(costs.iterations) == [point.iterations for point in case.plan.progress]
    assert list(costs.cost) == [point.cost for point in case.plan.progress]


def test_what_nobody_knows_is_left_out(case: Any, tmp_path: Path) -> None:
    path = case.unknown_loads().write(tmp_path / "run.mcap")
    with path.open("rb") as stream:
        reader = SeekingReader(stream, decoder_factories=[DecoderFactory()])
        for _, _, _, message in reader.iter_decoded_messages(topics=["/margins"]):
            for contact in message.contacts:
                assert {field.name for field, _ in contact.ListFields()} == {"name", "margin"}


def test_paths_are_drawn(decoded: dict[str, list[Any]], case: Any) -> None:
    for topic, end in (
        ("/plan/path", case.plan.path.end),
        ("/plan/smoothed", case.plan.trajectory.poses[-1]),
    ):
        ((_, message),) = decoded[topic]
        assert message.frame_id == "world"
        last = message.poses[-1].position
        np.testing.assert_allclose((last.x, last.y), end[:2], atol=1e-12)


def test_the_stream_reader_checks_every_checksum(whole_log: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(whole_log)
    with path.open("rb") as stream:
        count = Counter(c.topic for _, c, _ in NonSeekingReader(stream, validate_crcs=True).iter_messages())
    assert count["/execution/samples"] == 4
    with path.open("rb") as stream:
        summary = SeekingReader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == count.total()
    assert summary.statistics.attachment_count == 3


@pytest.mark.skipif(not shutil.which("node"), reason="needs node")
@pytest.mark.skipif(
    not NODE_MODULES, reason="needs PUSHPLAN_NODE_MODULES with @mcap/core, @mcap/support, protobufjs"
)
def test_the_strict_reader_of_javascript_understands_every_message(
    whole_log: bytes, tmp_path: Path, decoded: dict[str, list[Any]], case: Any
) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(whole_log)
    command = ["node", str(JAVASCRIPT), NODE_MODULES, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["indexed"] == told["streamed"] == {topic: len(pairs) for topic, pairs in decoded.items()}
    assert told["attachments"] == ["scenario.yaml", "scenario.json", "layout.json"]
    assert told["metadata"] == ["pushplan.run", "pushplan.planning", "pushplan.result"]
    assert told["smallest_margin"] == case.execution.margins.min()
    assert told["last_twist"] == dict(zip(("vx", "vy", "omega"), case.execution.twists[-1], strict=True))
