"""A run of several pushes on the command line and in its log: lines, JSON, topics, replay, verification, exports."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from several.conftest import Problem, problem_document

from pushplan.cli.main import main
from pushplan.drawing.scene import Scene
from pushplan.geometry import se2
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
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
