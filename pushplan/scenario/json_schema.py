"""JSON Schemas of the file formats, with which editors complete and check (draft 2020-12)."""

from __future__ import annotations

import json
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from pushplan.scenario.records import json_schema


def scenario_schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files.

    It accepts every file that the loader accepts. The loader also checks what no schema can say: the range of numbers
    with a unit, polygons that cross themselves, contacts, collisions.
    """
    from pushplan.scenario.schema import GatheringFile, RearrangementFile, ScenarioFile

    definitions: dict[str, Any] = {}
    forms = (ScenarioFile, RearrangementFile, GatheringFile)
    one, several, row = (json_schema(form, definitions) for form in forms)
    of_row = {"properties": {"goals": {"properties": {"row": {"required": ["of"]}}, "required": ["row"]}}}
    with_goals = {"if": of_row, "then": row, "else": several}
    chosen = {"if": {"required": ["goals"]}, "then": with_goals, "else": one}
    return finished({"type": "object", "$defs": definitions, **chosen}, "pushplan scenario")


def schema_text(schema: dict[str, Any]) -> str:
    """Return a schema as it is printed and packaged."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def schema_file(name: str = "scenario") -> Path:
    """Return the file in which the package holds the schema of scenario files, or of suites."""
    with as_file(files("pushplan") / f"{name}.schema.json") as path:
        return path.resolve()


def finished(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """Return the schema of a file with a title, its definitions in alphabetical order."""
    schema["$defs"] = dict(sorted(schema["$defs"].items()))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": title}
