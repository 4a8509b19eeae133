"""Writes a new commented scenario."""

from __future__ import annotations

import json
import re
from importlib.resources import files
from math import degrees
from pathlib import Path

import numpy as np
import shapely

from pushplan.errors import PushplanError
from pushplan.scenario.bodies import NAME
from pushplan.scenario.fields import MOST_LETTERS, NAME_PATTERN
from pushplan.scenario.maps import RosMap, read_ros_map
from pushplan.util.arrays import FloatArray
from pushplan.util.files import write_whole

_SUFFIX = ".yaml"


class TemplateError(PushplanError, ValueError):
    """A new scenario cannot be created."""


DRIVES = {
    "omnidirectional": "omnidirectional",
    "differential": "{differential: {axle: [-0.3, 0, 0]}}",
    "car": "{car: {axle: [-0.3, 0, 0], min_radius: 0.8}}",
}
"""Text of the template for each drive; an axle's pose is in the frame of the plate's front edge."""

_AHEAD = "[3.4, 0.5, 20 deg]"
"""Goal for a robot with an axle. The template's own goal needs turns that the axle and the load do not allow."""

_ROOM = 0.75
"""Radius around the chain frame that contains the template's robot and objects, m."""

_APART = 3.0
"""Distance between start and goal in a map, m."""

_ACROSS = 60
"""Number of positions that are checked along the longer side of a map."""


def write_new_scenario(name: str, *, drive: str = "omnidirectional", map_file: Path | None = None) -> Path:
    """Write a commented scenario that loads and plans, and return its file.

    Args:
        name: Name of the scenario, or a path that ends with it; `.yaml` is added if it is missing.
        drive: One of `DRIVES`.
        map_file: YAML file of a map, in the scenario's folder or below; start and goal are placed in free space.

    Raises:
        TemplateError: If the name is not allowed, or the map is in another folder or has no free space.
        ImportedFileError: If the map cannot be read.
        OutputError: If the file exists already or cannot be written.
    """
    path = Path(name if name.endswith(_SUFFIX) else name + _SUFFIX)
    if len(path.stem) > MOST_LETTERS or not re.fullmatch(NAME_PATTERN, path.stem):
        raise TemplateError(f"'{path.stem}' cannot be a scenario's name; allowed: {NAME}")
    text = new_scenario_text(path.stem, drive)
    if map_file is not None:
        text = _in_map(text, map_file, path.parent)
    write_whole(path, text.encode(), new=True)
    return path


def new_scenario_text(name: str, drive: str = "omnidirectional") -> str:
    """Return a commented scenario called `name`, with a line that lets editors complete and check it."""
    from pushplan.scenario.schema import schema_file

    text = (files("pushplan") / "new_scenario.yaml").read_text(encoding="utf-8")
    text = text.replace('name: "my-push"', f"name: {json.dumps(name, ensure_ascii=False)}", 1)
    others = " or ".join(stated for kind, stated in DRIVES.items() if kind != drive)
    text = _with_line(text, "  drive: ", f"{DRIVES[drive]}   # or {others}")
    if drive != "omnidirectional":
        text = _with_line(text, "  pose: ", f"{_AHEAD}      # reachable by turns with a radius of 2.5 m or more")
    return f"# yaml-language-server: $schema={schema_file().as_uri()}\n{text}"


def _in_map(text: str, map_file: Path, folder: Path) -> str:
    """Return a scenario's text with a map in place of workspace and obstacles."""
    ends = start_and_goal(read_ros_map(map_file), _ROOM, _APART)
    if ends is None:
        raise TemplateError(
            f"{map_file}: has no straight free path for a start and a goal with {_ROOM:g} m of free space around; "
            f"create the scenario without --map, and add `obstacles: [{{map: {map_file.name}}}]`"
        )
    try:
        inside = map_file.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        raise TemplateError(
            f"{map_file}: is outside the folder of the scenario, '{folder}'; copy it and its picture there"
        ) from None
    (x, y, heading), goal = ends
    stated = f"[{x:g}, {y:g}, {degrees(heading):g} deg]"
    text = _with_line(
        text, "start: ", f"{stated}   # x, y, theta of the middle of the plate's contact, in the map's frame"
    )
    text = _with_line(text, "  pose: ", f"[{goal[0]:g}, {goal[1]:g}, {degrees(goal[2]):g} deg]")
    head, _, rest = text.partition("workspace: ")
    end = rest.index("\nstability: ")
    return (
        f"{head}# The rectangle around the map is the workspace. With {{map: ..., unknown: free}}, unknown cells\n"
        f"# are free.\nobstacles: [{{map: {json.dumps(inside)}}}]\n{rest[end:]}"
    )


def _with_line(text: str, beginning: str, rest: str) -> str:
    """Return a text in which the line that starts with `beginning` continues with `rest`."""
    changed, count = re.subn(rf"(?m)^{re.escape(beginning)}.*$", lambda _: beginning + rest, text)
    assert count == 1, beginning
    return changed


def start_and_goal(found: RosMap, radius: float, apart: float) -> tuple[FloatArray, FloatArray] | None:
    """Return a start and a goal pose (3,) with the same heading, the goal straight ahead of the start.

    The start is the position with the most free space. The line to the goal has `radius` of free space around it.

    Args:
        found: Map.
        radius: Free space around both poses, m.
        apart: Desired distance, m; the result is shorter if the map has no longer line.

    Returns:
        Start and goal, or None if the map has no free line.
    """
    area = found.workspace
    blocked = shapely.union_all([shapely.Polygon(obstacle.outline) for obstacle in found.obstacles])
    floor = shapely.box(area.xmin, area.ymin, area.xmax, area.ymax) - blocked
    room = floor.buffer(-radius, quad_segs=4)
    shapely.prepare(room)
    spacing = max(area.xmax - area.xmin, area.ymax - area.ymin) / _ACROSS
    x, y = np.meshgrid(np.arange(area.xmin, area.xmax, spacing), np.arange(area.ymin, area.ymax, spacing))
    places = np.stack([x.ravel(), y.ravel()], axis=1).round(2)
    places = places[shapely.contains(room, shapely.points(places))]
    if len(places) == 0:
        return None
    walls = shapely.distance(shapely.points(places), room.boundary)
    start = places[int(walls.argmax())]
    lines = shapely.linestrings(np.stack([np.broadcast_to(start, places.shape), places], axis=1))
    seen = places[shapely.covers(room, lines)]
    far = np.hypot(*(seen - start).T)
    goal = seen[int(np.abs(far - apart).argmin())]
    if np.hypot(*(goal - start)) < radius:
        return None
    heading = np.round(np.degrees(np.arctan2(*(goal - start)[::-1])), 1)
    return np.array([*start, np.radians(heading)]), np.array([*goal, np.radians(heading)])
