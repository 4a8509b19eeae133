"""What is exported to other formats is what the run was, judged by readers of those formats."""

from __future__ import annotations

import csv
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from pushplan.errors import PushplanError
from pushplan.geometry.se2 import transform_points
from pushplan.logging.export.csv import table, write_csv
from pushplan.logging.export.film.colours import FilmColours
from pushplan.logging.export.film.frames import Film
from pushplan.logging.export.film.scene import FINE, FilmScene
from pushplan.logging.export.mp4 import STILL, write_mp4
from pushplan.logging.export.parquet import write_parquet
from pushplan.logging.export.trajectory import write_trajectory
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.logging.reader import read_run
from pushplan.logging.view.window import window
from pushplan.util.colours import NEAREST, OBJECTS, red_green_blue
from pushplan.util.extras import MissingExtraError, optional

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
    assert len(names) == len(set(names)) == 7 + 6 + 2 * 5


def test_csv_leaves_out_what_is_not_known(case: Any, tmp_path: Path) -> None:
    columns = table(read_run(case.unknown_loads().write(tmp_path / "run.mcap")))
    assert [name for name in columns if "." in name] == ["pusher-near.margin", "near-far.margin"]


def test_there_is_no_table_of_a_run_that_was_not_executed(unsolved: RecordedRun, tmp_path: Path) -> None:
    with pytest.raises(PushplanError, match="nothing was executed"):
        write_csv(unsolved, tmp_path / "run.csv")
    assert list(tmp_path.iterdir()) == []


# --- Trajectory --------------------------------------------------------------------------------------------------


def test_the_trajectory_as_json_is_that_of_the_run(recorded: RecordedRun, tmp_path: Path) -> None:
    write_trajectory(recorded, tmp_path / "way.json")
    told = json.loads((tmp_path / "way.json").read_text())
    trajectory = recorded.trajectory
    assert trajectory is not None
    samples = {name: np.array(values) for name, values in told["samples"].items()}
    assert samples["t"].tobytes() == trajectory.t.tobytes()
    assert samples["chain_poses"].tobytes() == trajectory.poses.tobytes()
    assert samples["base_twists"].tobytes() == trajectory.base_twists.tobytes()
    assert told["duration"] == trajectory.duration
    # As the documentation has it: in piece i the twist at t is the sum over j of c[i][j] (t - breaks[i])^j.
    breaks, pieces = np.array(told["polynomials"]["breaks"]), np.array(told["polynomials"]["coefficients"])
    t = 0.4 * trajectory.duration
    i = int(np.searchsorted(breaks, t, side="right")) - 1
    twist = sum(pieces[i, j] * (t - breaks[i]) ** j for j in range(3))
    np.testing.assert_allclose(twist, trajectory.twists_at([t])[0], atol=1e-12)
    goal = recorded.scenario.goal.pose_chain
    assert told["goal"]["chain"] == goal.tolist()
    assert len(told["path"]["arcs"]) == len(recorded.plan.path.lengths)  # type: ignore[union-attr]


def test_there_is_no_trajectory_without_a_plan(unsolved: RecordedRun, tmp_path: Path) -> None:
    with pytest.raises(PushplanError, match="there is no plan, so there is no trajectory"):
        write_trajectory(unsolved, tmp_path / "way.json")


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


def test_rerun_draws_contacts_and_costs(recorded: RecordedRun, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    from pushplan.logging.export.rrd import write_rrd

    write_rrd(recorded, tmp_path / "run.rrd")
    found = columns_of(tmp_path / "run.rrd")
    assert recorded.execution is not None
    assert recorded.execution.forces is not None
    for kind in ("segment", "cone", "force"):
        assert f"/world/chain/contacts/near-far/{kind}" in found
    arrows = next(v for n, v in found["/world/chain/contacts/near-far/force"].items() if "vectors" in n)
    longest = np.linalg.norm(arrows.reshape(-1, 3), axis=1).max()
    assert longest <= 0.9 * np.sqrt(0.1 * 0.08) + 1e-6
    assert recorded.plan is not None
    chunks = pytest.importorskip("rerun.chunk")
    (batch,) = (
        chunk.to_record_batch()
        for chunk in chunks.RrdReader(tmp_path / "run.rrd").stream()
        if chunk.entity_path == "/costs"
    )
    told = repr([column.to_pylist() for column in batch.columns])
    for number in (recorded.plan.progress[0].cost, recorded.plan.progress[-1].cost):
        assert repr(number) in told
    assert repr(float(recorded.plan.progress[-1].iterations)) in told


def test_an_unsolved_run_becomes_a_recording(unsolved: RecordedRun, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    from pushplan.logging.export.rrd import write_rrd

    write_rrd(unsolved, tmp_path / "run.rrd")
    found = columns_of(tmp_path / "run.rrd")
    assert {"/world/chain", "/world/nearest/outline", "/world/tree/outline"} <= set(found)
    (why,) = next(v for name, v in found["/why"].items() if name.endswith("text"))
    assert "no path" in why
    assert "the nearest path ends 0.250 m and 8.2 deg from the goal" in why


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
    pale = np.array(red_green_blue(OBJECTS[0]))
    for i in (0, 150, len(recorded.execution.t) - 1):
        picture = np.asarray(picture_of(film, float(recorded.execution.t[i])), dtype=int)[:700]
        rows, columns = np.nonzero(np.abs(picture - pale).max(axis=2) < 8)
        near = recorded.scenario.chain.objects[0]
        x, y = transform_points(recorded.execution.poses[i], near.pose_chain[:2])
        view = window(recorded.scenario, recorded.plan)
        scale = 0.97 * min(1280 / (view.xmax - view.xmin), 740 / (view.ymax - view.ymin))
        expected = (
            640 + scale * (x - (view.xmin + view.xmax) / 2),
            370 - scale * (y - (view.ymin + view.ymax) / 2),
        )
        np.testing.assert_allclose((columns.mean(), rows.mean()), expected, atol=6.0)


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


def test_a_film_of_a_run_without_a_plan_says_why(unsolved: RecordedRun, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    write_mp4(unsolved, tmp_path / "run.mp4")
    with av.open(str(tmp_path / "run.mp4")) as film:
        assert float(film.duration) * 1e-6 == pytest.approx(STILL, abs=0.1)
    scene = FilmScene(unsolved)
    assert scene._words()[:3] == ["two-crates: no plan", "no path", "too narrow"]
    picture = np.asarray(scene.picture_with_words(), dtype=int)
    assert unsolved.plan is not None
    assert unsolved.plan.approximate_path is not None
    outlines = unsolved.scenario.chain.outlines_at(unsolved.plan.approximate_path.end)
    ghost = [scene.world(outline) for outline in outlines]
    nearest = np.array(red_green_blue(NEAREST))
    for x, y in (corner for outline in ghost for corner in outline):
        around = picture[int(y / FINE) - 2 : int(y / FINE) + 3, int(x / FINE) - 2 : int(x / FINE) + 3]
        assert np.abs(around - nearest).max(axis=2).min() < 90
    assert (picture[-200:].min(axis=2) < 80).any()  # there are words
