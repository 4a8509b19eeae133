"""Read scenario files: syntax, values, geometry, start and goal, with everything wrong told at once."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pushplan.errors import Finding, ScenarioError
from pushplan.scenario.build import build_scenario
from pushplan.scenario.examples import example_file, example_names
from pushplan.scenario.files import Attachments
from pushplan.scenario.imported.ros_map import map_files
from pushplan.scenario.model import Scenario
from pushplan.scenario.questions import length_question
from pushplan.scenario.schema.findings import nearest
from pushplan.scenario.several_objects import build_rearrangement
from pushplan.scenario.yaml.report import Report
from pushplan.scenario.yaml.text import MOST_BYTES, DocumentError
from pushplan.scenario.yaml.tree import read_document


def load_scenario(source: str | Path, maps: Sequence[str | Path] = ()) -> Scenario:
    """Read a scenario from a file, or a packaged example by its name.

    A file of that name comes first; a Path is never taken for an example's name.

    Args:
        source: File or name.
        maps: YAML files of maps that are added to its obstacles.

    Raises:
        ScenarioError: With everything found wrong: syntax, values, geometry, start and goal.
        ImportedFileError: When a map cannot be read.
    """
    path = Path(source)
    if isinstance(source, str) and source in example_names() and not path.is_file():
        path = Path(str(example_file(source)))
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ScenarioError(str(source), [Finding("", _unreadable(source, error))]) from error
    if maps:
        return _with_maps(data, path, maps)
    return read_scenario(data, path, Attachments({}, path.parent))


def states_goals(path: Path) -> bool:
    """Tell whether a file has `goals`; False where it cannot be read, which others tell of."""
    try:
        with path.open("rb") as file:
            return read_document(file.read(MOST_BYTES + 1)).root.holds(("goals",))
    except (OSError, ValueError, DocumentError):
        return False


def _with_maps(data: bytes, path: Path, maps: Sequence[str | Path]) -> Scenario:
    """Read a scenario with more maps, as JSON, in which the log holds it."""
    alone = read_scenario(data, path, Attachments({}, path.parent))
    files: dict[str, bytes] = {}
    document: Any = read_document(data).root.plain()
    obstacles = list(document.get("obstacles", ()))
    for i, file in enumerate(maps):
        name = f"map-{i}/{Path(file).name}"
        files |= map_files(Path(file), name)
        obstacles.append({"map": name})
    named = document | {"name": alone.name, "obstacles": obstacles}
    return scenario_from_document(named, path, {**alone.attachments, **files})


def scenario_from_text(
    text: str | bytes, path: str | Path = "scenario.yaml", attachments: Mapping[str, bytes] | None = None
) -> Scenario:
    """Read a scenario from a text, e.g. from the one that is attached to a run's log.

    Args:
        text: What a scenario file holds.
        path: What messages call it; nothing is read from there.
        attachments: Contents of the files that the scenario refers to, by the name that it uses.

    Raises:
        ScenarioError: As for `load_scenario`.
    """
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    return read_scenario(data, Path(path), Attachments(dict(attachments or {})))


def scenario_from_document(
    document: Mapping[str, Any],
    path: str | Path = "scenario.json",
    attachments: Mapping[str, bytes] | None = None,
) -> Scenario:
    """Return the scenario that plain data state; see `pushplan.scenario.builders` for functions that make them.

    Args:
        document: What a scenario file holds, as mappings, sequences, texts, numbers and NumPy arrays.
        path: What messages call it; nothing is read from there.
        attachments: Contents of the files that the scenario refers to, by the name that it uses.

    Raises:
        ScenarioError: As for `load_scenario`; the findings have no lines.
    """
    try:
        text = json.dumps(document, default=_plain, indent=1)
    except (TypeError, ValueError, RecursionError) as error:
        raise ScenarioError(str(path), [Finding("", f"is no plain data: {error}")]) from error
    by_hand = "\\ud" in text  # LibYAML does not read JSON's pairs of escapes for signs such as emojis
    try:
        return read_scenario(text.encode(), Path(path), Attachments(dict(attachments or {})), by_hand)
    except ScenarioError as error:
        placeless = [Finding(finding.where, finding.what) for finding in error.findings]
        raise ScenarioError(str(path), placeless) from error


def _plain(value: object) -> object:
    """Turn NumPy's numbers and arrays, and mappings of other kinds, into what JSON knows."""
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(
        f"it holds a {type(value).__name__}; allowed: mappings, sequences, texts, numbers and arrays"
    )


def read_scenario(
    data: bytes, path: Path, attachments: Attachments, written_by_hand: bool = True
) -> Scenario:
    """Return the scenario that the bytes of a file state.

    Raises:
        ScenarioError: As for `load_scenario`.
    """
    try:
        document = read_document(data, written_by_hand)
    except DocumentError as error:
        raise ScenarioError(str(path), error.findings) from error
    report = Report(document)
    build = build_rearrangement if document.root.holds(("goals",)) else build_scenario
    scenario = build(document, path, data, attachments, report)
    if scenario is None:
        raise ScenarioError(str(path), _told_first(report))
    return scenario


def _told_first(report: Report) -> tuple[Finding, ...]:
    """Return what is wrong; lengths that are millimetres by all appearance stand for what follows from them."""
    question = length_question(report.document)
    if question is None:
        return report.findings
    more = len(report.findings)
    follows = (
        "one more finding may follow from it" if more == 1 else f"{more} more findings may follow from it"
    )
    return (replace(question, what=f"{question.what}; {follows}"),)


def _unreadable(source: str | Path, error: Exception) -> str:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    text = f"cannot read the file: {reason}"
    beside = Path(f"{source}.yaml")
    if isinstance(error, FileNotFoundError) and beside.is_file():
        return f"{text}; did you mean '{beside}'?"
    if isinstance(error, FileNotFoundError) and isinstance(source, str) and Path(source).name == source:
        names = list(example_names())
        text += (
            f"; no packaged scenario is called so either{nearest(source, names)} there are {', '.join(names)}"
        )
    return text
