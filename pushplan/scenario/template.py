"""A commented scenario to begin with."""

from __future__ import annotations

import json
import re
from importlib.resources import files
from math import degrees
from pathlib import Path

from pushplan.errors import PushplanError
from pushplan.scenario.schema.objects import NAME
from pushplan.scenario.schema.types import NAME_PATTERN
from pushplan.util.files import write_whole

_SUFFIX = ".yaml"


class TemplateError(PushplanError, ValueError):
    """A new scenario cannot be called so."""


DRIVES = {
    "omnidirectional": "omnidirectional",
    "differential": "{differential: {axle: [-0.3, 0, 0]}}",
    "car": "{car: {axle: [-0.3, 0, 0], min_radius: 0.8}}",
}
"""What the template says of each drive; an axle's pose is in the frame of the plate's front edge."""

_ROOM = 0.75
"""Radius around the chain frame in which the template's robot and objects are, m."""

_APART = 3.0
"""Distance between start and goal in a map, m."""


def write_new_scenario(name: str, *, drive: str = "omnidirectional", map_file: Path | None = None) -> Path:
    """Write a commented scenario that loads and plans, and return its file.

    Args:
        name: Of the scenario, or a path that ends with it; `.yaml` is added where it is missing.
        drive: One of `DRIVES`.
        map_file: YAML file of a map, in the scenario's folder or below; start and goal are where it has room.

    Raises:
        TemplateError: When no scenario may be called so, or the map is elsewhere or has no room.
        ImportedFileError: When the map cannot be read.
        OutputError: When the file exists already or cannot be written.
    """
    path = Path(name if name.endswith(_SUFFIX) else name + _SUFFIX)
    if not re.fullmatch(NAME_PATTERN, path.stem):
        raise TemplateError(f"'{path.stem}' cannot be a scenario's name; allowed: {NAME}")
    text = new_scenario_text(path.stem, drive)
    if map_file is not None:
        text = _in_map(text, map_file, path.parent)
    write_whole(path, text.encode(), new=True)
    return path


def new_scenario_text(name: str, drive: str = "omnidirectional") -> str:
    """Return a commented scenario called `name`, with the line that lets editors complete and check it."""
    from pushplan.scenario.json_schema import schema_file

    text = (files("pushplan") / "new_scenario.yaml").read_text(encoding="utf-8")
    text = text.replace('name: "my-push"', f"name: {json.dumps(name, ensure_ascii=False)}", 1)
    others = " or ".join(stated for kind, stated in DRIVES.items() if kind != drive)
    text = _with_line(text, "  drive: ", f"{DRIVES[drive]}   # or {others}")
    return f"# yaml-language-server: $schema={schema_file().as_uri()}\n{text}"


def _in_map(text: str, map_file: Path, folder: Path) -> str:
    """Return a scenario's text with a map for its surroundings."""
    from pushplan.scenario.imported.room_in_map import start_and_goal
    from pushplan.scenario.imported.ros_map import read_ros_map

    ends = start_and_goal(read_ros_map(map_file), _ROOM, _APART)
    if ends is None:
        raise TemplateError(
            f"{map_file}: has no two places in sight of each other with {_ROOM:g} m of room around; "
            f"begin without --map, and add `obstacles: [{{map: {map_file.name}}}]`"
        )
    try:
        inside = map_file.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        raise TemplateError(
            f"{map_file}: lies outside the folder of the scenario, '{folder}'; copy it and its picture there"
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
        f"{head}# The rectangle around the map is the workspace. {{map: ..., unknown: free}} lets the chain go\n"
        f"# where the map knows nothing.\nobstacles: [{{map: {json.dumps(inside)}}}]\n{rest[end:]}"
    )


def _with_line(text: str, beginning: str, rest: str) -> str:
    """Return a text with the rest of the one line that begins so replaced."""
    changed, count = re.subn(rf"(?m)^{re.escape(beginning)}.*$", lambda _: beginning + rest, text)
    assert count == 1, beginning
    return changed
