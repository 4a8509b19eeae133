"""A commented scenario to begin with."""

from __future__ import annotations

import json
import re
from importlib.resources import files
from pathlib import Path

from pushplan.errors import PushplanError
from pushplan.outputs.write import write_whole
from pushplan.reading.schema.objects import NAME
from pushplan.reading.schema.types import NAME_PATTERN

_SUFFIX = ".yaml"


class TemplateError(PushplanError, ValueError):
    """A new scenario cannot be called so."""


def write_new_scenario(name: str) -> Path:
    """Write a commented scenario that loads and plans, and return its file.

    Args:
        name: Of the scenario, or a path that ends with it; `.yaml` is added where it is missing.

    Raises:
        TemplateError: When no scenario may be called so.
        OutputError: When the file exists already or cannot be written.
    """
    path = Path(name if name.endswith(_SUFFIX) else name + _SUFFIX)
    if not re.fullmatch(NAME_PATTERN, path.stem):
        raise TemplateError(f"'{path.stem}' cannot be a scenario's name; allowed: {NAME}")
    write_whole(path, new_scenario_text(path.stem).encode(), new=True)
    return path


def new_scenario_text(name: str) -> str:
    """Return a commented scenario called `name`, with the line that lets editors complete and check it."""
    from pushplan.json_schema import schema_file

    text = (files("pushplan") / "new_scenario.yaml").read_text(encoding="utf-8")
    named = text.replace('name: "my-push"', f"name: {json.dumps(name, ensure_ascii=False)}", 1)
    return f"# yaml-language-server: $schema={schema_file().as_uri()}\n{named}"
