"""Read scenario files: syntax, values, geometry, start and goal, with everything wrong told at once."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pushplan.errors import Finding, ScenarioError
from pushplan.examples import example_file, example_names
from pushplan.report import Report
from pushplan.scenario import Scenario
from pushplan.scenario_build import build_scenario
from pushplan.scenario_files import Attachments
from pushplan.schema_findings import nearest
from pushplan.yaml_text import MOST_BYTES, DocumentError
from pushplan.yaml_tree import read_document


def load_scenario(source: str | Path) -> Scenario:
    """Read a file, or a packaged example by its name; see `pushplan.scenario.load_scenario`."""
    path = Path(source)
    if isinstance(source, str) and source in example_names() and not path.is_file():
        path = Path(str(example_file(source)))
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ScenarioError(str(source), [Finding("", _unreadable(source, error))]) from error
    return _read(data, path, Attachments({}, path.parent))


def scenario_from_text(
    text: str | bytes, path: str | Path = "scenario.yaml", attachments: Mapping[str, bytes] | None = None
) -> Scenario:
    """Read a text; see `pushplan.scenario.scenario_from_text`."""
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    return _read(data, Path(path), Attachments(dict(attachments or {})))


def _read(data: bytes, path: Path, attachments: Attachments) -> Scenario:
    try:
        document = read_document(data)
    except DocumentError as error:
        raise ScenarioError(str(path), error.findings) from error
    report = Report(document)
    scenario = build_scenario(document, path, data, attachments, report)
    if scenario is None:
        raise ScenarioError(str(path), report.findings)
    return scenario


def _unreadable(source: str | Path, error: Exception) -> str:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    text = f"cannot read the file: {reason}"
    if isinstance(error, FileNotFoundError) and isinstance(source, str) and Path(source).name == source:
        names = list(example_names())
        text += (
            f"; no packaged scenario is called so either{nearest(source, names)} there are {', '.join(names)}"
        )
    return text
