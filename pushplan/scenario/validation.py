"""Converts pydantic's errors to messages with a place in the document and the allowed values."""

from __future__ import annotations

import types
from collections.abc import Sequence
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from pushplan.scenario import units
from pushplan.scenario.schema import ScenarioFile
from pushplan.scenario.source import Place, Source, shorten
from pushplan.scenario.units import show
from pushplan.util.naming import nearest

Model = TypeVar("Model", bound=BaseModel)


def validate(model: type[Model], source: Source) -> Model | None:
    """Return the model of a document, or report all its errors and return None.

    Errors at or within a place that already has an error are not reported.
    """
    known = source.wrong
    try:
        valid = model.model_validate(source.root.plain())
    except ValidationError as error:
        reported = set[Place]()
        for detail in error.errors(include_url=False, include_context=False):
            place = _place(source, detail["loc"])
            if place not in reported and not any(place[: len(at)] == at for at in known):
                reported.add(place)
                source.error(place, _sentence(model, detail), at_key=detail["type"] == "extra_forbidden")
        return None
    return None if known else valid


def unknown_object(name: str, known: Sequence[str]) -> str:
    """Return the message that no object has a name, with the existing names."""
    return f"no object is called '{shorten(name)}'{nearest(name, known)} allowed: {', '.join(known)}"


def _is_tag(step: object) -> bool:
    """Return whether a step of pydantic's location is the tag of a form, such as `<box>`."""
    return isinstance(step, str) and step.startswith("<") and step.endswith(">")


def _place(source: Source, location: Place) -> Place:
    """Return a location without tags. A last step that the file contains is a key, even if it looks like a tag."""
    place: Place = ()
    for i, step in enumerate(location):
        unknown_key = i == len(location) - 1 and source.holds((*place, step))
        if not _is_tag(step) or unknown_key:
            place = (*place, step)
    return place


def _sentence(model: type[BaseModel], detail: ErrorDetails) -> str:
    kind, value, location = detail["type"], detail["input"], detail["loc"]
    parents, description = _walk(model, location[:-1])
    inner, own = _walk(model, location)
    description = own or description
    match kind:
        case units.FAULT:
            return detail["msg"]
        case units.DESCRIBED_FAULT:
            return f"{detail['msg']}; allowed: {description}"
        case "missing":
            return f"is missing; needed: {description}"
        case "extra_forbidden":
            keys = [key for parent in parents for key in parent.model_fields]
            return f"unknown key{nearest(str(location[-1]), keys)} allowed: {', '.join(dict.fromkeys(keys))}"
        case "literal_error" if isinstance(value, str):
            choices = detail["msg"].replace(" or ", ", ").removeprefix("Input should be ").replace("'", "")
            return f"{show(value)}{nearest(value, choices.split(', '))} allowed: {description}"
        case "model_type":
            keys = [key for parent in inner for key in parent.model_fields]
            return f"{show(value)}; allowed: a mapping with the keys {', '.join(dict.fromkeys(keys))}"
        case "union_tag_not_found" if isinstance(value, dict):
            keys = [key for parent in inner for key in parent.model_fields]
            near = next((nearest(str(key), keys) for key in value if key not in keys), ";")
            return f"has {' and '.join(map(str, value)) or 'no keys'}{near} allowed: {description}"
    return f"{show(value)}; allowed: {description}"


def _walk(model: type[BaseModel], location: Place) -> tuple[list[type[BaseModel]], str]:
    """Return the models that are allowed at a location, and the description of its field."""
    models, description = _models_in(model), ""
    for step in location:
        if _is_tag(step):
            chosen = [m for m in models if str(step)[1:-1] in m.model_fields]
            models = chosen or models
            continue
        fields = [m.model_fields[step] for m in models if isinstance(step, str) and step in m.model_fields]
        if fields:
            models, description = _models_in(fields[0].annotation), fields[0].description or ""
    return models, description


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, BaseModel) else []
    return [model for part in get_args(annotation) for model in _models_in(part)]


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
"""Keys of objects and pusher that determine layout and contacts."""


def salvage(source: Source) -> tuple[ScenarioFile, set[str]] | None:
    """Return a file with stand-ins for its invalid values, and the sections that hold such values.

    The stand-ins allow checks of geometry, start and goal in spite of other errors. If the geometry of objects or
    pusher itself is invalid, the result is None.
    """
    import difflib

    data, doubtful = source.root.plain(), set[str]()
    for place in source.wrong:
        depth = {"objects": 3, "pusher": 2}.get(str(place[0]), 1) if place else 1
        if len(place) < depth or place[0] == "snap":
            return None
        *parents, key = place[:depth]
        if depth > 1 and difflib.get_close_matches(str(key), _GEOMETRY, n=1):
            return None
        body = data
        for step in parents:
            body = body[step]
        stand_in = _STAND_INS.get(tuple(0 if isinstance(step, int) else step for step in place[:depth]))
        if stand_in is None:
            body.pop(key, None)
        else:
            body[key] = stand_in
        if depth < 3:
            doubtful.add(str(place[0]))
    try:
        return ScenarioFile.model_validate(data), doubtful
    except ValidationError:
        return None
