"""What pydantic finds wrong in a document, as located sentences that say what is allowed."""

from __future__ import annotations

import difflib
import types
from collections.abc import Iterator
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, RootModel, ValidationError
from pydantic_core import ErrorDetails

from pushplan.errors import Finding
from pushplan.scenario.schema.types import ALTERNATIVES
from pushplan.scenario.values.quantity import DESCRIBED_FAULT, FAULT, show
from pushplan.scenario.yaml.node import Document, Node, Place, place_text

Model = TypeVar("Model", bound=BaseModel)


def validate(model: type[Model], document: Document) -> tuple[Model | None, dict[Place, Finding]]:
    """Return the model of a document, or None and a finding for each place that is wrong.

    Places that the document itself reports as faulty are reported once, in its words.
    """
    faults = document.faults
    try:
        valid = model.model_validate(document.root.plain())
        return (None if faults else valid), dict(faults)
    except ValidationError as error:
        details = error.errors(include_url=False, include_context=False)
    found = dict(_translated(model, document, details))
    new = {place: f for place, f in found.items() if not any(place[: len(at)] == at for at in faults)}
    return None, {**faults, **new}


def finding_at(document: Document, place: Place, what: str, at_key: bool = False) -> Finding:
    """Return the finding that says `what` about a place of the document."""
    return Finding(place_text(place), what, *document.root.locate(place, at_key))


def nearest(word: str, known: list[str]) -> str:
    """Return `; did you mean '...'?` with the known word most like `word`, or `;`."""
    close = difflib.get_close_matches(word.lower(), known, n=1, cutoff=0.65)
    return f"; did you mean '{close[0]}'?" if close else ";"


def _translated(
    model: type[BaseModel], document: Document, details: list[ErrorDetails]
) -> Iterator[tuple[Place, Finding]]:
    for detail in details:
        place = _place(document.root, detail["loc"])
        unknown = detail["type"] == "extra_forbidden"
        yield place, finding_at(document, place, _sentence(model, place, detail), at_key=unknown)


def _place(root: Node, location: Place) -> Place:
    """Return pydantic's location without the names of the alternatives that it chose on the way.

    A key of the file that is called like an alternative is unknown, so that nothing is found below it.
    """
    place: Place = ()
    for i, step in enumerate(location):
        unknown_key = i == len(location) - 1 and root.holds((*place, step))
        if step not in ALTERNATIVES or unknown_key:
            place = (*place, step)
    return place


def _sentence(model: type[BaseModel], place: Place, detail: ErrorDetails) -> str:
    """Return what is wrong and what is allowed."""
    kind, value = detail["type"], detail["input"]
    parents, description = _walk(model, place[:-1])
    inner, own = _walk(model, place)
    description = own or description
    if kind == FAULT:
        return detail["msg"]
    if kind == DESCRIBED_FAULT:
        return f"{detail['msg']}; allowed: {description}"
    if kind == "missing":
        return f"is missing; needed: {description}"
    if kind == "extra_forbidden":
        keys = [key for parent in parents for key in parent.model_fields]
        return f"unknown key{nearest(str(place[-1]), keys)} allowed: {', '.join(keys)}"
    if kind == "literal_error" and isinstance(value, str):
        return f"{show(value)}{nearest(value, _words(detail['msg']))} allowed: {description}"
    if kind == "model_type":
        keys = [key for parent in inner for key in parent.model_fields]
        return f"{show(value)}; allowed: a mapping with the keys {', '.join(keys)}"
    return f"{show(value)}; allowed: {description}"


def _words(message: str) -> list[str]:
    """Return the words that pydantic lists as allowed."""
    return message.replace(" or ", ", ").removeprefix("Input should be ").replace("'", "").split(", ")


def _walk(model: type[BaseModel], place: Place) -> tuple[list[type[BaseModel]], str]:
    """Return the models that may stand at a place, and the description of the field it lies in."""
    models, description = _models_in(model), ""
    for step in place:
        fields = [m.model_fields[step] for m in models if isinstance(step, str) and step in m.model_fields]
        if fields:
            models, description = _models_in(fields[0].annotation), fields[0].description or ""
    return models, description


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the models that an annotation mentions."""
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        if issubclass(annotation, RootModel):
            return _models_in(annotation.model_fields["root"].annotation)
        return [annotation] if issubclass(annotation, BaseModel) else []
    return [model for part in get_args(annotation) for model in _models_in(part)]
