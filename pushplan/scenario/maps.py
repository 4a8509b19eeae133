"""Obstacles from an occupancy map as ROS keeps it: a YAML file that names a picture (map_server).

What a picture may cost is bounded: its cells before it is decoded, the runs of cells before they become polygons, and
the corners of these.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
from pydantic import BaseModel, ConfigDict, Field

from pushplan.errors import ImportedFileError, SupportError
from pushplan.geometry.polygon import LEAST_AREA, SAME_POINT, find_flaw
from pushplan.geometry.se2 import transform_points
from pushplan.scenario import fields as t
from pushplan.scenario import units
from pushplan.scenario.parts import PolygonObstacle, Workspace
from pushplan.scenario.source import MOST_BYTES, DocumentError, Source
from pushplan.scenario.units import Quantity
from pushplan.scenario.validation import validate
from pushplan.util.arrays import BoolArray, FloatArray, IntArray
from pushplan.util.files import read_regular

MOST_PICTURE = 1 << 28
"""Bytes up to which a picture is read."""

FORMATS = ("PPM", "PNG", "BMP")
"""Decoders of Pillow that may be used, PGM among PPM. Others, like EPS, start programs or are little used."""

MOST_CELLS = 1 << 26
"""Cells up to which a map is read."""

MOST_RUNS = 100_000
"""Runs of blocked cells in a row up to which a map is read."""

MOST_REGIONS = 10_000
"""Separate regions up to which a map is read: as many as a scenario may have obstacles."""

UNKNOWN_GREY = 205
"""map_saver writes this for what is unknown, with thresholds by which it would be free: 50/255 < 0.25."""

HUNDRED = 100.0
"""In the mode raw the grey value is the occupancy in per cent; larger values say that nothing is known."""

_BLOCK = 1 << 20
"""Cells that are looked at together, so that a large picture needs little memory."""

_GRID = 10.0 * SAME_POINT
"""Spacing of the points on which outlines are put where theirs are too near to one another, m."""

MOST_HOLES = 5_000
"""Free places within regions up to which a map is read: each is cut open, and 10,000 took 15 s."""

_Share = Annotated[float, Quantity("a probability", {}, 0.0, 1.0)]
_Resolution = Annotated[float, Quantity("a length", units.LENGTH, 1e-4, 100.0, "5 cm")]


class _MapFile(BaseModel):
    """What map_server reads; other keys are left to others."""

    model_config = ConfigDict(extra="ignore", defer_build=True)

    image: t.FileName = Field(description="the name of a picture")
    resolution: _Resolution = Field(description="the side of a cell, a length in m")
    origin: t.Pose = Field(description="[x, y, yaw] of the lower left corner in the world")
    negate: Annotated[int, Quantity("0 or 1", {}, 0, 1, whole=True)] = Field(default=0, description="0 or 1")
    occupied_thresh: _Share = Field(default=0.65, description="a probability from 0 to 1")
    free_thresh: _Share = Field(default=0.196, description="a probability from 0 to 1")
    mode: Literal["trinary", "scale", "raw"] = Field(default="trinary", description="trinary, scale or raw")

    def to_world(self, corners: FloatArray) -> FloatArray:
        """Return corners (v, 2), in cells from the lower left one, in the world."""
        return transform_points(np.array(self.origin), corners * self.resolution)


@dataclass(frozen=True)
class RosMap:
    """What a map says of the world.

    Attributes:
        obstacles: Polygons that cover every occupied cell and, where asked for, every unknown one.
        workspace: The rectangle around the map; obstacles fill what it has beyond a map that is turned.
        resolution: Side of a cell, m.
    """

    obstacles: tuple[PolygonObstacle, ...]
    workspace: Workspace
    resolution: float


def read_ros_map(path: str | Path, *, unknown_is_free: bool = False, tolerance: float | None = None) -> RosMap:
    """Read a map file and its picture (PGM, PNG or BMP).

    Args:
        path: The YAML file.
        unknown_is_free: Whether the chain may go where the map knows nothing.
        tolerance: How far corners may be moved to have fewer of them, m; three quarters of a cell if left out. The
            obstacles always cover the cells; they reach at most three times as far beyond them.

    Raises:
        ImportedFileError: If the file or its picture cannot be read.
    """
    path = Path(path)
    read = map_files(path, path.name).__getitem__
    return ros_map_of(path.name, read, unknown_is_free=unknown_is_free, tolerance=tolerance)


def map_files(path: Path, name: str) -> dict[str, bytes]:
    """Return what a map's YAML file and its picture hold, by `name` and the picture's name beside it.

    Raises:
        ImportedFileError: If one of them cannot be read.
    """
    data = bytes_of(path, MOST_PICTURE)
    image = _map_file(data, str(path)).image
    return {name: data, _beside(name, image): bytes_of(path.parent / image, MOST_PICTURE)}


def bytes_of(path: Path, most: int) -> bytes:
    """Return what a file that is imported holds.

    Raises:
        ImportedFileError: If it cannot be read, or holds more than so many bytes.
    """
    try:
        data = read_regular(path, most + 1)
    except OSError as error:
        raise ImportedFileError(f"{path}: cannot read the file: {error.strerror or error}") from error
    if len(data) > most:
        raise ImportedFileError(f"{path}: is larger than the {most} bytes allowed")
    return data


def _beside(name: str, image: str) -> str:
    """Return the name of a map's picture, relative to the folder of its YAML file."""
    return str(PurePosixPath(name).parent / image)


def ros_map_of(
    name: str, read: Callable[[str], bytes], *, unknown_is_free: bool = False, tolerance: float | None = None
) -> RosMap:
    """Return the map whose files another one reads; see `read_ros_map`.

    Args:
        name: Of the YAML file.
        read: Returns what a file holds, by its name; the picture's is relative to the folder of `name`.
        unknown_is_free: Whether the chain may go where the map knows nothing.
        tolerance: How far corners may be moved, m.
    """
    file = _map_file(read(name), name)
    picture = _beside(name, file.image)
    thresholds = file.occupied_thresh, file.free_thresh
    try:
        data = read(picture)
    except SupportError as error:
        raise ImportedFileError(f"{name}: image: {error}") from error
    cells = cells_of(data, picture, file.mode, bool(file.negate), *thresholds)
    height, width = cells.occupied.shape
    frame = file.to_world(np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64))
    (xmin, ymin), (xmax, ymax) = frame.min(axis=0), frame.max(axis=0)
    unknown = shapely.Polygon() if unknown_is_free else _region(cells.unknown, file, picture)
    if file.origin[2] != 0.0:  # beyond a turned map nothing is known, whatever is unknown within it
        unknown |= shapely.box(xmin, ymin, xmax, ymax) - shapely.Polygon(frame)
    fewer = 0.75 * file.resolution if tolerance is None else tolerance
    obstacles = [
        PolygonObstacle(outline, unknown=is_unknown)
        for region, is_unknown in ((_region(cells.occupied, file, picture), False), (unknown, True))
        for outline in hole_free(covering(region, fewer))
    ]
    area = Workspace(float(xmin), float(xmax), float(ymin), float(ymax))
    return RosMap(tuple(obstacles), area, file.resolution)


def _map_file(data: bytes, shown: str) -> _MapFile:
    try:
        source = Source(data[: MOST_BYTES + 1], shown)
    except DocumentError as error:
        raise ImportedFileError("\n".join(f.text(shown) for f in error.findings)) from error
    file = validate(_MapFile, source)
    if file is None:
        raise ImportedFileError("\n".join(finding.text(shown) for finding in source.findings))
    return file


# --- which cells are occupied, as Nav2's map_server reads them ---


class Cells(NamedTuple):
    """Which cells (rows from the bottom, columns) are occupied, and of which nothing is known for certain."""

    occupied: BoolArray
    unknown: BoolArray


def cells_of(picture: bytes, name: str, mode: str, negate: bool, occupied: float, free: float) -> Cells:
    """Return what the cells of a picture are.

    In the modes trinary and scale the occupancy is the darkness, or the brightness if `negate`; what lies between
    the thresholds is neither known to be free nor to be occupied. A transparent cell is unknown in every mode, one of
    the grey value 205 in trinary, whatever the thresholds say.

    Args:
        picture: A PGM, PPM, PNG or BMP file.
        name: What messages call it.
        mode: trinary, scale or raw.
        negate: Whether bright cells are occupied.
        occupied: Occupancy from 0 to 1 above which a cell is occupied.
        free: Occupancy below which it is free.

    Raises:
        ImportedFileError: If the picture cannot be read.
    """
    grey = np.arange(3 * 255 + 1) / 3.0  # by the sum of red, green and blue
    shade = grey if negate else 255.0 - grey
    occupancy = shade / (HUNDRED if mode == "raw" else 255.0)
    unclear = shade > HUNDRED if mode == "raw" else (grey == UNKNOWN_GREY) & (mode == "trinary")
    taken = (occupancy > occupied) & ~unclear
    unknown = ~taken & ~((occupancy < free) & ~unclear)
    blocks = [
        ((taken[sums] & ~hidden)[::-1], (unknown[sums] | hidden)[::-1]) for sums, hidden in _blocks_of(picture, name)
    ]
    return Cells(*(np.concatenate(parts) for parts in zip(*blocks[::-1], strict=True)))


def _blocks_of(picture: bytes, name: str) -> Iterator[tuple[npt.NDArray[np.uint16], BoolArray | np.bool_]]:
    """Yield the sums of red, green and blue (rows from the top, columns), and what is not opaque, by some rows."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(picture), formats=FORMATS) as image:
            if image.width * image.height > MOST_CELLS:
                raise ImportedFileError(
                    f"{name}: has {image.width} x {image.height} cells; allowed: {MOST_CELLS} cells"
                )
            rows = max(1, _BLOCK // image.width)
            for top in range(0, image.height, rows):
                part = image.crop((0, top, image.width, min(top + rows, image.height)))
                values: Any
                if image.mode == "L" and "transparency" not in image.info:  # as most maps are, and 5 times as fast
                    values = np.asarray(part, dtype=np.uint16)
                    yield 3 * values, np.False_
                else:
                    values = np.asarray(part.convert("RGBA"), dtype=np.uint8)
                    yield values[:, :, :3].sum(axis=2, dtype=np.uint16), values[:, :, 3] < 255
    except ImportedFileError:
        raise
    except UnidentifiedImageError as error:
        raise ImportedFileError(f"{name}: is no PGM, PPM, PNG or BMP picture; others are not read") from error
    except Exception as error:  # Pillow's plugins raise whatever they stumble over
        raise ImportedFileError(f"{name}: cannot read the picture: {error}") from error


# --- from cells to polygons without holes, of a bounded number of corners: what obstacles can be ---


def _region(blocked: BoolArray, file: _MapFile, name: str) -> shapely.Geometry:
    """Return the union of cells in the world; runs of cells in a row are one rectangle."""
    rows, begins, ends, count = [], [], [], 0
    step = max(1, _BLOCK // blocked.shape[1])
    for top in range(0, len(blocked), step):
        edges = np.diff(np.pad(blocked[top : top + step].view(np.int8), ((0, 0), (1, 1))), axis=1)
        row, begin = np.nonzero(edges == 1)
        count += len(row)
        if count <= MOST_RUNS:
            rows.append(row + top)
            begins.append(begin)
            ends.append(np.nonzero(edges == -1)[1])
    _require(count, MOST_RUNS, "separate runs of blocked cells in its rows", name)
    row, begin, end = (np.concatenate(parts) for parts in (rows, begins, ends))
    regions, holes = _regions_and_holes(row, begin, end)
    _require(regions, MOST_REGIONS, "separate regions of blocked cells", name)
    _require(holes, MOST_HOLES, "places that blocked cells close off", name)
    return shapely.transform(shapely.union_all(shapely.box(begin, row, end, row + 1)), file.to_world)


def _regions_and_holes(row: IntArray, begin: IntArray, end: IntArray) -> tuple[int, int]:
    """Return how many regions runs of cells (n,), sorted by row and begin, form, and how many holes these have.

    Runs meet along edges of cells. Where k pairs of n runs meet, regions less holes are n - k: Euler's number.
    """
    width = int(end.max(initial=0)) + 1
    # They take a fifth of a second to load, which most scenarios have no use for.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    below = (row + 1) * width
    first = np.searchsorted(row * width + end, below + begin, side="right")
    last = np.searchsorted(row * width + begin, below + end, side="left")
    counts = np.maximum(last - first, 0)
    upper = np.repeat(np.arange(len(row)), counts)
    lower = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
    meet = coo_array((np.ones(len(upper), dtype=np.int8), (upper, lower)), shape=(len(row), len(row)))
    regions = int(connected_components(meet, directed=False)[0])
    return regions, regions - len(row) + len(upper)


def _require(count: int, most: int, what: str, name: str) -> None:
    """Refuse a picture with more than can be made obstacles of."""
    if count > most:
        raise ImportedFileError(
            f"{name}: has {count} {what}; allowed: {most}; smooth the picture (single cells are mostly noise), or "
            "save it with larger cells"
        )


def hole_free(region: shapely.Geometry) -> Iterator[FloatArray]:
    """Yield counter-clockwise outlines (v, 2) that cover a region; pieces below 1 mm^2 are left out.

    A polygon with a hole is cut in two along a line through the hole, one with too many corners in its middle.
    """
    pending = list(shapely.get_parts(region))
    while pending:
        part = pending.pop()
        if not isinstance(part, shapely.Polygon) or part.is_empty:
            continue
        if part.interiors or len(part.exterior.coords) > t.MOST_CORNERS:
            pending += _halves(part)
            continue
        outline = shapely.get_coordinates(shapely.orient_polygons(part).exterior)[:-1]
        outline = outline[np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1) > SAME_POINT]
        if len(outline) > 2 and find_flaw(outline) is None:
            yield outline
        elif part.area >= LEAST_AREA:
            # Corners nearer than SAME_POINT were taken together, and edges cross now. On a grid they do not.
            pending += shapely.get_parts(
                shapely.set_precision(part.buffer(_GRID, join_style="mitre"), _GRID)
            ).tolist()


def covering(region: shapely.Geometry, tolerance: float) -> shapely.Geometry:
    """Return a region with fewer corners that covers `region`; it reaches at most three times `tolerance` farther.

    What is left out lies within about the tolerance of the new edges; growing by as much covers it again. A
    polygon of the region for which it does not stays as it is. Each is looked at on its own: from thousands of
    corners to a whole map is a long way.
    """
    parts = shapely.get_parts(region)
    simple = shapely.simplify(parts, tolerance)
    corners, owner = shapely.get_coordinates(parts, return_index=True)
    reach = np.zeros(len(parts))
    np.maximum.at(reach, owner, shapely.distance(shapely.points(corners), simple[owner]))
    missed = np.flatnonzero(reach <= tolerance)
    while len(missed):
        grown = shapely.buffer(simple[missed], reach[missed], join_style="mitre", mitre_limit=2.0)
        covers = shapely.covers(grown, parts[missed])
        parts[missed[covers]] = grown[covers]
        reach[missed] = np.maximum(1.2 * reach[missed], 1e-3 * tolerance)
        missed = missed[~covers & (reach[missed] <= tolerance)]
    return shapely.union_all(parts)


def _halves(polygon: shapely.Polygon) -> list[shapely.Geometry]:
    """Cut through the first hole's middle, or else through the polygon's, across its longer side."""
    xmin, ymin, xmax, ymax = (polygon.interiors[0] if polygon.interiors else polygon).bounds
    whole = polygon.bounds
    if xmax - xmin >= ymax - ymin:
        x = 0.5 * (xmin + xmax)
        sides = shapely.box(whole[0], whole[1], x, whole[3]), shapely.box(x, whole[1], whole[2], whole[3])
    else:
        y = 0.5 * (ymin + ymax)
        sides = shapely.box(whole[0], whole[1], whole[2], y), shapely.box(whole[0], y, whole[2], whole[3])
    return [part for side in sides for part in shapely.get_parts(polygon & side)]
