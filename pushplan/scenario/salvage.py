"""Go on checking a scenario that has wrong values, as far as the right ones allow, to tell all findings at once."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from copy import deepcopy
from typing import Any

from pydantic import ValidationError

from pushplan.scenario.schema.scenario import ScenarioFile
from pushplan.scenario.yaml.node import Place

_SECTIONS: dict[str, Any] = {
    "format": "pushplan/1",
    "floor": {"friction": 1.0},
    "contacts": {"friction": 1.0},
    "goal": {"pose": [0.0, 0.0, 0.0]},
}
"""What stands in for a wrong section that has no default."""

_OBJECT: dict[str, Any] = {"mass": 1.0, "support": "unknown"}
_PUSHER: dict[str, Any] = {"friction": 1.0}
_LEFT_OUT = {"center_of_mass", "floor_friction", "contact_height", "drive", "limits"}
"""Keys of objects and pusher that do not bear on geometry, and what stands in for them."""


_GEOMETRY = ("name", "shape", "offset", "pose", "width", "thickness")
"""Keys of objects and pusher that do."""


def salvage(data: Any, wrong: Iterable[Place]) -> tuple[ScenarioFile, set[str]] | None:
    """Return the scenario with stand-ins for what is wrong, and the sections that are not to be trusted.

    None when the geometry of objects or pusher itself is in doubt.

    Args:
        data: The document as plain data.
        wrong: The places with findings.
    """
    if not isinstance(data, dict):
        return None
    mended, doubtful = deepcopy(data), set()
    for place in wrong:
        if not place or not isinstance(place[0], str):
            return None
        doubtful.add(place[0])
        if not _mend(mended, place):
            return None
    try:
        return ScenarioFile.model_validate(mended), doubtful
    except ValidationError:
        return None


def _mend(data: dict[str, Any], place: Place) -> bool:
    """Put a stand-in at a wrong place; tell whether that was possible: not where geometry depends on it."""
    section = place[0]
    if section == "snap":
        return False
    if section not in ("objects", "pusher"):
        return _replace(data, str(section), _SECTIONS)
    body: Any = data
    depth = 2 if section == "objects" else 1
    if len(place) <= depth:
        return False
    for step in place[:depth]:
        body = body[step]
    return _replace(body, str(place[depth]), _OBJECT if section == "objects" else _PUSHER, _LEFT_OUT)


def _replace(
    mapping: dict[str, Any], key: str, stand_ins: dict[str, Any], left_out: set[str] | None = None
) -> bool:
    if key in stand_ins:
        mapping[key] = stand_ins[key]
    elif left_out is None or key in left_out or _means_nothing(key):
        mapping.pop(key, None)
    else:
        return False
    return True


def _means_nothing(key: str) -> bool:
    """Tell whether an unknown key can be left out: it is not meant to be one that bears on geometry."""
    return key not in _GEOMETRY and not difflib.get_close_matches(key, _GEOMETRY, n=1)
