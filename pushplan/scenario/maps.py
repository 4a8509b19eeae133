"""Reads obstacles from an occupancy map of ROS (map_server): a YAML file that names a picture.

The cost of a picture is bounded: the number of cells is checked before it is decoded, and the number of runs before
they become polygons. The corners of the polygons are limited, too.
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
"""Largest size of a picture, bytes."""

FORMATS = ("PPM", "PNG", "BMP")
"""Allowed decoders of Pillow; PPM includes PGM. Others, such as EPS, start programs or are rarely used."""

MOST_CELLS = 1 << 26
"""Largest number of cells of a map."""

MOST_RUNS = 100_000
"""Largest number of runs of adjacent blocked cells in the rows of a map."""

MOST_REGIONS = 10_000
"""Largest number of separate regions of a map: the allowed number of obstacles in a scenario."""

UNKNOWN_GREY = 205
"""Grey value of unknown cells in pictures from map_saver. By its thresholds such a cell would be free:
50/255 < 0.25."""

HUNDRED = 100.0
"""Largest grey value of a known cell in the mode raw, in which the grey value is the occupancy in per cent."""

_BLOCK = 1 << 20
"""Number of cells that are processed together, so that a large picture needs little memory."""

_GRID = 10.0 * SAME_POINT
"""Spacing of the grid for outlines whose points are too near to each other, m."""

MOST_HOLES = 5_000
"""Largest number of free places within regions of a map: each is cut open, and 10,000 took 15 s."""

_Share = Annotated[float, Quantity("a probability", {}, 0.0, 1.0)]
_Resolution = Annotated[float, Quantity("a length", units.LENGTH, 1e-4, 100.0, "5 cm")]


class _MapFile(BaseModel):
    """The YAML file of a map; keys that map_server does not read are ignored."""

    model_config = ConfigDict(extra="ignore", defer_build=True)

    image: t.FileName = Field(description="the name of a picture")
    resolution: _Resolution = Field(description="the side of a cell, a length in m")
    origin: t.Pose = Field(description="[x, y, yaw] of the lower left corner in the world")
    negate: Annotated[int, Quantity("0 or 1", {}, 0, 1, whole=True)] = Field(default=0, description="0 or 1")
    occupied_thresh: _Share = Field(default=0.65, description="a probability from 0 to 1")
    free_thresh: _Share = Field(default=0.196, description="a probability from 0 to 1")
    mode: Literal["trinary", "scale", "raw"] = Field(default="trinary", description="trinary, scale or raw")

    def to_world(self, corners: FloatArray) -> FloatArray:
        """Return the world positions of corners (v, 2), which are in cells from the map's lower left corner."""
        return transform_points(np.array(self.origin), corners * self.resolution)


@dataclass(frozen=True)
class RosMap:
    """Obstacles and extent of a map in the world.

    Attributes:
        obstacles: Polygons that cover every occupied cell and, unless they count as free, every unknown one.
        workspace: Rectangle around the map. Around a rotated map, obstacles fill the rest of the rectangle.
        resolution: Side of a cell, m.
    """

    obstacles: tuple[PolygonObstacle, ...]
    workspace: Workspace
    resolution: float


def read_ros_map(path: str | Path, *, unknown_is_free: bool = False, tolerance: float | None = None) -> RosMap:
    """Read a map file and its picture (PGM, PNG or BMP).

    Args:
        path: YAML file.
        unknown_is_free: Whether unknown cells are free.
        tolerance: Largest displacement of corners when outlines are simplified, m; None for three quarters of a
            cell. The obstacles always cover the cells, and extend beyond them by at most three times the tolerance.

    Raises:
        ImportedFileError: If the file or its picture cannot be read.
    """
    path = Path(path)
    read = map_files(path, path.name).__getitem__
    return ros_map_of(path.name, read, unknown_is_free=unknown_is_free, tolerance=tolerance)


def map_files(path: Path, name: str) -> dict[str, bytes]:
    """Return the contents of a map's YAML file, under `name`, and of its picture, under a name beside it.

    Raises:
        ImportedFileError: If one of them cannot be read.
    """
    data = bytes_of(path, MOST_PICTURE)
    image = _map_file(data, str(path)).image
    return {name: data, _beside(name, image): bytes_of(path.parent / image, MOST_PICTURE)}


def bytes_of(path: Path, most: int) -> bytes:
    """Return the content of an imported file.

    Raises:
        ImportedFileError: If it cannot be read, or is larger than `most` bytes.
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
    """Return the map whose files `read` returns; see `read_ros_map`.

    Args:
        name: Name of the YAML file.
        read: Function that returns the content of a file by its name; the picture's is relative to that of `name`.
        unknown_is_free: Whether unknown cells are free.
        tolerance: Largest displacement of corners, m.
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
    if file.origin[2] != 0.0:  # the space around a rotated map is always unknown
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


# --- occupied cells, as Nav2's map_server reads them ---


class Cells(NamedTuple):
    """Masks of the occupied and the unknown cells (rows from the bottom, columns)."""

    occupied: BoolArray
    unknown: BoolArray


def cells_of(picture: bytes, name: str, mode: str, negate: bool, occupied: float, free: float) -> Cells:
    """Return the occupied and the unknown cells of a picture.

    In the modes trinary and scale, the occupancy is the darkness, or the brightness if `negate`. Cells between the
    thresholds are unknown. Regardless of the thresholds, transparent cells are unknown in every mode, and cells with
    the grey value 205 in trinary.

    Args:
        picture: Content of a PGM, PPM, PNG or BMP file.
        name: Name for messages.
        mode: trinary, scale or raw.
        negate: Whether bright cells are occupied.
        occupied: Occupancy from 0 to 1 above which a cell is occupied.
        free: Occupancy from 0 to 1 below which a cell is free.

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
    """Yield blocks of rows from the top: sums of red, green and blue, and the mask of cells that are not opaque."""
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
                if image.mode == "L" and "transparency" not in image.info:  # true for most maps, and 5 times as fast
                    values = np.asarray(part, dtype=np.uint16)
                    yield 3 * values, np.False_
                else:
                    values = np.asarray(part.convert("RGBA"), dtype=np.uint8)
                    yield values[:, :, :3].sum(axis=2, dtype=np.uint16), values[:, :, 3] < 255
    except ImportedFileError:
        raise
    except UnidentifiedImageError as error:
        raise ImportedFileError(f"{name}: is not a picture; allowed: PGM, PPM, PNG and BMP") from error
    except Exception as error:  # Pillow's plugins raise errors of many types
        raise ImportedFileError(f"{name}: cannot read the picture: {error}") from error


# --- obstacles: polygons without holes and with a limited number of corners ---


def _region(blocked: BoolArray, file: _MapFile, name: str) -> shapely.Geometry:
    """Return the union of the blocked cells in the world; each run of adjacent cells in a row is one rectangle."""
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
    _require(holes, MOST_HOLES, "free places enclosed by blocked cells", name)
    return shapely.transform(shapely.union_all(shapely.box(begin, row, end, row + 1)), file.to_world)


def _regions_and_holes(row: IntArray, begin: IntArray, end: IntArray) -> tuple[int, int]:
    """Return the number of regions that runs of cells (n,) form, and the number of their holes.

    The runs are sorted by row and begin, and meet along edges of cells. If k pairs of n runs meet, the number of
    regions minus the number of holes is n - k (Euler's number).
    """
    width = int(end.max(initial=0)) + 1
    # These modules take 0.2 s to load, and most scenarios do not need them.
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
    """Raise an error if a picture has too many items."""
    if count > most:
        raise ImportedFileError(
            f"{name}: has {count} {what}; allowed: {most}; smooth the picture (single cells are usually noise), or "
            "save it with larger cells"
        )


def hole_free(region: shapely.Geometry) -> Iterator[FloatArray]:
    """Yield counter-clockwise outlines (v, 2) that cover a region, without pieces below 1 mm^2.

    A polygon with a hole is cut in two along a line through the hole, and a polygon with too many corners in its
    middle.
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
            # Merging corners nearer than SAME_POINT made edges cross. On a grid they do not cross.
            pending += shapely.get_parts(
                shapely.set_precision(part.buffer(_GRID, join_style="mitre"), _GRID)
            ).tolist()


def covering(region: shapely.Geometry, tolerance: float) -> shapely.Geometry:
    """Return a region with fewer corners that covers `region` and extends beyond it by at most 3 times `tolerance`.

    The simplified polygon misses points within about the tolerance; growing it by this distance covers them again. A
    polygon for which this fails is kept unchanged. Each polygon is processed separately, because distances from
    thousands of corners to a whole map take long.
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
    """Cut a polygon in two through the middle of its first hole, or else of itself, across the longer side."""
    xmin, ymin, xmax, ymax = (polygon.interiors[0] if polygon.interiors else polygon).bounds
    whole = polygon.bounds
    if xmax - xmin >= ymax - ymin:
        x = 0.5 * (xmin + xmax)
        sides = shapely.box(whole[0], whole[1], x, whole[3]), shapely.box(x, whole[1], whole[2], whole[3])
    else:
        y = 0.5 * (ymin + ymax)
        sides = shapely.box(whole[0], whole[1], whole[2], y), shapely.box(whole[0], y, whole[2], whole[3])
    return [part for side in sides for part in shapely.get_parts(polygon & side)]
