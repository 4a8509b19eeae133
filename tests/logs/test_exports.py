"""What is exported to other formats is what the run was, judged by readers of those formats."""

from __future__ import annotations

import csv
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pushplan.logging.old.film import STILL, Film, Still, write_mp4
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.tables import table, write_csv, write_trajectory

from pushplan.drawing.palette import NEAREST, OBJECTS, red_green_blue
from pushplan.errors import PushplanError
from pushplan.geometry.se2 import transform_points
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


def test_a_missing_package_is_named_with_the_way_to_get_it() -> None:
    with pytest.raises(
        MissingExtraError, match=r"^A film needs the package nosuch: pip install 'pushplan\[mp4\]'$"
    ):
        optional("nosuch.module", "A film", "nosuch", "mp4")


# --- film --------------------------------------------------------------------------------------------------------


def test_a_film_lasts_as_long_as_the_run_and_moves(recorded: RecordedRun, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    write_mp4(recorded, tmp_path / "run.mp4", rate=2.0)
    assert recorded.execution is not None
    with av.open(str(tmp_path / "run.mp4")) as film:
        shown = [frame.to_ndarray(format="rgb24").astype(np.int16) for frame in film.decode(video=0)]
        length = float(film.duration) * 1e-6
    assert length == pytest.approx(recorded.execution.t[-1] / 2.0, abs=0.1)
    assert all(picture.shape == (960, 1280, 3) for picture in shown)
    changed = [np.abs(a - b).max() for a, b in pairwise(shown)]
    assert sum(change > 60 for change in changed) > 0.8 * len(changed)


def test_a_picture_shows_the_bodies_where_they_are(recorded: RecordedRun) -> None:
    """And nothing of the picture before: each is the same as the first one of a film of its own."""
    execution = recorded.execution
    assert execution is not None
    film, pale = Film(recorded, execution), np.array(red_green_blue(OBJECTS[0]))
    for i in (0, 150, len(execution.t) - 1):
        time = float(execution.t[i])
        picture = film.picture(time)
        np.testing.assert_array_equal(picture, Film(recorded, execution).picture(time))
        rows, columns = np.nonzero(np.abs(picture.astype(int) - pale).max(axis=2) < 8)
        near = recorded.scenario.chain.objects[0]
        place = transform_points(execution.poses[i], near.pose_chain[:2])
        expected = film.floor.transData.transform(place)
        np.testing.assert_allclose((columns.mean(), 960 - rows.mean()), expected, atol=8.0)


def test_a_film_of_a_run_without_a_plan_says_why(unsolved: RecordedRun, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    write_mp4(unsolved, tmp_path / "run.mp4")
    with av.open(str(tmp_path / "run.mp4")) as film:
        assert float(film.duration) * 1e-6 == pytest.approx(STILL, abs=0.1)
    still = Still(unsolved)
    picture = still.picture().astype(int)
    assert unsolved.plan is not None
    assert unsolved.plan.approximate_path is not None
    nearest = np.array(red_green_blue(NEAREST))
    for outline in unsolved.scenario.chain.outlines_at(unsolved.plan.approximate_path.end):
        for x, y in still.floor.transData.transform(outline):
            around = picture[int(960 - y) - 2 : int(960 - y) + 3, int(x) - 2 : int(x) + 3]
            assert np.abs(around - nearest).max(axis=2).min() < 90
    assert (picture[-200:].min(axis=2) < 90).any()  # there are words
