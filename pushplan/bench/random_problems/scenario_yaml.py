"""Scenario files from plain data."""

from __future__ import annotations

from collections.abc import Mapping

import yaml

from pushplan.util.names import SCENARIO_FORMAT


def scenario_yaml(sections: Mapping[str, object]) -> str:
    """Return the text of a scenario file with the given sections, in their order."""
    document = {"format": SCENARIO_FORMAT, **sections}
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=110)
