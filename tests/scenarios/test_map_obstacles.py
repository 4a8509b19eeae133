"""Maps and drawings from other programs: size and position, unknown areas, and clear errors."""

import io
import os
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from conftest import there
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import pushplan
from pushplan.errors import ImportedFileError, ScenarioError
from pushplan.scenario.drawings import read_csv_outlines, read_svg_outlines
from pushplan.scenario.fields import MOST_CORNERS
from pushplan.scenario.maps import cells_of, covering, hole_free, read_ros_map
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle

MAP = """\
image: map.pgm
resolution: 0.05
origin: [-1.0, -2.0, {}]
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
    """Return a walled room, 7 x 5 m, with an unknown block between start and goal and room to pass above it."""
    cells = np.full((100, 140), FREE, np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    cells[60:99, 40:100] = UNKNOWN
    return cells


def _map(folder: Path, cells: npt.NDArray[np.uint8], turned: float = 0.0) -> Path:
    """Write a map; row 0 of `cells` is the uppermost."""
    folder.mkdir(exist_ok=True)
    Image.fromarray(cells).save(folder / "map.pgm")
    (folder / "map.yaml").write_text(MAP.format(turned))
    return folder / "map.yaml"


def _write(folder: Path, obstacle: str = "{map: maps/map.yaml}") -> Path:
    _map(folder / "maps", _room())
    file = folder / "push.yaml"
    file.write_text(SCENARIO.format(obstacle=obstacle))
    return file


def _polygons(scenario: Scenario, unknown: bool) -> shapely.Geometry:
    found = [o for o in scenario.obstacles if isinstance(o, PolygonObstacle) and o.unknown == unknown]
    return shapely.union_all([shapely.Polygon(o.outline) for o in found])


def _cells(row: list[int], mode: str, negate: bool = False, free: float = 0.25) -> str:
    """Return occupied (#), unknown (?) and free (.) cells of a picture with one row."""
    stream = io.BytesIO()
    Image.fromarray(np.array([row], np.uint8)).save(stream, "PPM")
    found = cells_of(stream.getvalue(), "row.pgm", mode, negate, 0.65, free)
    return "".join(np.where(found.occupied, "#", np.where(found.unknown, "?", "."))[0])


@pytest.mark.parametrize("free", [0.196, 0.25])
def test_unknown_cells_of_map_saver_stay_unknown_for_every_threshold(free: float) -> None:
    """map_saver of Nav2 writes 205 and free_thresh 0.25; 50/255 = 0.196 < 0.25 would make it floor."""
    assert _cells([254, 205, 0], "trinary", free=free) == ".?#"


def test_each_mode_reads_grey_values_as_map_server_does() -> None:
    greys = [255, 230, 205, 150, 80, 0]
    assert _cells(greys, "trinary") == "..??##"
    assert _cells(greys, "scale") == "...?##"  # in this mode 205 is an ordinary occupancy
    assert _cells(greys, "scale", negate=True) == "###??."
    # In raw the value is the occupancy in per cent, and values above 100 are unknown.
    assert _cells([255, 245, 215, 180, 155, 154, 0], "raw") == "..?##??"


def test_plans_avoid_unknown_areas_unless_these_are_declared_free(tmp_path: Path) -> None:
    scenario = pushplan.load_scenario(_write(tmp_path))
    around = pushplan.plan(scenario, seed=1, iterations=2_000, time_limit=60.0)
    swept = shapely.MultiPoint(there(around.path).sampled(0.02)[:, :2])
    assert shapely.distance(swept, shapely.box(1.0, -1.95, 4.0, 0.0)) > 0.2
    said = (tmp_path / "push.yaml").read_text().replace("yaml}", "yaml, unknown: free}")
    (tmp_path / "free.yaml").write_text(said)
    free = pushplan.load_scenario(tmp_path / "free.yaml")
    assert shapely.is_empty(_polygons(free, unknown=True))
    through = pushplan.plan(free, seed=1, iterations=2_000, time_limit=60.0)
    assert there(through.path).cost < 0.7 * there(around.path).cost


def test_a_log_holds_the_map_and_is_verified_without_its_files(tmp_path: Path) -> None:
    file = _write(tmp_path)
    scenario = pushplan.load_scenario(file)
    log = tmp_path / "run.mcap"
    pushplan.run(scenario, log=log, first=True, time_limit=60.0)
    for name in ("maps/map.yaml", "maps/map.pgm", "push.yaml"):
        (tmp_path / name).unlink()
    again = pushplan.load_run(log).scenario
    assert again.attachments == scenario.attachments
    assert shapely.equals(_polygons(again, unknown=True), _polygons(scenario, unknown=True))
    assert pushplan.verify_log(log).matches


@pytest.mark.parametrize(
    ("obstacle", "what"),
    [
        ("{map: gone.yaml}", "push.yaml:9:11: obstacles[1].map: cannot read 'gone.yaml': No such file or directory"),
        ("{map: ../map.yaml}", "obstacles[1].map: has the name '../map.yaml'; allowed: a file in the"),
        ("{map: maps/map.pgm}", "obstacles[1].map: maps/map.pgm"),
        ("{map: maps/map.yaml, unknown: maybe}", "obstacles[1].unknown: is the text 'maybe'; allowed: obstacle"),
        ("{map: maps/map.yaml, pose: [0, 0, 0]}", "obstacles[1].pose: unknown key; allowed: map, unknown"),
        ("{circle: 1, center: [9, 9], unknown: free}", "obstacles[1].unknown: unknown key; allowed: circle, center"),
        ("{map: maps/map.yaml, circle: 1}", "obstacles[1]: has map and circle; allowed: a list of at most"),
    ],
)  # fmt: skip
def test_a_missing_map_is_reported_with_its_place(obstacle: str, what: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as caught:
        pushplan.load_scenario(_write(tmp_path, obstacle))
    assert what in str(caught.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("pipe", ["maps/map.pgm", "maps/map.yaml"])
def test_a_pipe_is_not_a_map(tmp_path: Path, pipe: str) -> None:
    file = _write(tmp_path)
    (tmp_path / pipe).unlink()
    os.mkfifo(tmp_path / pipe)
    with pytest.raises(ScenarioError, match="this is not a regular file"):
        pushplan.load_scenario(file)
    with pytest.raises(ImportedFileError, match="this is not a regular file"):
        read_ros_map(tmp_path / "maps" / "map.yaml")


@pytest.mark.parametrize(("blocked", "told"), [
    (np.indices((1000, 1000)).sum(axis=0) % 2 == 0, "has 500000 separate runs of blocked cells in its rows"),
    ((np.indices((400, 400)) % 4 == 0).any(axis=0), "has 9801 free places enclosed by blocked cells"),
    (np.indices((400, 400)).sum(axis=0) % 2 == 0, "has 80000 separate regions of blocked cells"),
    ((np.indices((500, 500)) % 4 == 0).all(axis=0), "has 15625 separate regions of blocked cells"),
])  # fmt: skip
def test_a_map_of_specks_is_refused_with_their_number(
    blocked: npt.NDArray[np.bool_], told: str, tmp_path: Path
) -> None:
    with pytest.raises(ImportedFileError, match=f"{told}; allowed: .* smooth the picture"):
        read_ros_map(_map(tmp_path, np.where(blocked, OCCUPIED, FREE).astype(np.uint8)))


SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="200mm" height="100mm" viewBox="0 0 400 200">
<g transform="translate(20,20)">{}</g></svg>"""


NESTED = "".join(f'<g id="a{k}">' + f'<use href="#a{k + 1}"/>' * 10 + "</g>" for k in range(7)) + '<g id="a7"/>'


def _drawing(folder: Path, shapes: str) -> Path:
    file = folder / "drawing.svg"
    file.write_text(SVG.format(shapes))
    return file


def test_shapes_of_a_drawing_have_their_printed_size_and_y_up(tmp_path: Path) -> None:
    drawing = _drawing(
        tmp_path, '<rect id="crate" x="0" y="0" width="80" height="60"/><polygon points="0,0 40,0 0,80"/>'
    )
    outlines = read_svg_outlines(drawing, centered=False)
    assert list(outlines) == ["crate", "shape-2"]
    np.testing.assert_allclose(outlines["crate"].min(axis=0), [0.01, -0.04], atol=1e-6)
    np.testing.assert_allclose(outlines["crate"].max(axis=0), [0.05, -0.01], atol=1e-6)
    triangle = shapely.Polygon(outlines["shape-2"])
    assert triangle.exterior.is_ccw
    assert triangle.area == pytest.approx(0.02 * 0.04 / 2.0, rel=1e-5)
    centered = shapely.Polygon(read_svg_outlines(drawing)["shape-2"])
    np.testing.assert_allclose([centered.centroid.x, centered.centroid.y], 0.0, atol=1e-12)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_curves_become_chords_within_the_tolerance(tolerance: float, tmp_path: Path) -> None:
    drawing = _drawing(tmp_path, '<circle id="tin" cx="100" cy="80" r="60"/>')
    tin = shapely.Polygon(read_svg_outlines(drawing, tolerance=tolerance)["tin"])
    true = shapely.Point(0.0, 0.0).buffer(0.03, quad_segs=500)
    assert shapely.hausdorff_distance(tin.exterior, true.exterior, densify=0.01) < 1.2 * tolerance
    assert len(tin.exterior.coords) < 20 / np.sqrt(tolerance / 0.03)


@pytest.mark.parametrize(("shapes", "what"), [
    ("", "the drawing has no shape; needed: a path"),
    ('<path id="p" d="M 0 0 L 10 0 L 10 10"/>', "p: is open; allowed: one closed outline"),
    ('<path id="p" d="M0 0 L9 0 L9 9 Z M2 2 L3 2 L3 3 Z"/>', "p: has 2 outlines; allowed: one closed outline"),
    ('<path id="p" d="M0 0 L9 9 L9 0 L0 9 Z"/>', "must be a simple polygon"),
    ('<rect id="r" width="9" height="9"/>' * 2, "two shapes are called 'r'"),
    ("<rect", "cannot read the drawing"),
    ('<rect x="nan" width="9" height="9"/>', "x is 'nan'; allowed: a finite length"),
    ('<rect id="r" width="-10" height="9"/>', "r: width is '-10'; allowed: a finite length, not below 0"),
    (f'<polygon points="{" ".join(f"{i},{i * i}" for i in range(20_000))}"/>', "has 20000 points; allowed: 10000"),
    (NESTED, "elements; allowed: 10000"),
    ('<g id="a"><use href="#a"/></g>', "nested deeper than the 100 levels allowed"),
])  # fmt: skip
def test_a_drawing_without_outlines_is_refused(shapes: str, what: str, tmp_path: Path) -> None:
    with pytest.raises(ImportedFileError, match=r"drawing\.svg") as caught:
        read_svg_outlines(_drawing(tmp_path, shapes))
    assert what in str(caught.value)


def test_tables_hold_one_outline_or_several(tmp_path: Path) -> None:
    table = tmp_path / "wedge.csv"
    table.write_text("x, y\n0,0\n0,1\n1,0\n")
    np.testing.assert_array_equal(read_csv_outlines(table)["wedge"], [[1, 0], [0, 1], [0, 0]])
    table.write_text("\ufeffname,x,y\na,0,0\na,1,0\na,0,1\nb,0,0\nb,2,0\nb,2,2\n", encoding="utf-8")
    outlines = read_csv_outlines(table, centered=True)
    assert list(outlines) == ["a", "b"]
    np.testing.assert_allclose(outlines["b"].mean(axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize(("text", "what"), [
    ("a,b\n0,0\n", "wedge.csv:1: the header is 'a,b'; it must name x and y"),
    ("", "wedge.csv:1: the header is ''; it must name x and y"),
    ("x,y\n0,0\n1,nan\n", "wedge.csv:3: y is 'nan'; allowed: a finite number of metres"),
    ("x,y\n0,0\n1\n", "wedge.csv:3: y is ''; allowed: a finite number of metres"),
    ("x,y\n0,0\n1,1\n", "has 2 vertices; a polygon needs at least 3"),
])  # fmt: skip
def test_a_table_without_an_outline_is_refused(text: str, what: str, tmp_path: Path) -> None:
    (tmp_path / "wedge.csv").write_text(text)
    with pytest.raises(ImportedFileError) as caught:
        read_csv_outlines(tmp_path / "wedge.csv")
    assert what in str(caught.value)


def _walled_room(seed: int = 1) -> npt.NDArray[np.uint8]:
    """Return a walled room with clutter and an unknown area outside."""
    rng = np.random.default_rng(seed)
    cells = np.full((60, 80), FREE, np.uint8)
    cells[:, :10] = UNKNOWN
    cells[[0, 59], :] = cells[:, [0, 79]] = OCCUPIED
    cells[5:55, [10, 79]] = cells[[5, 54], 10:] = OCCUPIED
    for row, column, size in rng.integers([10, 15, 1], [50, 70, 6], (8, 3)):
        cells[row : row + size, column : column + size] = OCCUPIED
    return cells


@pytest.mark.parametrize("turned", [0.0, 0.4, -2.0])
@pytest.mark.parametrize("unknown_is_free", [False, True])
def test_obstacles_cover_the_occupied_cells_and_little_more(
    turned: float, unknown_is_free: bool, tmp_path: Path
) -> None:
    cells = _walled_room()
    found = read_ros_map(_map(tmp_path, cells, turned), unknown_is_free=unknown_is_free)
    covered = shapely.union_all([shapely.Polygon(obstacle.outline) for obstacle in found.obstacles])
    rows, columns = np.indices(cells.shape)
    local = np.stack([columns.ravel() + 0.5, cells.shape[0] - rows.ravel() - 0.5], axis=1) * 0.05
    cos, sin = np.cos(turned), np.sin(turned)
    middles = shapely.points(local @ np.array([[cos, sin], [-sin, cos]]) + [-1.0, -2.0])
    blocked = (cells == OCCUPIED) if unknown_is_free else (cells != FREE)
    assert shapely.covers(covered, middles[blocked.ravel()]).all()
    from_wall = shapely.distance(middles[~blocked.ravel()], shapely.MultiPoint(middles[blocked.ravel()]))
    beyond = shapely.distance(covered, middles[~blocked.ravel()]) == 0.0
    assert from_wall[beyond].max(initial=0.0) < 0.05 * (0.71 + 3.0 * 0.75)
    area = found.workspace
    if turned == 0.0:
        np.testing.assert_allclose([area.xmin, area.xmax, area.ymin, area.ymax], [-1.0, 3.0, -2.0, 1.0])
    else:  # the area outside the map is not floor
        corners = shapely.points([(x, y) for x in (area.xmin, area.xmax) for y in (area.ymin, area.ymax)])
        assert shapely.distance(covered, corners).max() < 1e-9


@pytest.mark.parametrize(("old", "new", "what"), [
    ("resolution: 0.05", "resolution: 0", "map.yaml:2:13: resolution: is 0; allowed: a length"),
    ("origin: [-1.0, -2.0, 0.0]", "origin: [0, 0]", "origin: is a list of 2; allowed: [x, y, theta]"),
    ("image: map.pgm\n", "", "image: is missing; needed: the name of a picture"),
    ("image: map.pgm", "image: none.pgm", "none.pgm: cannot read the file: No such file"),
    ("image: map.pgm", "image: map.yaml", "map.yaml: is not a picture; allowed: PGM, PPM, PNG and BMP"),
    ("negate: 0", "negate: 0\nmode: grey", "mode: is the text 'grey'; allowed: trinary, scale or raw"),
    ("negate: 0", "negate: [", "map.yaml:"),
])  # fmt: skip
def test_an_unreadable_map_is_reported(old: str, new: str, what: str, tmp_path: Path) -> None:
    file = _map(tmp_path, _walled_room())
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(ImportedFileError) as caught:
        read_ros_map(file)
    assert what in str(caught.value)


@given(seed=st.integers(0, 10_000), share=st.floats(0.05, 0.7))
@settings(max_examples=20)
def test_any_region_is_covered_by_polygons_without_holes(seed: int, share: float) -> None:
    rows, columns = np.nonzero(np.random.default_rng(seed).random((14, 14)) < share)
    region = shapely.union_all(shapely.box(columns, rows, columns + 1, rows + 1))
    for tolerance in (0.0, 0.75):
        grown = covering(region, tolerance) if tolerance else region
        outlines = list(hole_free(grown))
        assert all(3 <= len(outline) <= MOST_CORNERS for outline in outlines)
        whole = shapely.union_all([shapely.Polygon(outline) for outline in outlines])
        assert shapely.area(shapely.difference(region, shapely.buffer(whole, 1e-9))) < 1e-9
        assert shapely.area(whole) == pytest.approx(shapely.area(grown), rel=1e-5)


def test_keys_that_a_map_leaves_out_have_the_values_of_map_server(tmp_path: Path) -> None:
    file = _map(tmp_path, _room())
    stated = read_ros_map(file)
    file.write_text("\n".join(MAP.format(0.0).splitlines()[:3]))
    for one, other in zip(stated.obstacles, read_ros_map(file).obstacles, strict=True):
        np.testing.assert_array_equal(one.outline, other.outline)
