"""A valid scenario file, and the errors after changes."""

from dataclasses import dataclass

import pytest

from pushplan.errors import ScenarioError
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario

VALID = """\
format: pushplan/1
name: two-crates
floor: {friction: 0.30}
objects:
  - name: near
    shape: {box: [0.10, 0.08]}
    mass: 1.2
    support: uniform
  - name: far
    shape: {polygon: [[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]]}
    mass: 0.8
    offset: 0.01
contacts:
  friction: 0.25
  between: [{objects: [near, far], friction: 0.20}]
pusher:
  width: 0.20
  thickness: 0.03
  friction: 0.55
  drive: omnidirectional
start: [0.0, 0.0, 0.0]
goal:
  pose: [1.2, 0.8, 90 deg]
  of: far
  tolerance: {position: 0.002, angle: 0.2 deg}
workspace: {x: [-0.5, 2.0], y: [-0.5, 2.0]}
obstacles:
  - {polygon: [[0.5, 0.2], [0.7, 0.2], [0.6, 0.5]]}
  - {box: [0.2, 0.1], pose: [0.3, 1.0, 0.3]}
  - {circle: 0.1, center: [1.0, 0.2]}
stability: {set: ecof, margin: auto}
planner: {name: rrt, time_limit: 2.0, seed: 1}
"""


@dataclass(frozen=True)
class Changed:
    """Reader of the valid file with changes; every change must apply."""

    text: str = VALID

    def __call__(self, *changes: tuple[str, str]) -> str:
        text = self.text
        for old, new in changes:
            assert text.count(old) >= 1, f"{old!r} is not in the file"
            text = text.replace(old, new, 1)
        return text

    def scenario(self, *changes: tuple[str, str]) -> Scenario:
        return scenario_from_text(self(*changes), "f.yaml")

    def findings(self, *changes: tuple[str, str]) -> list[str]:
        with pytest.raises(ScenarioError) as caught:
            self.scenario(*changes)
        return [finding.text("f.yaml") for finding in caught.value.findings]


@pytest.fixture(scope="session")
def valid() -> Changed:
    """Return the valid scenario for changes."""
    return Changed()
