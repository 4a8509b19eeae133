"""The robot is drawn in everything that shows a run, and logs written before it could be stated still read."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader
from pushplan.logging.old.bag import write_ros2
from pushplan.logging.old.film import HEIGHT, Film
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.page import render
from pushplan.logging.old.reader import read_run

from pushplan.geometry.se2 import transform_points
from pushplan.scenario.file import scenario_from_document

FOOTPRINT = [
    {"polygon": [[-0.03, -0.08], [-0.03, 0.08], [-0.2, 0.14], [-0.12, 0.0], [-0.2, -0.14]]},
    {"box": [0.1, 0.06], "pose": [-0.25, 0.05, 0.3]},
]


@pytest.fixture(scope="module")
def log(case: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log of a run with a robot of two parts."""
    stated = {
        **case.scenario.resolved(),
        "robot": {"footprint": FOOTPRINT},
        "goal": {"pose": [0.6, 1.0, 1.5]},
    }
    stated["workspace"] = {"x": [-1.0, 2.0], "y": [-1.0, 2.0]}
    scenario = scenario_from_document(stated)
    text = json.dumps(stated).encode()
    case = replace(case, scenario=replace(scenario, source=text))
    path: Path = case.write(tmp_path_factory.mktemp("robot") / "run.mcap")
    return path


@pytest.fixture(scope="module")
def recorded(log: Path) -> RecordedRun:
    return read_run(log)


def entities(log: Path) -> dict[str, Any]:
    with log.open("rb") as file:
        messages = [message.data for *_, message in make_reader(file).iter_messages(topics=["/scene"])]
    return {entity.id: entity for data in messages for entity in SceneUpdate.FromString(data).entities}


def test_the_log_gives_the_robot_back(recorded: RecordedRun) -> None:
    assert len(recorded.scenario.chain.pusher.footprint) == 2
    assert [body.name for body in recorded.scenario.chain.bodies][:3] == ["robot", "robot", "pusher"]


def test_the_scene_holds_the_robot_in_the_frame_of_the_pusher(recorded: RecordedRun, log: Path) -> None:
    robot = entities(log)["robot"]
    assert (robot.frame_id, robot.frame_locked, len(robot.lines)) == ("pusher", True, 2)
    triangles = [
        shapely.Polygon([(p.x, p.y) for p in each.points[i : i + 3]])
        for each in robot.triangles
        for i in range(0, len(each.points), 3)
    ]
    parts = [shapely.Polygon(part) for part in recorded.scenario.chain.pusher.footprint]
    assert shapely.union_all(triangles).symmetric_difference(shapely.union_all(parts)).area < 1e-12


def test_a_run_without_a_robot_has_no_such_entity(case: Any, tmp_path: Path) -> None:
    without = case.write(tmp_path / "run.mcap")
    assert "robot" not in entities(without)
    assert read_run(without).scenario.chain.pusher.footprint == ()


def test_start_and_goal_show_the_robot_too(log: Path) -> None:
    found = entities(log)
    assert len(found["start"].lines) == len(found["goal"].lines) == 2 + 1 + 2


def test_ros_gets_the_robot_as_markers_of_its_own(recorded: RecordedRun, tmp_path: Path) -> None:
    decoder = pytest.importorskip("mcap_ros2.decoder")
    write_ros2(recorded, tmp_path / "bag.mcap")
    with (tmp_path / "bag.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        scene, *_ = [message for *_, message in reader.iter_decoded_messages(topics=["/scene"])]
    robot = [marker for marker in scene.markers if marker.ns == "robot"]
    assert [marker.header.frame_id for marker in robot] == ["pusher"] * 4
    assert sorted(marker.id for marker in robot) == [0, 1, 2, 3]


def test_the_page_holds_the_robot_before_the_plate(recorded: RecordedRun) -> None:
    found = re.search(r'<script id="run" type="application/json">(.*?)</script>', render(recorded), re.DOTALL)
    assert found is not None
    bodies = json.loads(found[1])["bodies"]
    assert [body["kind"] for body in bodies] == ["robot", "robot", "plate", "object", "object"]
    np.testing.assert_allclose(bodies[0]["outline"], recorded.scenario.chain.pusher.footprint[0], atol=1e-5)


def test_the_film_shows_robot_plate_and_objects_in_their_colours(recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    film = Film(recorded, recorded.execution)
    picture = film.picture(float(recorded.execution.t[-1])).astype(int)
    pose = recorded.execution.poses[-1]
    for body, colour in zip(
        recorded.scenario.chain.bodies, ["9aa6b5", "9aa6b5", "59616b", "f3dfb6", "cfe0ee"], strict=True
    ):
        inside = shapely.maximum_inscribed_circle(shapely.Polygon(body.outline))
        place = transform_points(pose, shapely.get_coordinates(inside)[0])
        x, y = film.floor.transData.transform(place)
        expected = [int(colour[i : i + 2], 16) for i in (0, 2, 4)]
        row, column = int(HEIGHT - y), int(x)  # a force may lie on it
        around = picture[row - 5 : row + 6, column - 5 : column + 6]
        assert np.abs(around - expected).max(axis=2).min() < 8, body
