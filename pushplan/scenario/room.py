"""Workspace, obstacles and maps of a file, and checks for collisions at start and goal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

import numpy as np
import shapely

from pushplan.errors import PushplanError, SupportError
from pushplan.geometry import se2
from pushplan.geometry.polygon import overlap_depth
from pushplan.mechanics.chain import Body
from pushplan.scenario import schema
from pushplan.scenario.layout import millimetres, outline_of
from pushplan.scenario.maps import ros_map_of
from pushplan.scenario.parts import CircleObstacle, Obstacle, PolygonObstacle, Workspace
from pushplan.scenario.source import Source, shorten
from pushplan.util.arrays import FloatArray
from pushplan.util.files import read_regular

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario

MOST_ATTACHED = 16 << 20
"""Largest size of a file that a scenario names, bytes."""

ROUNDING = 1e-9
"""Rounding error of distances that is allowed below the clearance, m."""

MOST_LISTED = 20
"""Largest number of obstacles that are listed for one body."""

_OUTSIDE = "a file in the scenario's folder"


class Attachments:
    """Contents of the files that a scenario names, from its folder or given in advance.

    Attributes:
        contents: Bytes of all files that were read, by name.
    """

    def __init__(self, given: dict[str, bytes], folder: Path | None = None) -> None:
        self.contents: dict[str, bytes] = {}
        self._given = given
        self._folder = folder

    def read(self, name: str) -> bytes:
        """Return the content of the file `name`.

        Raises:
            SupportError: If the name leads out of the folder or the file cannot be read.
        """
        if name not in self.contents:
            self.contents[name] = self._given[name] if name in self._given else self._from_folder(name)
        return self.contents[name]

    def _from_folder(self, name: str) -> bytes:
        if self._folder is None:
            raise SupportError(f"the file '{shorten(name)}' is not attached; needed: its contents")
        pure = PurePosixPath(name)
        path = self._folder / pure
        outside = pure.is_absolute() or ".." in pure.parts or not name.isprintable()
        if outside or not path.resolve().is_relative_to(self._folder.resolve()):
            raise SupportError(f"has the name '{shorten(name)}'; allowed: {_OUTSIDE}")
        try:
            data = read_regular(path, MOST_ATTACHED + 1)
        except OSError as error:
            raise SupportError(f"cannot read '{shorten(name)}': {error.strerror or error}") from error
        if len(data) > MOST_ATTACHED:
            raise SupportError(f"'{shorten(name)}' is larger than the {MOST_ATTACHED} bytes allowed")
        return data


def build_surroundings(
    file: schema.RoomFile, attachments: Attachments, source: Source
) -> tuple[Workspace | None, tuple[Obstacle, ...]]:
    """Return the workspace and obstacles of a file, and report maps that cannot be read.

    The default workspace is the rectangle around all maps, because the space beyond a map is unknown.
    """
    obstacles: list[Obstacle] = []
    areas: list[Workspace] = []
    for i, stated in enumerate(file.obstacles):
        match stated:
            case schema.CircleInRoom():
                obstacles.append(CircleObstacle(np.array(stated.center), stated.circle))
            case schema.MapInRoom():
                try:
                    found = ros_map_of(stated.map, attachments.read, unknown_is_free=stated.unknown == "free")
                except PushplanError as error:
                    hint = "; copy the map and its picture there, or pass it with --map"
                    source.error(("obstacles", i, "map"), f"{error}{hint if _OUTSIDE in str(error) else ''}")
                    continue
                obstacles += found.obstacles
                areas.append(found.workspace)
            case _:
                outline = se2.transform_points(stated.pose or (0.0, 0.0, 0.0), outline_of(stated))
                unknown = isinstance(stated, schema.PolygonInRoom) and stated.unknown is not None
                obstacles.append(PolygonObstacle(outline, unknown))
    if file.workspace is not None:
        areas = [Workspace(*file.workspace.x, *file.workspace.y)]
    if not areas:
        return None, tuple(obstacles)
    low = min(area.xmin for area in areas), min(area.ymin for area in areas)
    high = max(area.xmax for area in areas), max(area.ymax for area in areas)
    return Workspace(low[0], high[0], low[1], high[1]), tuple(obstacles)


def placed(bodies: Iterable[Body], pose: FloatArray) -> list[tuple[str, FloatArray]]:
    """Return names and world outlines of bodies with the chain frame at `pose` (3,)."""
    return [(body.name, se2.transform_points(pose, body.outline)) for body in bodies]


def placement_errors(what: str, bodies: Sequence[tuple[str, FloatArray]], room: Scenario) -> Iterator[str]:
    """Yield a sentence for every body that leaves the workspace or is too near to an obstacle.

    Args:
        what: `start` or `goal`, as the sentences say it.
        bodies: Names and outlines (v, 2) in the world.
        room: Scenario with the obstacles, the workspace and the clearance.
    """
    obstacles, clearance = room.obstacles, room.clearance
    boxes = np.array([obstacle.box for obstacle in obstacles]).reshape(-1, 2, 2)
    for name, outline in bodies:
        low, high = outline.min(axis=0), outline.max(axis=0)
        errors = list(_beyond_walls(low.tolist(), high.tolist(), room.workspace, clearance))
        beside = (boxes[:, 0] <= high + 2.0 * clearance) & (boxes[:, 1] >= low - 2.0 * clearance)
        near = np.flatnonzero(beside.all(axis=1))
        all_near = filter(None, (_too_near(outline, obstacles[i], clearance) for i in near.tolist()))
        errors += islice(all_near, MOST_LISTED)
        if any(all_near):
            errors.append(f"is too near to more obstacles; only the first {MOST_LISTED} are listed")
        yield from (f"at the {what}, '{name}' {error}" for error in errors)


def _beyond_walls(
    low: list[float], high: list[float], workspace: Workspace | None, clearance: float
) -> Iterator[str]:
    """Yield a sentence for every wall that a body with a bounding box is beyond or too near to."""
    if workspace is None:
        return
    (xmin, ymin), (xmax, ymax) = low, high
    walls = (
        (xmin - workspace.xmin, f"x >= {workspace.xmin:.6g}"),
        (workspace.xmax - xmax, f"x <= {workspace.xmax:.6g}"),
        (ymin - workspace.ymin, f"y >= {workspace.ymin:.6g}"),
        (workspace.ymax - ymax, f"y <= {workspace.ymax:.6g}"),
    )
    for gap, wall in walls:
        if gap < 0.0:
            yield f"leaves the workspace ({wall}) by {millimetres(-gap)}"
        elif gap < clearance - ROUNDING:
            yield _short_of(gap, f"the workspace's wall {wall}", clearance)


def _too_near(outline: FloatArray, obstacle: Obstacle, clearance: float) -> str:
    """Return a phrase on a body that is too near to an obstacle; empty if it is not."""
    body = shapely.Polygon(outline)
    if isinstance(obstacle, CircleObstacle):
        inside = bool(body.contains(obstacle.core))
        away = -float(body.exterior.distance(obstacle.core)) if inside else float(body.distance(obstacle.core))
        gap = away - obstacle.radius
    else:
        gap = float(body.distance(obstacle.core))
        gap = gap or 0.0 - overlap_depth(obstacle.outline, outline)
    if gap < 0.0:
        return f"overlaps {obstacle} by {millimetres(-gap)}"
    return _short_of(gap, str(obstacle), clearance) if gap < clearance - ROUNDING else ""


def _short_of(gap: float, what: str, clearance: float) -> str:
    return f"is {millimetres(gap)} from {what}; allowed: at least {millimetres(clearance)}"
