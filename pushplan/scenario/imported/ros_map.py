"""Obstacles from an occupancy map as ROS keeps it: a YAML file that names a picture (map_server)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import BaseModel, ConfigDict, Field

from pushplan.errors import ImportedFileError, SupportError
from pushplan.geometry.se2 import transform_points
from pushplan.scenario.imported.hole_free import covering, hole_free
from pushplan.scenario.imported.map_cells import cells_of
from pushplan.scenario.parts import PolygonObstacle, Workspace
from pushplan.scenario.schema import types as t
from pushplan.scenario.schema.findings import validate
from pushplan.scenario.values import units
from pushplan.scenario.values.quantity import Quantity
from pushplan.scenario.yaml.text import MOST_BYTES, DocumentError
from pushplan.scenario.yaml.tree import read_document
from pushplan.util.arrays import BoolArray, FloatArray
from pushplan.util.regular_file import read_regular

MOST_PICTURE = 1 << 28
"""Bytes up to which a picture is read."""

_Share = Annotated[float, Quantity("a probability", {}, 0.0, 1.0)]
_Resolution = Annotated[float, Quantity("a length", units.LENGTH, 1e-4, 100.0, "5 cm")]


class _MapFile(BaseModel):
    """What map_server reads; other keys are left to others."""

    model_config = ConfigDict(extra="ignore")

    image: Annotated[str, Field(strict=True, min_length=1)] = Field(description="the name of a picture")
    resolution: _Resolution = Field(description="the side of a cell, a length in m")
    origin: t.Pose = Field(description="[x, y, yaw] of the lower left corner in the world")
    negate: Annotated[int, Quantity("0 or 1", {}, 0, 1, whole=True)] = Field(default=0, description="0 or 1")
    occupied_thresh: _Share = Field(default=0.65, description="a probability from 0 to 1")
    free_thresh: _Share = Field(default=0.196, description="a probability from 0 to 1")
    mode: Literal["trinary", "scale", "raw"] = Field(default="trinary", description="trinary, scale or raw")


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


def read_ros_map(
    path: str | Path, *, unknown_is_free: bool = False, tolerance: float | None = None
) -> RosMap:
    """Read a map file and its picture (PGM, PNG or BMP).

    Args:
        path: The YAML file.
        unknown_is_free: Whether the chain may go where the map knows nothing.
        tolerance: How far corners may be moved to have fewer of them, m; three quarters of a cell if left out. The
            obstacles always cover the cells; they reach at most three times as far beyond them.

    Raises:
        ImportedFileError: When the file or its picture cannot be read.
    """
    path = Path(path)
    read = map_files(path, path.name).__getitem__
    return ros_map_of(path.name, read, unknown_is_free=unknown_is_free, tolerance=tolerance)


def map_files(path: Path, name: str) -> dict[str, bytes]:
    """Return what a map's YAML file and its picture hold, by `name` and the picture's name beside it.

    Raises:
        ImportedFileError: When one of them cannot be read.
    """
    data = _bytes_of(path)
    image = _map_file(data, str(path)).image
    return {name: data, _beside(name, image): _bytes_of(path.parent / image)}


def _bytes_of(file: Path) -> bytes:
    try:
        return read_regular(file, MOST_PICTURE)
    except OSError as error:
        raise ImportedFileError(f"{file}: cannot read the file: {error.strerror or error}") from error


def _beside(name: str, image: str) -> str:
    """Return the name of a map's picture, relative to the folder of its YAML file."""
    return str(PurePosixPath(name).parent / image)


def ros_map_of(
    name: str,
    read: Callable[[str], bytes],
    *,
    unknown_is_free: bool = False,
    tolerance: float | None = None,
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
    negate, thresholds = bool(file.negate), (file.occupied_thresh, file.free_thresh)
    try:
        data = read(picture)
    except SupportError as error:
        raise ImportedFileError(f"{name}: image: {error}") from error
    cells = cells_of(data, picture, file.mode, negate, *thresholds)
    height, width = cells.occupied.shape
    frame = _to_world(np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64), file)
    (xmin, ymin), (xmax, ymax) = frame.min(axis=0), frame.max(axis=0)
    area = Workspace(float(xmin), float(xmax), float(ymin), float(ymax))
    unknown = _region(np.zeros_like(cells.unknown) if unknown_is_free else cells.unknown, file)
    if file.origin[2] != 0.0:  # beyond a turned map nothing is known, whatever is unknown within it
        unknown |= shapely.box(xmin, ymin, xmax, ymax) - shapely.Polygon(frame)
    fewer = 0.75 * file.resolution if tolerance is None else tolerance
    occupied = _region(cells.occupied, file)
    obstacles = [
        PolygonObstacle(outline, unknown=is_unknown)
        for region, is_unknown in ((occupied, False), (unknown, True))
        for outline in hole_free(covering(region, fewer))
    ]
    return RosMap(tuple(obstacles), area, file.resolution)


def _map_file(data: bytes, shown: str) -> _MapFile:
    try:
        document = read_document(data[: MOST_BYTES + 1])
    except DocumentError as error:
        raise ImportedFileError("\n".join(f.text(shown) for f in error.findings)) from error
    file, faults = validate(_MapFile, document)
    if file is None:
        raise ImportedFileError("\n".join(fault.text(shown) for fault in faults.values()))
    return file


def _region(blocked: BoolArray, file: _MapFile) -> shapely.Geometry:
    """Return the union of cells in the world; runs of cells in a row are one rectangle."""
    edges = np.diff(np.pad(blocked.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, begin = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    cells = shapely.union_all(shapely.box(begin, row, end, row + 1))
    return shapely.transform(cells, lambda corners: _to_world(corners, file))


def _to_world(corners: FloatArray, file: _MapFile) -> FloatArray:
    return transform_points(np.array(file.origin), corners * file.resolution)
