"""Maps as obstacles: cells are read as map_server reads them, nothing unknown is floor, the log holds the map."""

import io
import os
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from PIL import Image

import pushplan
from pushplan.errors import ImportedFileError, ScenarioError
from pushplan.scenario.maps import cells_of, read_ros_map
from pushplan.scenario.model import PolygonObstacle, Scenario, Workspace

SAVED = """\
image: office.pgm
mode: {mode}
resolution: 0.05
origin: [-1.0, -2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""
SCENARIO = """\
format: pushplan/1
floor: {{friction: 0.3}}
objects: [{{name: crate, shape: {{box: [0.4, 0.4]}}, mass: 5}}]
pusher: {{width: 0.5, friction: 0.5}}
start: [0, -1.5, 0]
goal: {{pose: [4.5, -1.0, 0.5]}}
obstacles:
  - {{circle: 0.1, center: [3.0, 2.0]}}
  - {obstacle}
"""
FREE, UNKNOWN, OCCUPIED = 254, 205, 0


def _room() -> npt.NDArray[np.uint8]:
    """A walled room, 7 x 5 m; an unknown block stands between start and goal, leaving room to pass above it."""
    cells = np.full((100, 140), FREE, np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    cells[60:99, 40:100] = UNKNOWN
    return cells


def _write(folder: Path, obstacle: str = "{map: maps/office.yaml}", mode: str = "trinary") -> Path:
    (folder / "maps").mkdir()
    Image.fromarray(_room()).save(folder / "maps" / "office.pgm")
    (folder / "maps" / "office.yaml").write_text(SAVED.format(mode=mode))
    return _with_obstacle(folder, obstacle)


def _with_obstacle(folder: Path, obstacle: str) -> Path:
    file = folder / "push.yaml"
    file.write_text(SCENARIO.format(obstacle=obstacle))
    return file


def _polygons(scenario: Scenario, unknown: bool) -> shapely.Geometry:
    found = [o for o in scenario.obstacles if isinstance(o, PolygonObstacle) and o.unknown == unknown]
    return shapely.union_all([shapely.Polygon(o.outline) for o in found])


def _cells(row: list[int], mode: str, negate: bool = False, free: float = 0.25) -> str:
    """Occupied (#), unknown (?) and free (.) cells of a picture with one row."""
    picture = _bytes(Image.fromarray(np.array([row], np.uint8)))
    found = cells_of(picture, "row.pgm", mode, negate, 0.65, free)
    return "".join(np.where(found.occupied, "#", np.where(found.unknown, "?", "."))[0])


def _bytes(pixels: Image.Image, kind: str = "PPM") -> bytes:
    stream = io.BytesIO()
    pixels.save(stream, kind)
    return stream.getvalue()


@pytest.mark.parametrize("free", [0.196, 0.25])
def test_what_map_saver_leaves_unknown_is_unknown_whatever_the_threshold(free: float) -> None:
    """map_saver of Nav2 writes 205 and free_thresh 0.25; 50/255 = 0.196 < 0.25 would make it floor."""
    assert _cells([254, 205, 0], "trinary", free=free) == ".?#"


def test_each_mode_reads_grey_values_as_map_server_does() -> None:
    greys = [255, 230, 205, 150, 80, 0]
    assert _cells(greys, "trinary") == "..??##"
    assert _cells(greys, "scale") == "...?##"  # there 205 is an occupancy like any other
    assert _cells(greys, "scale", negate=True) == "###??."
    # In raw the darkness is the occupancy in per cent, and above 100 nothing is known.
    assert _cells([255, 245, 215, 180, 155, 154, 0], "raw") == "..?##??"


def test_a_scenario_names_a_map_in_its_folder(tmp_path: Path) -> None:
    scenario = pushplan.load_scenario(_write(tmp_path))
    assert scenario.workspace == Workspace(-1.0, 6.0, -2.0, 3.0)
    assert set(scenario.attachments) == {"maps/office.yaml", "maps/office.pgm"}
    block = shapely.box(1.0, -1.95, 4.0, 0.0)
    assert shapely.covers(_polygons(scenario, unknown=True), block)
    assert shapely.area(_polygons(scenario, unknown=True)) < 1.1 * shapely.area(block)
    assert not shapely.intersects(_polygons(scenario, unknown=False), shapely.buffer(block, -0.2))
    alone = read_ros_map(tmp_path / "maps" / "office.yaml")
    assert len(scenario.obstacles) == len(alone.obstacles) + 1


def test_no_plan_goes_through_the_unknown_unless_it_is_said_to_be_free(tmp_path: Path) -> None:
    scenario = pushplan.load_scenario(_write(tmp_path))
    around = pushplan.plan(scenario, seed=1, iterations=2_000, time_limit=60.0)
    assert around.path is not None
    swept = shapely.MultiPoint(around.path.sampled(0.02)[:, :2])
    assert shapely.distance(swept, shapely.box(1.0, -1.95, 4.0, 0.0)) > 0.2
    said = (tmp_path / "push.yaml").read_text().replace("yaml}", "yaml, unknown: free}")
    (tmp_path / "free.yaml").write_text(said)
    free = pushplan.load_scenario(tmp_path / "free.yaml")
    assert shapely.is_empty(_polygons(free, unknown=True))
    through = pushplan.plan(free, seed=1, iterations=2_000, time_limit=60.0)
    assert through.path is not None
    assert through.path.cost < 0.7 * around.path.cost


def test_a_log_holds_the_map_and_is_verified_without_its_files(tmp_path: Path) -> None:
    file = _write(tmp_path)
    scenario = pushplan.load_scenario(file)
    log = tmp_path / "run.mcap"
    pushplan.run(scenario, log=log, first=True, time_limit=60.0)
    for name in ("maps/office.yaml", "maps/office.pgm", "push.yaml"):
        (tmp_path / name).unlink()
    again = pushplan.load_run(log).scenario
    assert again.attachments == scenario.attachments
    assert shapely.equals(_polygons(again, unknown=True), _polygons(scenario, unknown=True))
    assert pushplan.verify_log(log).matches


def test_maps_from_anywhere_are_added_to_a_scenario(tmp_path: Path) -> None:
    alone = pushplan.load_scenario(_write(tmp_path, "{circle: 0.1, center: [3.0, 2.5]}"))
    with_map = pushplan.load_scenario(alone.path, [tmp_path / "maps" / "office.yaml"])
    named = pushplan.load_scenario(_with_obstacle(tmp_path, "{map: maps/office.yaml}"))
    assert shapely.equals(_polygons(with_map, unknown=True), _polygons(named, unknown=True))
    assert (with_map.name, with_map.workspace) == ("push", named.workspace)
    log = tmp_path / "run.mcap"
    pushplan.run(with_map, log=log, first=True, time_limit=60.0)
    assert pushplan.verify_log(log).matches
    with pytest.raises(ImportedFileError, match=r"gone\.yaml: cannot read the file: No such file"):
        pushplan.load_scenario(alone.path, [tmp_path / "gone.yaml"])


@pytest.mark.parametrize(
    ("obstacle", "what"),
    [
        ("{map: gone.yaml}", "push.yaml:9:11: obstacles[1].map: cannot read 'gone.yaml': No such file or directory"),
        ("{map: ../office.yaml}", "obstacles[1].map: is the name '../office.yaml'; allowed: a file in the"),
        ("{map: maps/office.pgm}", "obstacles[1].map: maps/office.pgm"),
        ("{map: maps/office.yaml, unknown: maybe}", "obstacles[1].unknown: is the text 'maybe'; allowed: obstacle"),
        ("{map: maps/office.yaml, pose: [0, 0, 0]}", "obstacles[1].pose: unknown key; allowed: map, unknown"),
        ("{circle: 1, center: [9, 9], unknown: free}", "obstacles[1].unknown: unknown key; allowed: circle, center"),
        ("{map: maps/office.yaml, circle: 1}", "obstacles[1]: has map and circle; allowed: a list of at most"),
    ],
)  # fmt: skip
def test_a_map_that_cannot_be_had_is_told_with_its_place(obstacle: str, what: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as caught:
        pushplan.load_scenario(_write(tmp_path, obstacle))
    assert what in str(caught.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("pipe", ["maps/office.pgm", "maps/office.yaml"])
def test_a_pipe_is_no_map(tmp_path: Path, pipe: str) -> None:
    file = _write(tmp_path)
    (tmp_path / pipe).unlink()
    os.mkfifo(tmp_path / pipe)
    with pytest.raises(ScenarioError, match="this is no regular file"):
        pushplan.load_scenario(file)
    with pytest.raises(ImportedFileError, match="this is no regular file"):
        read_ros_map(tmp_path / "maps" / "office.yaml")


def _of(cells: npt.NDArray[np.uint8], folder: Path) -> Path:
    Image.fromarray(cells).save(folder / "map.png")
    (folder / "map.yaml").write_text("image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    return folder / "map.yaml"


@pytest.mark.parametrize(
    ("blocked", "told"),
    [
        (
            np.indices((1000, 1000)).sum(axis=0) % 2 == 0,
            "has 500000 separate runs of blocked cells in its rows",
        ),
        ((np.indices((400, 400)) % 4 == 0).any(axis=0), "has 9801 places that blocked cells close off"),
        (np.indices((400, 400)).sum(axis=0) % 2 == 0, "has 80000 separate regions of blocked cells"),
        ((np.indices((500, 500)) % 4 == 0).all(axis=0), "has 15625 separate regions of blocked cells"),
    ],
)
def test_a_map_of_specks_is_refused_with_their_number(
    blocked: npt.NDArray[np.bool_], told: str, tmp_path: Path
) -> None:
    with pytest.raises(ImportedFileError, match=f"{told}; allowed: .* smooth the picture"):
        read_ros_map(_of(np.where(blocked, OCCUPIED, FREE).astype(np.uint8), tmp_path))
