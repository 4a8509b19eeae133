"""Scenarios made in Python are those that a file states, with the same checks."""

from typing import Any

import numpy as np
import pytest

from pushplan.errors import ScenarioError
from pushplan.scenario.builders import box, build_scenario, plate, polygon
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle, PolygonObstacle

TRIANGLE = np.array([[0.5, 0.2], [0.7, 0.2], [0.6, 0.5]])
TEXT = """\
format: pushplan/1
name: row
floor: {friction: 0.3}
objects:
  - {name: a, shape: {box: [0.1, 0.08]}, mass: 1.2, support: unknown}
  - {name: b, shape: {polygon: [[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]]}, mass: 0.8, offset: 0.01}
contacts: {friction: 14 deg}
pusher: {width: 0.2, friction: 0.55, drive: {differential: {axle: [-0.3, 0, 0]}}}
goal: {pose: [1.2, 0.8, 90 deg], of: b}
workspace: {x: [-0.5, 2], y: [-0.5, 2]}
obstacles:
  - {polygon: [[0.5, 0.2], [0.7, 0.2], [0.6, 0.5]]}
  - {circle: 0.1, center: [1.0, 0.2]}
stability: {set: stable}
"""


def _row(**changes: Any) -> Scenario:
    square = np.array([[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]])
    arguments: dict[str, Any] = {
        "objects": [box("a", 0.1, 0.08, 1.2, support="unknown"), polygon("b", square, 0.8, offset=0.01)],
        "pusher": plate(0.2, 0.55, drive={"differential": {"axle": np.array([-0.3, 0.0, 0.0])}}),
        "goal": np.array([1.2, 0.8, np.pi / 2]),
        "floor_friction": 0.3,
        "contact_friction": "14 deg",
        "of": "b",
        "obstacles": [TRIANGLE, CircleObstacle(np.array([1.0, 0.2]), 0.1)],
        "workspace": {"x": [-0.5, 2], "y": [-0.5, 2]},
        "stability": {"set": "stable"},
    }
    return build_scenario("row", **(arguments | changes))


def test_arguments_and_file_state_the_same_scenario() -> None:
    assert _row() == scenario_from_text(TEXT)
    assert _row(obstacles=[PolygonObstacle(TRIANGLE)]) == _row(obstacles=[TRIANGLE.tolist()])


def test_mistakes_are_told_all_at_once_by_place() -> None:
    with pytest.raises(ScenarioError) as caught:
        _row(objects=[box("a", -0.1, 0.08, 1.2)], goal=(0.0, np.nan, 0.0), widht=3)
    places = {finding.where for finding in caught.value.findings}
    assert places == {"objects[0].shape.box[0]", "goal.pose[1]", "widht"}
    assert all(finding.line is None for finding in caught.value.findings)
    assert str(caught.value).startswith("row.json: objects[0].shape.box[0]: is -0.1; allowed: a length")


@pytest.mark.parametrize("value", [object(), {1, 2}, 1j, lambda: None])
def test_what_is_no_plain_data_is_refused(value: object) -> None:
    with pytest.raises(ScenarioError, match=r"row.json: is no plain data: it holds a \w+; allowed: mappings"):
        _row(planner={"seed": value})


def test_a_pressure_map_is_attached() -> None:
    table = b"x,y,pressure\n0.01,0,1\n-0.01,0,1\n"
    bodies = [box("a", 0.1, 0.08, 1.2, support={"pressure_map": "map.csv"})]
    scenario = _row(objects=bodies, of="a", attachments={"map.csv": table})
    assert scenario.attachments == {"map.csv": table}
    with pytest.raises(ScenarioError, match=r"'map.csv' is not attached"):
        _row(objects=bodies, of="a")
