"""Whether a scenario's chain can be pushed at all, for commands that go on only then."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pushplan.errors import ScenarioError

if TYPE_CHECKING:
    from pushplan.scenario.model import Scenario


def require_pushable(scenario: Scenario) -> None:
    """Check what loading leaves out: whether any push keeps the chain together.

    Raises:
        ScenarioError: With the findings.
    """
    from pushplan.scenario.check import check_scenario

    findings = check_scenario(scenario)
    if findings:
        raise ScenarioError(str(scenario.path), findings)
