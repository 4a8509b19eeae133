"""A run of several pushes on the command line and in its log: lines, JSON, topics, replay, verification, exports."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from boxes import SCREENS, assert_tidy, chromium, show
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from mcap.reader import make_reader
from several.conftest import Problem, problem_document

import pushplan.logging.schemas as schemas
from pushplan.cli.main import main
from pushplan.drawing.scene import Scene
from pushplan.geometry import se2
from pushplan.logging.bag import write_ros2
from pushplan.logging.film import Film
from pushplan.logging.page import render, write_html
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.tables import table
from pushplan.logging.verify import verify
from pushplan.verification import execute_again

Captured = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a scenario file: the box has to come back towards the robot."""
    path = tmp_path_factory.mktemp("several") / "back.yaml"
    document = problem_document("differential", goal={"pose": [0.5, 1.0, 0.0], "of": "b0"})
    path.write_text(yaml.safe_dump(document, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def log(file: Path) -> Path:
    """Return the log of its plan."""
    path = file.with_suffix(".mcap")
    words = ["plan", str(file), "--first", "-o", str(path), "--plot", str(file.with_suffix(".svg"))]
    assert main(words) == 0
    return path


@pytest.fixture(scope="module")
def recorded(log: Path) -> RecordedRun:
    return load_run(log, messages=True)


def messages(log: Path, topic: str) -> list[tuple[float, bytes]]:
    with log.open("rb") as stream:
        return [(1e-9 * m.log_time, m.data) for *_, m in make_reader(stream).iter_messages(topics=[topic])]


def test_the_log_gives_the_segments_back(recorded: RecordedRun) -> None:
    plan = recorded.plan
    assert plan is not None
    assert plan.trajectory is not None
    assert [segment.kind for segment in plan.segments] == ["transit", "approach", "push", "retreat"]
    assert plan.times[-1] == pytest.approx(plan.trajectory.duration, abs=1e-9)
    assert recorded.execution is not None
    np.testing.assert_allclose(recorded.execution.objects[-1, 0], plan.segments[-1].after["b0"], atol=1e-9)


def test_a_recorded_run_is_verified(recorded: RecordedRun) -> None:
    report = verify(recorded, execute_again)
    assert report.matches, [check.text for check in report.mismatches]
    assert {"pose of an object", "segment", "/segment"} <= {check.quantity for check in report.checks}


@pytest.mark.parametrize("change", ["load", "time"])
def test_a_segment_that_was_changed_is_found(recorded: RecordedRun, change: str) -> None:
    plan = recorded.plan
    assert plan is not None
    transit, push = plan.segments[0], plan.segments[2]
    assert transit.trajectory is not None
    slower = replace(transit.trajectory, breaks=transit.trajectory.breaks * (1.0 + 1e-4))
    segments = {
        "load": (*plan.segments[:2], replace(push, margin=push.margin + 1e-5), plan.segments[3]),
        "time": (replace(transit, trajectory=slower), *plan.segments[1:]),
    }[change]
    assert not verify(replace(recorded, plan=replace(plan, segments=segments)), execute_again).matches


def test_segments_have_a_topic_of_their_own(log: Path, recorded: RecordedRun) -> None:
    plan = recorded.plan
    assert plan is not None
    told = [schemas.Segment.FromString(data) for _, data in messages(log, "/segment")]
    assert [(s.kind, s.t0) for s in told] == [
        (segment.kind, begin) for segment, begin in zip(plan.segments, plan.times, strict=False)
    ]


def test_plate_and_box_move_on_their_own_in_tf(log: Path, recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    frames = [FrameTransforms.FromString(data) for _, data in messages(log, "/tf")]
    parents = {t.child_frame_id: t.parent_frame_id for t in frames[-1].transforms}
    assert parents == {"b0": "world", "pusher": "world"}
    boxes = [t.translation.x for frame in frames for t in frame.transforms if t.child_frame_id == "b0"]
    assert boxes[0] == pytest.approx(1.075)
    assert boxes[-1] == pytest.approx(0.5)
    plates = [t.translation.x for t in frames[-1].transforms if t.child_frame_id == "pusher"]
    assert plates == pytest.approx([recorded.execution.poses[-1, 0]])


def test_exports_show_both(recorded: RecordedRun, tmp_path: Path) -> None:
    assert recorded.execution is not None
    columns = table(recorded)
    np.testing.assert_array_equal(columns["b0.x"], recorded.execution.objects[:, 0, 0])
    page = render(recorded)
    told = json.loads(page.split('id="run" type="application/json">')[1].split("</script>")[0])
    assert told["samples"]["objects"][0][0][-1] == pytest.approx(
        recorded.execution.objects[-1, 0, 0], abs=1e-4
    )
    film = Film(recorded, recorded.execution)
    end = float(recorded.execution.t[-1])
    assert np.abs(film.picture(0.0).astype(int) - film.picture(end)).max() > 60
    if find_spec("rosbags") is not None:  # of an extra
        write_ros2(recorded, tmp_path / "bag.mcap")
        assert (tmp_path / "bag.mcap").stat().st_size > 1000


def test_viewers_tell_pushes_from_the_robots_own_ways(recorded: RecordedRun) -> None:
    assert recorded.plan is not None
    ways = Scene.of(recorded.scenario, recorded.plan, recorded.execution).lines
    assert [way.pushes for way in ways] == [segment.pushes for segment in recorded.plan.segments]
    for before, after in pairwise(ways):
        np.testing.assert_allclose(before.points[-1], after.points[0], atol=1e-9)
    page = render(recorded)
    told = json.loads(page.split('id="run" type="application/json">')[1].split("</script>")[0])
    assert [way["alone"] for way in told["ways"]] == [not way.pushes for way in ways]
    assert all(len(way["colours"]) == len(way["points"]) - 1 for way in told["ways"] if not way["alone"])


def test_the_page_is_right_on_every_screen(recorded: RecordedRun, tmp_path: Path) -> None:
    write_html(recorded, tmp_path / "run.html")
    with chromium(tmp_path / "profile") as browser:
        for width, dark in SCREENS:
            show(browser, tmp_path / "run.html", width, dark)
            assert_tidy(browser, "h1, #facts, canvas, #legend > *, footer > *", width)


def test_an_object_that_its_symmetry_covers_is_outlined_once(problem: Problem) -> None:
    shown = [
        len(Scene.of(problem(goal={"pose": [1.0, 2.0, 0.0], "of": "b0", "symmetry": turns})).goals)
        for turns in (1, 2, 4, 8)
    ]
    assert shown == [1, 1, 1, 2]  # a square, and a square turned by 45 degrees


def test_a_line_is_printed_for_each_segment(log: Path, capsys: Captured) -> None:
    capsys.readouterr()
    assert main(["replay", str(log)]) == 0
    out = capsys.readouterr().out
    for k, kind in enumerate(("transit", "approach", "push", "retreat"), start=1):
        assert f"{k}. {kind}" in out
    assert "(1.075, 1.000, 0.0 deg) -> (0.500, 1.000, 0.0 deg)" in out
    assert "in 1 push" in out


def json_of(words: list[str], capsys: Captured) -> tuple[int, Mapping[str, Any]]:
    capsys.readouterr()
    code = main([*words, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_json_has_the_segments(log: Path, capsys: Captured) -> None:
    code, told = json_of(["replay", str(log), "--verify"], capsys)
    assert code == 0
    segments = told["segments"]
    assert [segment["kind"] for segment in segments] == ["transit", "approach", "push", "retreat"]
    push = segments[2]
    assert (push["face"], push["offset"]) == ("front", 0.0)
    assert push["object_before"] == [1.075, 1.0, 0.0]
    assert push["object_after"] == pytest.approx([0.5, 1.0, 0.0])
    assert sum(arc["length"] for arc in push["arcs"]) == pytest.approx(0.575)
    assert told["pushed_distance"] == pytest.approx(0.575)
    for first, second in pairwise(segments):
        assert first["t1"] == second["t0"]
        assert max(se2.pose_error(*map(np.array, (first["robot_after"], second["robot_before"])))) < 1e-9


def test_a_box_that_nothing_gets_out_of_its_corner_is_no_plan(tmp_path: Path, capsys: Captured) -> None:
    corner: dict[str, Any] = {"start": [0.01, 0.085, 0.0], "workspace": {"x": [0.0, 3.0], "y": [0.0, 3.0]}}
    changes: dict[str, Any] = {"robot": {"start": [1.5, 1.5, 0.0]}, "goal": {"pose": [1.0, 1.0, 0.0]}}
    path = tmp_path / "corner.yaml"
    path.write_text(yaml.safe_dump(problem_document(**corner, **changes)))
    code, told = json_of(["plan", str(path), "--no-log", "--plot", str(tmp_path / "corner.png")], capsys)
    assert code == 3
    assert told["segments"] == []
    assert told["diagnosis"][0]["proven"] is True


@pytest.mark.parametrize("words", [["--planner", "rrt"], ["--cost", "time"]])
def test_what_is_for_a_single_push_ends_with_code_2(file: Path, words: list[str], capsys: Captured) -> None:
    assert main(["plan", str(file), "--no-log", *words]) == 2
    assert "several" in capsys.readouterr().err


def test_check_and_its_picture_show_robot_and_goals(file: Path, tmp_path: Path) -> None:
    assert main(["check", str(file), "--plot", str(tmp_path / "check.svg")]) == 0
    assert (tmp_path / "check.svg").stat().st_size > 1000
