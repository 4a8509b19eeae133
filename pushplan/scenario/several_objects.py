"""Scenario files in which several objects have goals of their own: a problem for each, alone in the room."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import TypeAdapter

from pushplan.errors import Finding, ScenarioError
from pushplan.geometry import se2
from pushplan.scenario.arrangement.meeting import millimetres
from pushplan.scenario.file import read_scenario
from pushplan.scenario.files import Attachments
from pushplan.scenario.model import Scenario
from pushplan.scenario.schema import types as t
from pushplan.scenario.schema.findings import nearest, validate
from pushplan.scenario.schema.several_objects import SeveralObjectsFile
from pushplan.scenario.yaml.node import Document, Place, shorten
from pushplan.scenario.yaml.report import Report
from pushplan.scenario.yaml.text import MOST_BYTES, DocumentError
from pushplan.scenario.yaml.tree import read_document
from pushplan.util.arrays import FloatArray

_OF_OTHERS = ("goals", "goal", "start", "objects", "contacts")
"""Keys that say something else where objects stand apart."""

_OF_BODIES = ("format", "floor", "objects", "pusher")
_POSE: TypeAdapter[Any] = TypeAdapter(t.Pose)


@dataclass(frozen=True, eq=False)
class SeveralObjects:
    """What a file states.

    Attributes:
        name: For people.
        scenarios: The problem of each object, alone in the room, by its name.
        movable: Names of the objects that have no goal.
    """

    name: str
    scenarios: Mapping[str, Scenario]
    movable: tuple[str, ...]


def states_several(path: Path) -> bool:
    """Tell whether a file has `goals`; False where it cannot be read, which others tell of."""
    try:
        with path.open("rb") as file:
            plain = read_document(file.read(MOST_BYTES + 1)).root.plain()
    except (OSError, ValueError, DocumentError):
        return False
    return isinstance(plain, dict) and "goals" in plain


def load_several_objects(source: str | Path) -> SeveralObjects:
    """Read a scenario file with `goals`; every object has its pose in the world.

    Raises:
        ScenarioError: With everything found wrong.
    """
    path = Path(source)
    try:
        document = read_document(path.read_bytes()[: MOST_BYTES + 1])
    except OSError as error:
        raise ScenarioError(str(path), [Finding("", f"cannot read the file: {error.strerror}")]) from error
    except DocumentError as error:
        raise ScenarioError(str(path), error.findings) from error
    report = Report(document)
    plain = document.root.plain()
    file = _stated(document, report)
    if file is None:
        raise ScenarioError(str(path), report.findings)
    names = [obj.name for obj in file.objects]
    scenarios = {name: _alone(plain, i, path, report) for i, name in enumerate(names)}
    whole = {name: scenario for name, scenario in scenarios.items() if scenario is not None}
    if not report.findings:
        _check_apart(whole, report)
    if report.findings:
        raise ScenarioError(str(path), tuple(dict.fromkeys(report.findings)))
    movable = tuple(name for name in names if name not in plain["goals"])
    return SeveralObjects(str(plain.get("name") or path.stem), whole, movable)


def _stated(document: Document, report: Report) -> SeveralObjectsFile | None:
    """Return what a file states, or report what is wrong with it and return None."""
    file, faults = validate(SeveralObjectsFile, document)
    for key in ("goal", "start"):
        if document.root.holds((key,)):
            faults.pop((key,), None)
            report.add((key,), "does not go together with goals, and objects have their poses", at_key=True)
    report.extend(tuple(faults.values()))
    names = [] if file is None else [obj.name for obj in file.objects]
    for i, name in enumerate(names):
        if name in names[:i]:
            report.add(
                ("objects", i, "name"), f"'{name}' is also objects[{names.index(name)}]; give it another"
            )
    for name in () if file is None else file.goals:
        if name not in names:
            near = nearest(str(name), names)
            what = f"no object is called '{shorten(str(name))}'{near} allowed: {', '.join(names)}"
            report.add(("goals", name), what, at_key=True)
    return None if report.findings else file


def _alone(plain: dict[str, Any], i: int, path: Path, report: Report) -> Scenario | None:
    """Return the problem of one object alone in the room."""
    stated = plain["objects"][i]
    name, world = stated["name"], np.array(_POSE.validate_python(stated["pose"]))
    own = {key: value for key, value in plain.items() if key not in _OF_OTHERS}
    own["objects"] = [{key: value for key, value in stated.items() if key not in ("pose", "offset")}]
    own["goal"] = _goal(plain["goals"].get(name, stated["pose"]), name)
    attachments = Attachments({}, path.parent)
    try:
        inner = _pose_in_chain(own, path, attachments)
        own["start"] = se2.compose(world, se2.inverse(inner)).tolist()
        return read_scenario(json.dumps(own, indent=1).encode(), path, attachments)
    except ScenarioError as error:
        for finding in error.findings:
            report.add(_place(finding.where, i, name, report.document), finding.what)
        return None


def _goal(stated: Any, name: str) -> Any:
    """Return a goal as a scenario of one object has it."""
    if isinstance(stated, dict):
        return {**stated, "of": name}
    if isinstance(stated, list) and stated and all(isinstance(one, dict | list) for one in stated):
        return [_goal(one, name) for one in stated]
    return {"pose": stated, "of": name}


def _pose_in_chain(own: Mapping[str, Any], path: Path, attachments: Attachments) -> FloatArray:
    """Return where the object's frame is in the chain frame: the plate touches the middle of its rear face."""
    bodies = {key: own[key] for key in _OF_BODIES if key in own}
    pusher = bodies.get("pusher")
    if isinstance(pusher, dict):
        bodies["pusher"] = {key: v for key, v in pusher.items() if key not in ("faces", "offsets")}
    scenario = read_scenario(
        json.dumps({**bodies, "goal": {"pose": [1.0, 0.0, 0.0]}}).encode(), path, attachments
    )
    return scenario.chain.objects[0].pose_chain


def _place(where: str, i: int, name: str, document: Document) -> Place:
    """Return the place in the file of what a finding about one object's own problem tells of."""
    steps: list[str | int] = [
        int(step[1:-1]) if step.startswith("[") else step for step in re.findall(r"\[\d+\]|[^.\[\]]+", where)
    ]
    match steps:
        case ["objects", 0, *rest]:
            return ("objects", i, *rest)
        case ["goal", *rest]:
            place = ("goals", name, *rest)
            return place if document.root.holds(place) else ("goals", name)
        case ["start", *_]:
            return ("objects", i, "pose")
    return tuple(steps)


def _check_apart(scenarios: Mapping[str, Scenario], report: Report) -> None:
    """Report objects that touch one another at first, and the robot where it touches one."""
    placed = {name: shapely.MultiPolygon(list(_outlines(scenario))) for name, scenario in scenarios.items()}
    index = {name: i for i, name in enumerate(placed)}
    for one, other in combinations(placed, 2):
        gap, kept = float(placed[one].distance(placed[other])), scenarios[other].clearance
        if gap < kept:
            what = f"'{other}' is {millimetres(gap)} from '{one}'; allowed: at least {millimetres(kept)}"
            report.add(("objects", index[other], "pose"), what)


def _outlines(scenario: Scenario) -> Iterator[shapely.Polygon]:
    for obj in scenario.chain.objects:
        yield shapely.Polygon(se2.transform_points(scenario.start, obj.outline_chain))
