"""A ROS 2 bag holds what the run was, as rosbags reads it, and what RViz needs to show it."""

from __future__ import annotations

import dataclasses
import math
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from pushplan.logging.old.bag import FrameNamesError, Frames, write_ros2
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.view.window import window

from pushplan.geometry.se2 import compose, inverse, transform_points
from pushplan.mechanics.chain import Drive


def test_rosbags_reads_the_bag(recorded: RecordedRun, tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    write_ros2(recorded, tmp_path / "bag.mcap")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    found: dict[str, list[Any]] = {}
    with rosbag2.Reader(tmp_path / "bag.mcap") as reader:
        for connection, time, data in reader.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, message))
        latched = {c.topic for c in reader.connections if c.ext.offered_qos_profiles[0].durability.value == 1}
    assert latched == {"/tf_static", "/scene", "/plan/path", "/plan/smoothed", "/base/path", "/footprint"}
    execution = recorded.execution
    assert execution is not None
    begun = datetime.fromisoformat(recorded.words["pushplan.run"]["started_at"]).timestamp()
    time, last = found["/tf"][-1]
    assert time == pytest.approx(1e9 * (begun + execution.t[-1]), abs=1000)
    stamp = last.transforms[0].header.stamp
    assert 10**9 * stamp.sec + stamp.nanosec == time
    names = [(t.header.frame_id, t.child_frame_id) for t in last.transforms]
    assert names == [("odom", "base_link")]
    ((_, rigid),) = found["/tf_static"]
    names = [(t.header.frame_id, t.child_frame_id) for t in rigid.transforms]
    tree = [("map", "odom"), ("base_link", "chain"), ("chain", "pusher"), ("chain", "near"), ("chain", "far")]
    assert names == tree
    moved = last.transforms[0].transform
    assert (moved.translation.x, moved.translation.y) == tuple(execution.poses[-1, :2])
    assert 2 * math.atan2(moved.rotation.z, moved.rotation.w) == pytest.approx(execution.poses[-1, 2])
    (_, markers), *again = found["/scene"]
    assert len(again) == int(execution.t[-1])  # once a second
    assert {m.ns for m in markers.markers} >= {"pusher", "object/near", "obstacle/1", "goal", "workspace"}
    margins = [m.data for _, m in found["/margins/c01_near_far"]]
    assert min(margins) == execution.margins[:, 1].min()
    for marker in markers.markers:
        assert marker.type in (4, 5) or len(marker.points) % 3 == 0
        assert marker.pose.orientation.w == 1.0
    levels = {"info": 20, "warning": 30}
    told = [(levels[line.level], line.text) for line in recorded.lines]
    assert [(m.level, m.msg) for _, m in found["/log"]] == told
    assert found["/pusher/twist"][-1][1].twist.angular.z == execution.twists[-1, 2]
    (_, path), *_ = found["/plan/path"]
    assert recorded.plan is not None
    assert recorded.plan.path is not None
    assert path.poses[-1].pose.position.x == pytest.approx(recorded.plan.path.end[0])


def test_the_definitions_in_the_bag_decode_its_messages(recorded: RecordedRun, tmp_path: Path) -> None:
    decoder = pytest.importorskip("mcap_ros2.decoder")
    from mcap.reader import make_reader

    write_ros2(recorded, tmp_path / "bag.mcap")
    with (tmp_path / "bag.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        decoded = [(c.topic, m) for _, c, _, m in reader.iter_decoded_messages()]
    assert {topic for topic, _ in decoded} == {
        "/tf",
        "/tf_static",
        "/contacts",
        "/margins/c00_pusher_near",
        "/margins/c01_near_far",
        "/scene",
        "/plan/path",
        "/plan/smoothed",
        "/pusher/twist",
        "/base/path",
        "/base/twist",
        "/footprint",
        "/log",
    }


def test_an_unsolved_run_becomes_a_bag_of_its_start(unsolved: RecordedRun, tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    write_ros2(unsolved, tmp_path / "bag.mcap")
    with rosbag2.Reader(tmp_path / "bag.mcap") as reader:
        topics = sorted(connection.topic for connection, _, _ in reader.messages())
    of_base = {"/base/twist", "/footprint"}
    still = {"/contacts", "/plan/nearest", "/scene", "/tf_static"}
    assert set(topics) == of_base | still | {"/log", "/pusher/twist", "/tf"}


def bag_of(run: RecordedRun, path: Path, **how: Any) -> dict[str, list[Any]]:
    """Return the messages of a bag by topic, as rosbags reads them."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    write_ros2(run, path, **how)
    found: dict[str, list[Any]] = {}
    with rosbag2.Reader(path) as reader:
        for connection, _, data in reader.messages():
            found.setdefault(connection.topic, []).append(store.deserialize_cdr(data, connection.msgtype))
    return found


def test_every_line_is_two_pixels_wide_in_a_view_of_everything(
    recorded: RecordedRun, unsolved: RecordedRun, tmp_path: Path
) -> None:
    for run in (recorded, unsolved):
        view = window(run.scenario, run.plan)
        pixels_per_metre = 800.0 / max(view.xmax - view.xmin, view.ymax - view.ymin)
        found = bag_of(run, tmp_path / "bag.mcap")
        topics = ("/scene", "/contacts", "/plan/nearest")
        widths = [
            marker.scale.x
            for topic in topics
            for message in found.get(topic, ())
            for marker in message.markers
            if marker.type in (4, 5)
        ]
        assert len(widths) > 8
        assert pixels_per_metre * min(widths) >= 2.0 - 1e-9


def test_frames_and_epoch_are_named(case: Any, recorded: RecordedRun, tmp_path: Path) -> None:
    """The base is at the axle, and the chain ends up where it is, whatever lies between."""
    axle = np.array([-0.3, 0.02, 0.1])
    drive = Drive("differential", axle)
    chain = case.scenario.chain
    driven = dataclasses.replace(chain, pusher=dataclasses.replace(chain.pusher, drive=drive))
    run = dataclasses.replace(recorded, scenario=dataclasses.replace(recorded.scenario, chain=driven))
    frames = Frames.from_text("world,robot")
    found = bag_of(run, tmp_path / "bag.mcap", frames=frames, epoch=1000.5)
    tree = {
        t.child_frame_id: (t.header.frame_id, t.transform)
        for message in (*found["/tf_static"], found["/tf"][-1])
        for t in message.transforms
    }
    pose, frame = np.zeros(3), "chain"
    while frame != "world":
        frame, up = tree[frame]
        angle = 2 * math.atan2(up.rotation.z, up.rotation.w)
        pose = compose(np.array([up.translation.x, up.translation.y, angle]), pose)
    assert run.execution is not None
    assert pose == pytest.approx(run.execution.poses[-1], abs=1e-12)
    assert tree["robot"][0] == "odom"
    # Every body, seen from the base, lies in the footprint, and nothing else does.
    (footprint, *_), twist = found["/footprint"], found["/base/twist"][-1]
    assert (footprint.header.frame_id, twist.header.frame_id) == ("robot", "robot")
    told = shapely.Polygon([(p.x, p.y) for p in footprint.polygon.points])
    bodies = [shapely.Polygon(transform_points(inverse(axle), body.outline)) for body in driven.bodies]
    assert told.symmetric_difference(shapely.union_all(bodies)).area < 1e-6  # of 32 bits
    vx, vy, omega = run.execution.twists[-1]
    ahead = np.array([vx - omega * axle[1], vy + omega * axle[0]]) @ [math.cos(axle[2]), math.sin(axle[2])]
    assert twist.twist.linear.x == pytest.approx(ahead, abs=1e-12)
    assert found["/tf"][0].transforms[0].header.stamp.sec == 1000
    assert {m.header.frame_id for m in found["/scene"][0].markers} == {"world", "pusher", "near", "far"}


@pytest.mark.parametrize("text", ["map", "map,map", "a,b,c,d", "map,/base", "map,,base_link"])
def test_frames_that_make_no_tree_are_refused(text: str) -> None:
    with pytest.raises(FrameNamesError, match="allowed: MAP,BASE or MAP,ODOM,BASE, all different"):
        Frames.from_text(text)


def test_a_frame_of_the_chain_cannot_be_taken_again(recorded: RecordedRun, tmp_path: Path) -> None:
    with pytest.raises(FrameNamesError, match="a frame 'near' already"):
        write_ros2(recorded, tmp_path / "bag.mcap", frames=Frames("map", "odom", "near"))
    assert list(tmp_path.iterdir()) == []


def test_rviz_finds_what_is_in_the_bag(recorded: RecordedRun, tmp_path: Path) -> None:
    found = bag_of(recorded, tmp_path / "bag.mcap")
    rviz = yaml.safe_load((tmp_path / "bag.rviz").read_text())["Visualization Manager"]
    shown = {display["Topic"]["Value"] for display in rviz["Displays"] if "Topic" in display}
    assert shown - set(found) == {"/plan/nearest"}  # of runs without a plan
    assert rviz["Global Options"]["Fixed Frame"] == "map"
    view, camera = window(recorded.scenario, recorded.plan), rviz["Views"]["Current"]
    assert camera["Scale"] * max(view.xmax - view.xmin, view.ymax - view.ymin) <= 800.0 + 1e-9
