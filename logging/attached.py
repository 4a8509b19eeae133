"""The scenario of a run, from the attachments of its log alone."""

from __future__ import annotations

from pushplan.scenario import Scenario

SCENARIO_FILE, SCENARIO_JSON = "scenario.yaml", "scenario.json"
"""The scenario byte for byte, and with everything resolved that it leaves open."""

MEDIA_TYPES = {SCENARIO_FILE: "application/yaml", SCENARIO_JSON: "application/json"}

SCENARIO_FOLDER = "scenario/"
"""Beginning of the names of the files that the scenario refers to, such as pressure maps."""


def attachments_of(scenario: Scenario) -> dict[str, bytes]:
    """Return what a log has to keep so that `scenario_from_attachments` gives the scenario back."""
    referred = {SCENARIO_FOLDER + name: data for name, data in scenario.attachments.items()}
    return {SCENARIO_FILE: scenario.source, SCENARIO_JSON: scenario.to_json().encode(), **referred}
