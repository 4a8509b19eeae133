"""Exports of a log of any kind show its execution: page, film, bag, tables, layout."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from conftest import there
from store.conftest import KINDS, record_names

import pushplan.logging.schemas as schemas
from pushplan.drawing.palette import NEAREST, red_green_blue
from pushplan.drawing.scene import Scene
from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose, transform_points
from pushplan.logging.bag import write_ros2
from pushplan.logging.film import Film, Still, write_mp4
from pushplan.logging.layout import layout
from pushplan.logging.page import render
from pushplan.logging.reader import load_run
from pushplan.logging.recorded import RecordedRun
from pushplan.logging.rviz import Frames
from pushplan.logging.shown import viewed
from pushplan.logging.tables import base_in_plate, table, write_csv, write_trajectory
from pushplan.mechanics.chain import BodyKind

EXECUTED = pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "no plan"])


@pytest.fixture(scope="module")
def runs(logs: dict[str, Path]) -> dict[str, RecordedRun]:
    return {name: load_run(path) for name, path in logs.items()}


def page_of(run: RecordedRun) -> Any:
    return json.loads(render(run).split('id="run" type="application/json">')[1].split("</script>")[0])


@EXECUTED
def test_the_page_shows_every_body_at_its_pose(kind: str, runs: dict[str, RecordedRun]) -> None:
    run, execution = runs[kind], there(runs[kind].execution)
    told = page_of(run)
    kept = np.searchsorted(execution.t, np.array(told["samples"]["t"]) - 1e-5)
    objects = np.moveaxis(np.array(told["samples"]["objects"]), -1, 0)
    np.testing.assert_allclose(objects, execution.objects[kept], atol=1e-5)
    np.testing.assert_allclose(told["samples"]["poses"], execution.poses[kept].T, atol=1e-5)
    margins = np.array(told["samples"]["margins"], dtype=float).T
    np.testing.assert_allclose(margins, execution.margins[kept], atol=1e-5)
    assert [body["name"] for body in told["bodies"] if body["kind"] == "object"] == list(execution.names)
    pushes = [load is not None for load in told["loads"]]
    assert pushes == [segment.pushes for segment in there(run.plan).segments]
    assert [way["alone"] for way in told["ways"]] == [not push for push in pushes]
    assert bool(told["events"]) == (kind == "closed loop")


@EXECUTED
def test_a_picture_of_the_film_shows_every_body_at_its_pose(kind: str, runs: dict[str, RecordedRun]) -> None:
    run = runs[kind]
    execution = there(run.execution)
    film = Film(run, execution)
    for time in (0.3 * float(execution.t[-1]), 0.8 * float(execution.t[-1])):
        picture, (plate, objects) = film.picture(time).astype(int), execution.poses_at(time)
        for body in Scene.of(run.scenario).bodies:
            place = objects[body.name] if body.kind is BodyKind.OBJECT else plate
            inside = body.outline.mean(axis=0)
            x, y = film.floor.transData.transform(transform_points(place, inside))
            around = picture[int(960 - y) - 6 : int(960 - y) + 7, int(x) - 6 : int(x) + 7]
            assert np.abs(around - np.array(red_green_blue(body.colour))).max(axis=2).min() < 8, body.name


def test_a_film_lasts_as_long_as_its_run(runs: dict[str, RecordedRun], tmp_path: Path) -> None:
    av, run = pytest.importorskip("av"), runs["multi-push"]
    frames = [Film(run, there(run.execution)).picture(1.0) for _ in range(2)]
    np.testing.assert_array_equal(frames[0], frames[1])
    write_mp4(run, tmp_path / "run.mp4", rate=20.0)
    with av.open(str(tmp_path / "run.mp4")) as film:
        length = float(film.duration) * 1e-6
    assert length == pytest.approx(there(run.execution).t[-1] / 20.0, abs=0.1)


def test_exports_of_unexecuted_runs_show_the_reason(runs: dict[str, RecordedRun], tmp_path: Path) -> None:
    run = runs["no plan"]
    assert run.plan is not None
    assert page_of(run)["why"] == run.plan.why_not
    with pytest.raises(PushplanError, match="nothing was executed"):
        write_csv(run, tmp_path / "run.csv")
    with pytest.raises(PushplanError, match="there is no plan, so there is no trajectory"):
        write_trajectory(run, tmp_path / "run.json")
    assert list(tmp_path.iterdir()) == []
    picture = Still(run).picture().astype(int)
    assert (picture[-200:].min(axis=2) < 90).any()  # there is text
    if run.plan.nearest is not None and run.plan.nearest.segments:
        assert (np.abs(picture - np.array(red_green_blue(NEAREST))).max(axis=2) < 60).any()


@EXECUTED
def test_tables_hold_every_number(kind: str, runs: dict[str, RecordedRun], tmp_path: Path) -> None:
    run = runs[kind]
    execution = there(run.execution)
    write_csv(run, tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(newline="") as file:
        names, *rows = list(csv.reader(file))
    values = np.array([[float(cell) for cell in row] for row in rows])
    assert values[:, names.index("theta")].tolist() == execution.poses[:, 2].tolist()
    for k, name in enumerate(execution.names):
        assert values[:, names.index(f"{name}.x")].tolist() == execution.objects[:, k, 0].tolist()
    np.testing.assert_array_equal(
        values[:, [names.index(name) for name in names if name.endswith(".margin")]], execution.margins
    )
    assert ("torque" in names) == (kind in ("closed loop", "trial"))
    base = compose(execution.poses, base_in_plate(run.scenario))
    np.testing.assert_array_equal(table(run)["base_x"], base[:, 0])
    write_trajectory(run, tmp_path / "run.json")
    told = json.loads((tmp_path / "run.json").read_text())
    plan = there(run.plan)
    assert np.array(told["samples"]["plate_poses"]).tobytes() == there(plan.trajectory).poses.tobytes()
    assert [segment["kind"] for segment in told["segments"]] == [s.kind for s in plan.segments]


@EXECUTED
def test_rosbags_reads_the_bag_and_rviz_finds_its_topics(
    kind: str, runs: dict[str, RecordedRun], tmp_path: Path
) -> None:
    rosbag2, typesys = (pytest.importorskip(f"rosbags.{name}") for name in ("rosbag2", "typesys"))
    run, store = runs[kind], typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    execution = there(run.execution)
    write_ros2(run, tmp_path / "bag.mcap", frames=Frames("world", "odom", "robot"), epoch=1000.5)
    found: dict[str, list[Any]] = {}
    with rosbag2.Reader(tmp_path / "bag.mcap") as reader:
        for connection, time, data in reader.messages():
            found.setdefault(connection.topic, []).append((time, data, connection.msgtype))
    last = {topic: store.deserialize_cdr(*sent[-1][1:]) for topic, sent in found.items()}
    assert found["/tf"][0][0] == 1000_500_000_000
    assert len(found["/tf"]) == len(viewed(execution))
    frames = {t.child_frame_id: t for topic in ("/tf", "/tf_static") for t in last[topic].transforms}
    for name, place in {"pusher": execution.poses[-1], **_last(run)}.items():
        pose, frame = np.zeros(3), name
        while frame != "world":
            above = frames[frame]
            turn = above.transform.rotation
            angle = 2 * math.atan2(turn.z, turn.w)
            at = above.transform.translation
            pose, frame = compose(np.array([at.x, at.y, angle]), pose), above.header.frame_id
        np.testing.assert_allclose(transform_points(pose, np.ones(2)), transform_points(place, np.ones(2)), atol=1e-9)
    markers = {marker.ns for marker in store.deserialize_cdr(*found["/scene"][0][1:]).markers}
    assert {"pusher", "goal", *(f"object/{name}" for name in execution.names)} <= markers
    rviz = yaml.safe_load((tmp_path / "bag.rviz").read_text())["Visualization Manager"]
    shown = {display["Topic"]["Value"] for display in rviz["Displays"] if "Topic" in display}
    assert shown - set(found) <= {"/plan/nearest"}
    assert rviz["Global Options"]["Fixed Frame"] == "world"


def _last(run: RecordedRun) -> dict[str, Any]:
    return dict(zip(there(run.execution).names, there(run.execution).objects[-1], strict=True))


@pytest.mark.parametrize("kind", KINDS)
def test_the_topics_of_the_layout_exist_and_bodies_move_in_tf(
    kind: str, runs: dict[str, RecordedRun], logs: dict[str, Path]
) -> None:
    run, found = runs[kind], record_names(logs[kind])
    arranged = layout(run.scenario, run.plan)
    scene = next(panel for name, panel in arranged["configById"].items() if name.startswith("3D"))
    assert set(scene["topics"]) - set(found) <= {"/plan/path", "/plan/smoothed", "/contacts"}
    view = Scene.of(run.scenario, run.plan).window
    assert scene["cameraState"]["distance"] > view.xmax - view.xmin
    drawn = schemas.SCENE.message.FromString(found["/scene"][0].data)
    assert {entity.id for entity in drawn.entities} >= {"start", "goal", "pusher"}
    last = schemas.TF.message.FromString(found["/tf"][-1].data)
    places = {t.child_frame_id: (t.translation.x, t.translation.y) for t in last.transforms}
    if run.execution is not None:
        for name, pose in {"pusher": run.execution.poses[-1], **_last(run)}.items():
            assert places[name] == tuple(pose[:2])
        moved = schemas.MARGINS.message.FromString(found["/margins"][-1].data)
        np.testing.assert_array_equal([c.margin for c in moved.contacts], run.execution.margins[-1])
