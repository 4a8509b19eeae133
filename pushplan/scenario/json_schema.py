"""JSON Schemas of the file formats, with which editors complete and check (draft 2020-12)."""

from __future__ import annotations

import json
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from pydantic.json_schema import models_json_schema


def scenario_schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files.

    It accepts every file that the loader accepts. The loader also checks what no schema can say: the range of numbers
    with a unit, polygons that cross themselves, contacts, collisions.
    """
    from pushplan.scenario.schema import GatheringFile, RearrangementFile, ScenarioFile

    models = (ScenarioFile, RearrangementFile, GatheringFile)
    names, schema = models_json_schema([(model, "validation") for model in models])
    one, several, row = (names[model, "validation"] for model in models)
    of_row = {"properties": {"goals": {"properties": {"row": {"required": ["of"]}}, "required": ["row"]}}}
    with_goals = {"if": of_row, "then": row, "else": several}
    chosen = {"if": {"required": ["goals"]}, "then": with_goals, "else": one}
    return finished({"type": "object", **schema, **chosen}, "pushplan scenario")


def schema_text(schema: dict[str, Any]) -> str:
    """Return a schema as it is printed and packaged."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def schema_file(name: str = "scenario") -> Path:
    """Return the file in which the package holds the schema of scenario files, or of suites."""
    with as_file(files("pushplan") / f"{name}.schema.json") as path:
        return path.resolve()


def finished(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """Return a schema of pydantic's with a title, and without those that it makes from keys."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **_without_titles(schema),
        "title": title,
    }


def _without_titles(node: Any) -> Any:
    """Return a schema without the titles that pydantic makes from the keys: editors show them beside the keys."""
    if isinstance(node, list):
        return [_without_titles(child) for child in node]
    if not isinstance(node, dict):
        return node
    return {
        key: _properties(child) if key in ("properties", "$defs") else _without_titles(child)
        for key, child in node.items()
        if key != "title"
    }


def _properties(node: dict[str, Any]) -> dict[str, Any]:
    return {name: _without_titles(child) for name, child in node.items()}
