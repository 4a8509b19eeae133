"""Obstacles from an occupancy map as ROS keeps it: a YAML file that names a picture (map_server)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
import shapely
from pydantic import BaseModel, ConfigDict, Field

from pushplan.basics.arrays import FloatArray
from pushplan.errors import ImportedFileError
from pushplan.geometry.se2 import transform_points
from pushplan.reading.imported.hole_free import covering, hole_free
from pushplan.reading.schema import types as t
from pushplan.reading.schema.findings import validate
from pushplan.reading.values import units
from pushplan.reading.values.quantity import Quantity
from pushplan.reading.yaml.text import MOST_BYTES, DocumentError
from pushplan.reading.yaml.tree import read_document
from pushplan.scenario_parts import PolygonObstacle, Workspace

MOST_CELLS = 1 << 26
"""Cells up to which a map is read."""

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
    """Read a map file and its picture (PGM, PNG, ...).

    Args:
        path: The YAML file.
        unknown_is_free: Whether the chain may go where the map knows nothing.
        tolerance: How far corners may be moved to have fewer of them, m; three quarters of a cell if left out. The
            obstacles always cover the cells; they reach at most three times as far beyond them.

    Raises:
        ImportedFileError: When the file or its picture cannot be read.
    """
    path = Path(path)
    file = _read_file(path)
    cells = _blocked(path.parent / file.image, file, unknown_is_free)
    region = shapely.transform(_region(cells), lambda corners: _to_world(corners, file))
    height, width = cells.shape
    frame = _to_world(np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64), file)
    (xmin, ymin), (xmax, ymax) = frame.min(axis=0), frame.max(axis=0)
    if file.origin[2] != 0.0:
        region |= shapely.box(xmin, ymin, xmax, ymax) - shapely.Polygon(frame)
    simple = covering(region, 0.75 * file.resolution if tolerance is None else tolerance)
    obstacles = tuple(PolygonObstacle(outline) for outline in hole_free(simple))
    return RosMap(obstacles, Workspace(float(xmin), float(xmax), float(ymin), float(ymax)), file.resolution)


def _read_file(path: Path) -> _MapFile:
    try:
        with path.open("rb") as stream:
            document = read_document(stream.read(MOST_BYTES + 1))
    except OSError as error:
        raise ImportedFileError(f"{path}: cannot read the file: {error.strerror or error}") from error
    except DocumentError as error:
        raise ImportedFileError("\n".join(f.text(str(path)) for f in error.findings)) from error
    file, faults = validate(_MapFile, document)
    if file is None:
        raise ImportedFileError("\n".join(fault.text(str(path)) for fault in faults.values()))
    if file.mode == "raw":
        raise ImportedFileError(f"{path}: mode: is 'raw'; allowed: trinary, scale")
    return file


def _blocked(picture: Path, file: _MapFile, unknown_is_free: bool) -> npt.NDArray[np.bool_]:
    """Return which cells (rows from the bottom, columns) are in the way."""
    values = _grey(picture)
    occupancy = (values if file.negate else 255.0 - values) / 255.0
    threshold = file.occupied_thresh if unknown_is_free else file.free_thresh
    blocked: npt.NDArray[np.bool_] = (occupancy > threshold) if unknown_is_free else ~(occupancy < threshold)
    return blocked[::-1]


def _grey(picture: Path) -> FloatArray:
    """Return the grey values (rows from the top, columns) of a picture."""
    from PIL import Image

    try:
        with Image.open(picture) as image:
            if image.width * image.height > MOST_CELLS:
                raise ImportedFileError(
                    f"{picture}: has {image.width} x {image.height} cells; allowed: {MOST_CELLS} cells"
                )
            values: Any = np.asarray(image.convert("RGB"), dtype=np.float64)
    except ImportedFileError:
        raise
    except Exception as error:  # Pillow's plugins raise whatever they stumble over
        raise ImportedFileError(f"{picture}: cannot read the picture: {error}") from error
    grey: FloatArray = values.mean(axis=2)
    return grey


def _region(blocked: npt.NDArray[np.bool_]) -> shapely.Geometry:
    """Return the union of cells, each a unit square; runs of cells in a row are one rectangle."""
    edges = np.diff(np.pad(blocked.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, begin = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    return shapely.union_all(shapely.box(begin, row, end, row + 1))


def _to_world(corners: FloatArray, file: _MapFile) -> FloatArray:
    return transform_points(np.array(file.origin), corners * file.resolution)
