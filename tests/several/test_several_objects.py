"""Files with goals for several objects: read, refused with the place, planned, recorded."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import Captured
from kinds import SWAP
from scenarios.conftest import Changed

from pushplan.cli.main import main
from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.planner import plan
from pushplan.scenario.file import scenario_from_document, scenario_from_text


@pytest.mark.parametrize(("wrong", "right", "told"), [
    ("{red-box: {", "{red-bxo: {", "10:9: goals.red-bxo: no object is called 'red-bxo'; did you mean 'red-box'?"),
    ("[2.2, 1.0, 90 deg]", "[9.0, 1.0, 0]", "goals.other: at the goal, 'other' leaves the workspace"),
    ("pose: [3.0, 3.0, 0.0]", "pose: [1.2, 1.1, 0.0]", "objects[2].pose: 'bin' overlaps 'red-box' by 75 mm;"),
    (", pose: [3.0, 3.0, 0.0]", "", "objects[2].pose: is missing; needed: [x, y, theta] in the world"),
    ("name: bin", "name: red-box", "7:12: objects[2].name: objects[0] is called 'red-box' too; allowed: each name"),
    (", start: [2.4, 1.6, 0.0]", "", "robot.start: is missing"),
    ("workspace:", "goal: {pose: [0, 0, 0]}\nworkspace:", "goal: is not allowed together with goals"),
])  # fmt: skip
def test_errors_are_reported_at_their_places_in_the_file(wrong: str, right: str, told: str) -> None:
    assert told in "\n".join(Changed(SWAP).findings((wrong, right)))


def test_single_load_functions_refuse_a_scenario_of_several_objects() -> None:
    scenario = scenario_from_text(SWAP)
    assert scenario.kind == "rearrangement"
    assert list(scenario.task.by_name) == ["red-box", "other", "bin"]
    assert list(scenario.goals) == ["red-box", "other"]
    with pytest.raises(PushplanError, match=r"has 3 loads.*allowed: scenario\.alone"):
        scenario.stable_set()
    with pytest.raises(PushplanError, match="it has no single chain, start or goal"):
        scenario.start.any()
    with pytest.raises(AttributeError, match=r"Scenario\.pushes is scenario\.transport now"):
        scenario.pushes  # type: ignore[attr-defined]  # noqa: B018


def test_a_scenario_of_several_objects_survives_a_round_trip() -> None:
    scenario = scenario_from_text(SWAP)
    again = scenario_from_document(scenario.resolved())
    assert again == scenario
    for name in scenario.task.by_name:
        alone = scenario.alone(name)
        assert (alone.kind, again.alone(name)) == ("multi-push", alone)
        assert scenario_from_text(alone.source) == alone
    emptied = replace(scenario, obstacles=(), workspace=None)
    assert emptied.alone("red-box").workspace is None


def test_a_load_that_starts_elsewhere_is_there_with_its_first_object() -> None:
    load = scenario_from_text(SWAP).loads[1]
    assert load.pose.tolist() == [1.2, 2.2, np.pi / 2.0]  # to the last digit as the file has it
    moved = replace(load, start=np.array([0.3, -0.4, 1.0]))
    np.testing.assert_allclose(moved.pose, se2.compose(moved.start, load.chain.objects[0].pose_chain))
    np.testing.assert_allclose(moved.start_for(moved.pose), moved.start, atol=1e-12)


ALCOVE = """\
format: pushplan/1
name: into-the-alcove
floor: {friction: 0.30}
objects:
  - {name: red, shape: {box: [0.20, 0.20]}, mass: 3.0, pose: [2.0, 1.2, 0.0]}
  - {name: blue, shape: {box: [0.20, 0.20]}, mass: 3.0, pose: [2.0, 1.85, 0.0]}
pusher: {width: 0.24, friction: 0.50}
robot:
  footprint: {box: [0.30, 0.24], pose: [-0.155, 0, 0]}
  drive: omnidirectional
  start: [2.0, 0.5, 90 deg]
goals:
  red: {pose: [2.0, 2.6, 0.0], symmetry: 4}
  blue: {pose: [2.0, 1.85, 0.0], symmetry: 4}
workspace: {x: [0.0, 4.0], y: [0.0, 3.0]}
obstacles:
  - {box: [1.75, 1.0], pose: [0.875, 2.5, 0.0]}
  - {box: [1.75, 1.0], pose: [3.125, 2.5, 0.0]}
"""


def test_an_object_that_makes_room_returns_to_its_goal(tmp_path: Path, capsys: Captured) -> None:
    """Blue stands on its goal, at the entrance of the alcove with red's goal."""
    path = tmp_path / "alcove.yaml"
    path.write_text(ALCOVE, "utf-8")
    assert main(["plan", str(path), "--first", "--time-limit", "120", "--no-log", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert "blue" in {s["load"][0]["object"] for s in told["segments"] if s["kind"] == "push"}
    for name, goal in {"red": [2.0, 2.6], "blue": [2.0, 1.85]}.items():
        assert np.hypot(*(np.array(told["segments"][-1]["after"][name][:2]) - goal)) < 2e-3, name


@pytest.mark.parametrize("command", ["check", "plan"])
@pytest.mark.parametrize("goals", ["[1.2, 1.1, 90 deg]", "[{pose: [1.2, 1.0, 0]}, {pose: [1.1, 1.0, 0]}]"])
def test_goals_that_overlap_are_refused_at_once(command: str, goals: str, tmp_path: Path, capsys: Captured) -> None:
    """The red box starts on its goal and would overlap the other one on its goal."""
    stated = SWAP.replace("red-box: {pose: [2.2, 2.2, 0.0], symmetry: 2}", "red-box: [1.2, 1.0, 0.0]")
    file = tmp_path / "swap.yaml"
    file.write_text(stated.replace("other: [2.2, 1.0, 90 deg]", f"other: {goals}"), "utf-8")
    assert main([command, str(file)]) == 2
    told = capsys.readouterr().err
    assert "10:42: goals.other: at their goals, 'red-box' and 'other' are 0 mm apart; allowed: at least" in told


DOOR = """\
format: pushplan/1
name: idle-in-the-door
floor: {friction: 0.3}
objects:
  - {name: cargo, shape: {box: [0.2, 0.2]}, mass: 2.0, pose: [4.5, 2.2, 0.3]}
  - {name: idle, shape: {box: [0.25, 0.25]}, mass: 2.0, pose: [3.0, 1.5, 0.0]}
pusher: {width: 0.24, friction: 0.5}
robot:
  footprint: {box: [0.35, 0.24], pose: [-0.175, 0.0, 0.0]}
  drive: {car: {axle: [-0.3, 0, 0], min_radius: 0.6}}
  start: [0.5, 1.5, 0.0]
goals: {cargo: {pose: [5.0, 1.5, 0.0], symmetry: 4}}
workspace: {x: [-1.0, 7.0], y: [0.0, 3.0]}
obstacles:
  - {box: [0.1, 1.2], pose: [3.0, 0.6, 0]}
  - {box: [0.1, 1.2], pose: [3.0, 2.4, 0]}
"""


def test_an_idle_object_in_a_door_that_the_robot_alone_has_to_pass_is_moved() -> None:
    found = plan(scenario_from_text(DOOR), first=True, time_limit=60.0)
    assert found.solved, found.reason
    assert found.pushes[0].pushed == ("idle",)
