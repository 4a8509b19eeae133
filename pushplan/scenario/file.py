"""Reads scenario files of every form and reports all errors at once: syntax, values, geometry, start and goals."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pushplan.errors import Finding, PushplanError, ScenarioError
from pushplan.scenario.build import build_scenario
from pushplan.scenario.check import length_question
from pushplan.scenario.maps import map_files
from pushplan.scenario.model import Scenario
from pushplan.scenario.room import Attachments
from pushplan.scenario.source import MOST_BYTES, DocumentError, Source
from pushplan.util.naming import nearest

_FOLDER, _SUFFIX = Path(__file__).parents[1] / "scenarios", ".yaml"
"""Location of the packaged scenarios. `importlib.resources` takes 10 ms to load, and the package is never zipped."""


def example_names() -> tuple[str, ...]:
    """Return the names of the packaged scenarios, in alphabetical order."""
    return names_in(_FOLDER)


def names_in(folder: Path) -> tuple[str, ...]:
    """Return the names of the YAML files in a folder of the package, in alphabetical order."""
    found = (entry.name for entry in folder.iterdir())
    return tuple(sorted(name.removesuffix(_SUFFIX) for name in found if name.endswith(_SUFFIX)))


def example_text(name: str) -> str:
    """Return the text of a packaged scenario.

    Raises:
        PushplanError: If no packaged scenario has this name.
    """
    known = example_names()
    if name not in known:
        raise PushplanError(
            f"no packaged scenario is called '{name}'{nearest(name, known)} available: {', '.join(known)}"
        )
    return (_FOLDER / (name + _SUFFIX)).read_text(encoding="utf-8")


def load_scenario(source: str | Path, maps: Sequence[str | Path] = ()) -> Scenario:
    """Read a scenario from a file, or a packaged example by its name.

    If a file has the name of an example, the file is read. A `Path` is always a file.

    Args:
        source: File or name.
        maps: YAML files of maps to add to the obstacles.

    Raises:
        ScenarioError: If the scenario is invalid, with all errors: syntax, values, geometry, start and goals.
        ImportedFileError: If a map cannot be read.
    """
    data, path = read_named(source, _FOLDER, "scenario", ScenarioError)
    scenario = _read(data, path, Attachments({}, path.parent), by_hand=path.parent != _FOLDER)
    return _with_maps(scenario, maps) if maps else scenario


def scenario_of(source: Scenario | str | Path) -> Scenario:
    """Read a file or a packaged example as `load_scenario` does; return any other object unchanged."""
    return load_scenario(source) if isinstance(source, str | Path) else source


def read_named(
    source: str | Path, folder: Path, what: str, refused: Callable[[str, list[Finding]], ScenarioError]
) -> tuple[bytes, Path]:
    """Return the bytes and the path of a file, or of a packaged file by its name.

    Args:
        source: File or name.
        folder: Folder of the packaged files.
        what: Noun for a packaged file, for messages.
        refused: Creates the error for a file that cannot be read.
    """
    path = Path(source)
    if isinstance(source, str) and source in names_in(folder) and not path.is_file():
        path = folder / f"{source}{_SUFFIX}"
    try:
        with path.open("rb") as file:
            return file.read(MOST_BYTES + 1), path
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        text, beside = f"cannot read the file: {reason}", Path(f"{source}{_SUFFIX}")
        if isinstance(error, FileNotFoundError) and beside.is_file():
            text += f"; did you mean '{beside}'?"
        elif isinstance(error, FileNotFoundError) and path.name == source:
            known = names_in(folder)
            text += f"; no packaged {what} has this name{nearest(source, known)} available: {', '.join(known)}"
        raise refused(str(source), [Finding("", text)]) from error


def _with_maps(alone: Scenario, maps: Sequence[str | Path]) -> Scenario:
    """Return a scenario with more maps; its source becomes JSON, which the log stores."""
    assert alone.origin is not None
    document: Any = alone.origin.root.plain()
    attached, obstacles = dict(alone.attachments), list(document.get("obstacles", ()))
    for i, file in enumerate(maps):
        name = f"map-{i}/{Path(file).name}"
        attached |= map_files(Path(file), name)
        obstacles.append({"map": name})
    return scenario_from_document(document | {"name": alone.name, "obstacles": obstacles}, alone.path, attached)


def scenario_from_text(
    text: str | bytes, path: str | Path = "scenario.yaml", attachments: Mapping[str, bytes] | None = None
) -> Scenario:
    """Read a scenario from a text, for example the text that is attached to a run log.

    Args:
        text: Content of a scenario file.
        path: Name for messages; no file is read.
        attachments: Contents of the files that the scenario refers to, by their names in the scenario.

    Raises:
        ScenarioError: See `load_scenario`.
    """
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    return _read(data, Path(path), Attachments(dict(attachments or {})))


def scenario_from_document(
    document: Mapping[str, Any], path: str | Path = "scenario.json", attachments: Mapping[str, bytes] | None = None
) -> Scenario:
    """Create a scenario from plain data, which the functions of `pushplan.scenario.builders` can compose.

    Args:
        document: Content of a scenario file as mappings, sequences, texts, numbers and NumPy arrays.
        path: Name for messages; no file is read.
        attachments: Contents of the files that the scenario refers to, by their names in the scenario.

    Raises:
        ScenarioError: See `load_scenario`; the findings have no lines.
    """
    try:
        text = json.dumps(document, default=_plain, indent=1)
    except (TypeError, ValueError, RecursionError) as error:
        raise ScenarioError(str(path), [Finding("", f"is not plain data: {error}")]) from error
    by_hand = "\\ud" in text  # LibYAML does not read JSON's surrogate pairs, as for emojis
    try:
        return _read(text.encode(), Path(path), Attachments(dict(attachments or {})), by_hand)
    except ScenarioError as error:
        placeless = [Finding(finding.where, finding.what) for finding in error.findings]
        raise ScenarioError(str(path), placeless) from error


def _plain(value: object) -> object:
    """Convert NumPy numbers, NumPy arrays and other mappings to JSON types."""
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"it holds a {type(value).__name__}; allowed: mappings, sequences, texts, numbers and arrays")


def _read(data: bytes, path: Path, attachments: Attachments, by_hand: bool = True) -> Scenario:
    try:
        source = Source(data, path, by_hand)
    except DocumentError as error:
        raise ScenarioError(str(path), error.findings) from error
    scenario = build_scenario(source, attachments)
    if scenario is not None:
        return scenario
    # If lengths seem to be in millimetres, only this error is reported: the others probably follow from it.
    question, more = length_question(source), len(source.findings)
    if question is None:
        raise ScenarioError(str(path), source.findings)
    follow = "one more error may" if more == 1 else f"{more} more errors may"
    what = f"{question.what}; {follow} follow from it"
    raise ScenarioError(str(path), [Finding(question.where, what, question.line, question.column)])
