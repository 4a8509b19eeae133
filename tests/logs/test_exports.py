"""What is exported to other formats is what the run was, judged by readers of those formats."""

from __future__ import annotations

import csv
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from pushplan.basics.extras import MissingExtraError, optional
from pushplan.errors import PushplanError
from pushplan.geometry.se2 import transform_points
from pushplan.logging.export.cdr import encode
from pushplan.logging.export.csv import table, write_csv
from pushplan.logging.export.film_colours import FilmColours
from pushplan.logging.export.film_frames import Film
from pushplan.logging.export.mp4 import write_mp4
from pushplan.logging.export.parquet import write_parquet
from pushplan.logging.export.ros2 import write_ros2
from pushplan.logging.export.ros2_messages import TYPES, definition
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.reader import read_run
from pushplan.logging.view.window import window
from pushplan.logging.writer import RunLogWriter


@pytest.fixture(scope="module")
def recorded(case: Any, tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Return a run read back."""
    return read_run(case.write(tmp_path_factory.mktemp("exports") / "run.mcap"))


@pytest.fixture(scope="module")
def unsolved(case: Any, tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Return a run without a path, read back."""
    path = tmp_path_factory.mktemp("exports") / "run.mcap"
    with RunLogWriter.create(path, case.scenario, {}) as log:
        log.plan(case.unsolved().plan)
        log.finish("unsolved")
    return read_run(path)


# --- CSV ---------------------------------------------------------------------------------------------------------


def test_csv_holds_every_number_bit_for_bit(recorded: RecordedRun, tmp_path: Path) -> None:
    write_csv(recorded, tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(newline="") as file:
        names, *rows = list(csv.reader(file))
    values = np.array([[float(cell) for cell in row] for row in rows])
    execution = recorded.execution
    assert execution is not None
    assert values[:, names.index("t")].tobytes() == execution.t.tobytes()
    assert values[:, names.index("theta")].tolist() == execution.poses[:, 2].tolist()
    assert values[:, names.index("omega")].tolist() == execution.twists[:, 2].tolist()
    assert execution.forces is not None
    assert values[:, names.index("near-far.force_y")].tolist() == execution.forces[:, 1, 1].tolist()
    assert len(names) == len(set(names)) == 7 + 2 * 5


def test_csv_leaves_out_what_is_not_known(case: Any, tmp_path: Path) -> None:
    columns = table(read_run(case.unknown_loads().write(tmp_path / "run.mcap")))
    assert [name for name in columns if "." in name] == ["pusher-near.margin", "near-far.margin"]


def test_there_is_no_table_of_a_run_that_was_not_executed(unsolved: RecordedRun, tmp_path: Path) -> None:
    with pytest.raises(PushplanError, match="nothing was executed"):
        write_csv(unsolved, tmp_path / "run.csv")
    assert list(tmp_path.iterdir()) == []


# --- Parquet -----------------------------------------------------------------------------------------------------


def test_parquet_holds_every_number_and_the_metadata(recorded: RecordedRun, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    write_parquet(recorded, tmp_path / "run.parquet")
    read = parquet.read_table(tmp_path / "run.parquet")
    for name, values in table(recorded).items():
        assert read[name].to_numpy().tobytes() == values.tobytes()
    assert read.schema.metadata[b"pushplan.run.seed"] == b"5"


def test_a_missing_package_is_named_with_the_way_to_get_it() -> None:
    with pytest.raises(
        MissingExtraError, match=r"^A film needs the package nosuch: pip install 'pushplan\[mp4\]'$"
    ):
        optional("nosuch.module", "A film", "nosuch", "mp4")


# --- ROS 2 -------------------------------------------------------------------------------------------------------


def test_cdr_aligns_numbers_to_their_size() -> None:
    sent = encode(
        "geometry_msgs/msg/PoseStamped", {"header": {"frame_id": "ab"}, "pose": {"position": {"x": 1.5}}}
    )
    expected = (
        b"\0\1\0\0" + bytes(8) + b"\3\0\0\0ab\0" + bytes(1) + np.array([1.5, 0, 0, 0, 0, 0, 0]).tobytes()
    )
    assert sent == expected
    with pytest.raises(KeyError, match="has no field 'frame'"):
        encode("std_msgs/msg/Header", {"frame": "ab"})


def test_definitions_hold_every_type_that_they_need() -> None:
    for name in TYPES:
        text = definition(name)
        declared = {line.removeprefix("MSG: ") for line in text.splitlines() if line.startswith("MSG: ")}
        used = {
            kind
            for kind in TYPES
            if any(line.startswith((f"{kind} ", f"{kind}[] ")) for line in text.splitlines())
        }
        assert used <= declared


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
    assert latched == {"/scene", "/plan/path", "/plan/smoothed"}
    execution = recorded.execution
    assert execution is not None
    time, last = found["/tf"][-1]
    assert time == round(execution.t[-1] * 1e9)
    names = [(t.header.frame_id, t.child_frame_id) for t in last.transforms]
    assert names == [("world", "chain"), ("chain", "pusher"), ("chain", "near"), ("chain", "far")]
    moved = last.transforms[0].transform
    assert (moved.translation.x, moved.translation.y) == tuple(execution.poses[-1, :2])
    assert 2 * math.atan2(moved.rotation.z, moved.rotation.w) == pytest.approx(execution.poses[-1, 2])
    ((_, markers),) = found["/scene"]
    assert {m.ns for m in markers.markers} >= {"pusher", "object/near", "obstacle/1", "goal", "workspace"}
    for marker in markers.markers:
        assert marker.type == 4 or len(marker.points) % 3 == 0
        assert marker.pose.orientation.w == 1.0
    levels = {"info": 20, "warning": 30}
    told = [(levels[line.level], line.text) for line in recorded.lines]
    assert [(m.level, m.msg) for _, m in found["/log"]] == told
    assert found["/pusher/twist"][-1][1].twist.angular.z == execution.twists[-1, 2]
    ((_, path),) = found["/plan/path"]
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
        "/scene",
        "/plan/path",
        "/plan/smoothed",
        "/pusher/twist",
        "/log",
    }


def test_an_unsolved_run_becomes_a_bag_of_its_start(unsolved: RecordedRun, tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    write_ros2(unsolved, tmp_path / "bag.mcap")
    with rosbag2.Reader(tmp_path / "bag.mcap") as reader:
        topics = sorted(connection.topic for connection, _, _ in reader.messages())
    assert topics == ["/log", "/pusher/twist", "/scene", "/tf"]


# --- Rerun -------------------------------------------------------------------------------------------------------


def columns_of(path: Path) -> dict[str, dict[str, np.ndarray[Any, Any]]]:
    """Return the columns of each entity of a recording, as Rerun's own reader gives them."""
    chunks = pytest.importorskip("rerun.chunk")
    found: dict[str, dict[str, np.ndarray[Any, Any]]] = {}
    for chunk in chunks.RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            while "list" in str(column.type).split("<")[0]:
                column = column.flatten()
            if not str(column.type).startswith("struct"):
                found.setdefault(chunk.entity_path, {})[name] = column.to_numpy(zero_copy_only=False)
    return found


def test_rerun_reads_the_recording(recorded: RecordedRun, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    from pushplan.logging.export.rrd import write_rrd

    write_rrd(recorded, tmp_path / "run.rrd")
    found = columns_of(tmp_path / "run.rrd")
    execution = recorded.execution
    assert execution is not None
    margin = next(v for name, v in found["/margins/near-far"].items() if "scalars" in name)
    np.testing.assert_array_equal(margin, execution.margins[:, 1])
    moved = next(v for name, v in found["/world/chain"].items() if "translation" in name).reshape(-1, 3)
    np.testing.assert_allclose(moved[:, :2], execution.poses[:, :2], atol=1e-6)
    times = found["/world/chain"]["time"].astype("timedelta64[ns]").astype(float) * 1e-9
    np.testing.assert_allclose(times, execution.t, atol=1e-8)
    inside = next(
        v for name, v in found["/world/chain/objects/far/object/far/inside"].items() if "vertex_pos" in name
    )
    assert len(inside.reshape(-1, 3)) % 3 == 0
    texts = next(v for name, v in found["/log"].items() if name.endswith("text"))
    assert list(texts) == [line.text for line in recorded.lines]
    assert {"/world/path", "/world/tree/outline", "/world/goal/outline", "/world/obstacle/1/inside"} <= set(
        found
    )


def test_an_unsolved_run_becomes_a_recording(unsolved: RecordedRun, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    from pushplan.logging.export.rrd import write_rrd

    write_rrd(unsolved, tmp_path / "run.rrd")
    assert "/world/chain" in columns_of(tmp_path / "run.rrd")


# --- film --------------------------------------------------------------------------------------------------------


def picture_of(film: Film, time: float) -> Image.Image:
    """Return the picture of a film at a time."""
    picture = film.still.copy()
    for part in film.moving(time):
        picture.paste(part.image, (part.x, part.y))
    return picture


def test_a_film_lasts_as_long_as_the_run_and_moves(recorded: RecordedRun, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    write_mp4(recorded, tmp_path / "run.mp4", rate=2.0)
    assert recorded.execution is not None
    with av.open(str(tmp_path / "run.mp4")) as film:
        pictures = [frame.to_ndarray(format="rgb24").astype(np.int16) for frame in film.decode(video=0)]
        length = float(film.duration) * 1e-6
    assert length == pytest.approx(recorded.execution.t[-1] / 2.0, abs=0.1)
    assert all(picture.shape == (960, 1280, 3) for picture in pictures)
    changed = [np.abs(a - b).max() for a, b in pairwise(pictures)]
    assert sum(change > 60 for change in changed) > 0.8 * len(changed)


def test_a_picture_shows_the_chain_where_it_is(recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    film = Film(recorded, recorded.execution)
    orange = np.array([0xE8, 0x91, 0x2D])
    for i in (0, 150, len(recorded.execution.t) - 1):
        picture = np.asarray(picture_of(film, float(recorded.execution.t[i])), dtype=int)[:700]
        rows, columns = np.nonzero(np.abs(picture - orange).max(axis=2) < 8)
        near = recorded.scenario.chain.objects[0]
        x, y = transform_points(recorded.execution.poses[i], near.pose_chain[:2])
        view = window(recorded.scenario, recorded.plan)
        scale = 0.97 * min(1280 / (view.xmax - view.xmin), 740 / (view.ymax - view.ymin))
        expected = (
            640 + scale * (x - (view.xmin + view.xmax) / 2),
            370 - scale * (y - (view.ymin + view.ymax) / 2),
        )
        np.testing.assert_allclose((columns.mean(), rows.mean()), expected, atol=3.0)


def test_a_picture_holds_nothing_of_the_one_before(recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    film, last = Film(recorded, recorded.execution), float(recorded.execution.t[-1])
    for time in (0.0, 0.4 * last, last, 0.5 * last):
        fresh = Film(recorded, recorded.execution)
        assert picture_of(film, time).tobytes() == picture_of(fresh, time).tobytes()


def test_a_picture_is_the_whole_drawn_anew(recorded: RecordedRun) -> None:
    assert recorded.execution is not None
    film, time = Film(recorded, recorded.execution), 0.3 * float(recorded.execution.t[-1])
    pen = ImageDraw.Draw(film._canvas)
    film._draw_chain(pen, time)
    film._draw_now(pen, time)
    whole = film._canvas.reduce(film._canvas.width // film.still.width)
    assert picture_of(Film(recorded, recorded.execution), time).tobytes() == whole.tobytes()


def test_a_film_has_the_colours_of_its_pictures(recorded: RecordedRun) -> None:
    """What moves is converted alone; FFmpeg converts whole pictures."""
    av = pytest.importorskip("av")
    assert recorded.execution is not None
    film, last = Film(recorded, recorded.execution), float(recorded.execution.t[-1])
    colours = FilmColours(film.still)
    for time in (0.0, 0.4 * last, 0.6 * last):
        planes = colours.with_parts(film.moving(time)).astype(int)
        whole = av.VideoFrame.from_image(picture_of(film, time)).to_ndarray(format="yuv420p").astype(int)
        assert np.abs(planes - whole)[:960].max() <= 1
        ours, theirs = (colours.reshape(2, 480, 640) for colours in (planes[960:], whole[960:]))
        around = [np.roll(theirs, shift, axis) for axis in (1, 2) for shift in (-2, -1, 1, 2)]
        even = np.all([near == theirs for near in around], axis=0)  # at edges it weighs others' colours, too
        assert len(np.unique(theirs[even])) > 4
        assert np.abs(ours - theirs)[even].max() <= 1


def test_there_is_no_film_of_a_run_that_was_not_executed(unsolved: RecordedRun, tmp_path: Path) -> None:
    pytest.importorskip("av")
    with pytest.raises(PushplanError, match="nothing was executed"):
        write_mp4(unsolved, tmp_path / "run.mp4")
