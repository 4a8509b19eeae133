"""The scenario of a run as attachments of its log, and back from them alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from pushplan.errors import RunLogError, ScenarioError
from pushplan.logging.items import Attachment
from pushplan.scenario import Scenario, scenario_from_text

SCENARIO_FILE, SCENARIO_JSON = "scenario.yaml", "scenario.json"
"""The scenario byte for byte, and with everything resolved that it leaves open."""

MEDIA_TYPES = {SCENARIO_FILE: "application/yaml", SCENARIO_JSON: "application/json"}

SCENARIO_FOLDER = "scenario/"
"""Beginning of the names of the files that the scenario refers to, such as pressure maps."""


def attachments_of(scenario: Scenario) -> dict[str, bytes]:
    """Return what a log has to keep so that `scenario_from_attachments` gives the scenario back."""
    referred = {SCENARIO_FOLDER + name: data for name, data in scenario.attachments.items()}
    return {SCENARIO_FILE: scenario.source, SCENARIO_JSON: scenario.to_json().encode(), **referred}


def scenario_from_attachments(log: Path, attachments: Mapping[str, Attachment]) -> Scenario:
    """Return the scenario that `attachments` of `log` hold, by their names.

    The file as the user wrote it counts, unless this version of pushplan fills its gaps differently from the
    version that wrote the log; then the resolved one counts.

    Raises:
        KeyError: When one of the two is missing.
        RunLogError: When they are no scenario.
    """
    source, resolved = attachments[SCENARIO_FILE], attachments[SCENARIO_JSON].data
    referred = {
        name.removeprefix(SCENARIO_FOLDER): attachment.data
        for name, attachment in attachments.items()
        if name.startswith(SCENARIO_FOLDER)
    }
    try:
        scenario = scenario_from_text(source.data, log / SCENARIO_FILE, referred)
        if scenario.to_json().encode() == resolved:
            return scenario
        return replace(scenario_from_text(resolved, log / SCENARIO_JSON, referred), source=source.data)
    except ScenarioError as error:
        raise RunLogError(str(log), f"its scenario is refused: {error}", source.offset) from error
