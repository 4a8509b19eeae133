"""Documents read as records, with everything wrong told at its place, or as far as what is right allows."""

from __future__ import annotations

import difflib
from typing import Any, TypeVar

from pushplan.scenario.records import Faults, Record
from pushplan.scenario.schema import ScenarioFile
from pushplan.scenario.source import Place, Source

File = TypeVar("File", bound=Record)


def validate(form: type[File], source: Source) -> File | None:
    """Return the record that a document states, or report everything wrong with it and return None.

    What lies at, or in, a place that is reported already is not reported again.
    """
    known, told, faults = source.wrong, set[Place](), Faults()
    file = form.read(source.root.plain(), (), faults)
    for place, what, at_key in faults:
        if place not in told and not any(place[: len(at)] == at for at in known):
            told.add(place)
            source.error(place, what, at_key=at_key)
    return None if known or faults else file


_STAND_INS: dict[Place, Any] = {
    ("format",): "pushplan/1",
    ("floor",): {"friction": 1.0},
    ("contacts",): {"friction": 1.0},
    ("goal",): {"pose": [0.0, 0.0, 0.0]},
    ("objects", 0, "mass"): 1.0,
    ("objects", 0, "support"): "unknown",
    ("pusher", "friction"): 1.0,
}
_GEOMETRY = ("name", "shape", "offset", "pose", "width", "thickness")
"""Keys of objects and pusher that layout and contacts depend on."""


def salvage(source: Source) -> tuple[ScenarioFile, set[str]] | None:
    """Return a file with stand-ins for its wrong values, and the sections that are not to be trusted.

    So that geometry, start and goal are checked all the same, as far as what is right allows; None where the
    geometry of objects or pusher itself is in doubt.
    """
    data, doubtful = source.root.plain(), set[str]()
    for place in source.wrong:
        depth = {"objects": 3, "pusher": 2}.get(str(place[0]), 1) if place else 1
        if len(place) < depth or place[0] == "snap":
            return None
        *way, key = place[:depth]
        if depth > 1 and difflib.get_close_matches(str(key), _GEOMETRY, n=1):
            return None
        body = data
        for step in way:
            body = body[step]
        stand_in = _STAND_INS.get(tuple(0 if isinstance(step, int) else step for step in place[:depth]))
        if stand_in is None:
            body.pop(key, None)
        else:
            body[key] = stand_in
        if depth < 3:
            doubtful.add(str(place[0]))
    faults = Faults()
    file = ScenarioFile.read(data, (), faults)
    return None if file is None or faults else (file, doubtful)
