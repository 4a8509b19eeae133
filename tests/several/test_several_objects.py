"""Files in which several objects have goals of their own: read, refused with the place, planned, recorded."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader
from pushplan.logging.old.errands import check_errands, delivers, errand_of
from pushplan.logging.old.joined import joined

from pushplan.cli.main import main
from pushplan.errors import PushplanError, RunLogError, ScenarioError
from pushplan.geometry import se2
from pushplan.logging.reader import load_run
from pushplan.scenario.file import load_scenario, scenario_from_document, scenario_from_text
from pushplan.scenario.json_schema import scenario_schema
from pushplan.scenario.source import Source

FILE = """\
format: pushplan/1
name: change-places
floor: {friction: 0.30}
objects:
  - {name: red, shape: {box: [0.30, 0.20]}, mass: 4.0, pose: [1.2, 1.0, 0.0]}
  - {name: blue, shape: {box: [0.20, 0.20]}, mass: 3.0, pose: [1.2, 2.2, 90 deg]}
  - {name: bin, shape: {box: [0.15, 0.15]}, mass: 1.0, pose: [3.0, 3.0, 0.0]}
pusher: {width: 0.28, friction: 0.50}
robot:
  footprint: {box: [0.42, 0.285], pose: [-0.225, 0, 0]}
  drive: {car: {axle: [-0.30, 0, 0], min_radius: 0.80}}
  start: [2.4, 1.6, 0.0]
goals:
  red: {pose: [1.2, 2.2, 0.0], symmetry: 2}
  blue: [1.2, 1.0, 90 deg]
workspace: {x: [0.0, 3.6], y: [0.0, 3.6]}
"""

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "swap.yaml"
    path.write_text(FILE, "utf-8")
    return path


def test_every_object_is_where_its_pose_says_and_has_its_own_goals(file: Path) -> None:
    stated = load_scenario(file)
    assert set(stated.bodies) - set(stated.goals) == {"bin"}
    for name, place in {"red": (1.2, 1.0), "blue": (1.2, 2.2), "bin": (3.0, 3.0)}.items():
        scenario = stated.alone(name)
        (obj,) = scenario.chain.objects
        middle = scenario.start[:2] + np.array(
            [np.cos(scenario.start[2]), np.sin(scenario.start[2])]
        ) * float(obj.pose_chain[0])
        np.testing.assert_allclose(middle, place, atol=1e-9)
    red, blue = (stated.alone(name).pushes for name in ("red", "blue"))
    assert red is not None
    assert blue is not None
    assert (len(red.goals), len(blue.goals)) == (2, 1)


@pytest.mark.parametrize(
    ("wrong", "right", "told"),
    [
        ("  red: {", "  reed: {", "14:3: goals.reed: no object is called 'reed'; did you mean 'red'?"),
        ("mass: 4.0", "mass: -4.0", "5:51: objects[0].mass: is -4;"),
        (
            "[1.2, 1.0, 90 deg]\n",
            "[9.0, 1.0, 0]\n",
            "15:9: goals.blue: at the goal, 'blue' leaves the workspace",
        ),
        ("pose: [3.0, 3.0, 0.0]", "pose: [1.2, 1.1, 0.0]", "objects[2].pose: 'bin' is 0 mm from 'red';"),
        (
            ", pose: [3.0, 3.0, 0.0]",
            "",
            "objects[2].pose: is missing; needed: [x, y, theta] in the world",
        ),
        ("name: bin", "name: red", "7:12: objects[2].name: 'red' is also objects[0]; give it another"),
        ("  start: [2.4, 1.6, 0.0]\n", "", "robot.start: is missing"),
        ("workspace:", "goal: {pose: [0, 0, 0]}\nworkspace:", "goal: does not go together with goals"),
    ],
)
def test_what_is_wrong_is_told_where_the_file_has_it(file: Path, wrong: str, right: str, told: str) -> None:
    assert wrong in FILE
    file.write_text(FILE.replace(wrong, right), "utf-8")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    assert told in str(caught.value)


def test_one_scenario_holds_all_objects_and_what_takes_one_load_says_so(file: Path) -> None:
    scenario = load_scenario(file)
    assert scenario.kind == "rearrangement"
    assert list(scenario.bodies) == ["red", "blue", "bin"]
    assert list(scenario.goals) == ["red", "blue"]
    with pytest.raises(PushplanError, match=r"several objects that stand apart.*scenario\.alone"):
        scenario.stable_set()
    with pytest.raises(PushplanError, match="no start for all"):
        np.asarray(scenario.start)


def test_a_scenario_of_several_objects_is_read_again_as_it_was(file: Path) -> None:
    scenario = load_scenario(file)
    again = scenario_from_document(scenario.resolved(), file)
    assert again == scenario
    for name in scenario.bodies:
        alone = scenario.alone(name)
        assert (alone.kind, again.alone(name)) == ("multi-push", alone)
        assert scenario_from_text(alone.source, file) == alone
    emptied = replace(scenario, obstacles=(), workspace=None)
    assert emptied.alone("red").workspace is None


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One log of all errands, as the command writes it."""
    path = tmp_path_factory.mktemp("errands") / "swap.yaml"
    path.write_text(FILE, "utf-8")
    log = path.with_name("swap.mcap")
    assert main(["plan", str(path), "-o", str(log), "--first", "--time-limit", "60"]) == 0
    return log


def test_the_command_records_all_errands_in_one_log(file: Path, capsys: Captured) -> None:
    log = file.with_name("swap.mcap")
    words = ["plan", str(file), "-o", str(log), "--first", "--time-limit", "60", "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["solved"]
    assert told["relocations"] == 1
    assert told["log"] == str(log)
    assert [errand["object"] for errand in told["errands"]][1:] in (["red", "blue"], ["blue", "red"])
    runs = read_runs(log)
    assert [errand_of(run) for run in runs] == [errand["object"] for errand in told["errands"]]
    assert [delivers(run) for run in runs] == [errand["delivers"] for errand in told["errands"]]
    for errand, run in zip(told["errands"], runs, strict=True):
        assert run.scenario.pushes is not None
        assert run.plan is not None
        assert len(run.plan.segments) == len(errand["segments"])


def test_what_asks_for_one_problem_refuses_several(recorded: Path) -> None:
    with pytest.raises(RunLogError, match="a log of 3 errands"):
        load_run(recorded)


def test_replay_verifies_and_shows_all_errands(recorded: Path, capsys: Captured) -> None:
    page, picture = recorded.with_name("swap.html"), recorded.with_name("swap.png")
    words = ["replay", str(recorded), "--verify", "--html", str(page), "--plot", str(picture), "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verification"]["matches"]
    names = [check["quantity"] for check in told["verification"]["checks"]]
    assert "errand 2: the robot's pose" in names
    assert any(name.endswith("among the obstacles") for name in names)
    assert picture.stat().st_size > 10_000
    assert all(name in page.read_text("utf-8") for name in ("red", "blue"))


def test_nothing_but_what_an_errand_moves_moves(recorded: Path) -> None:
    runs = read_runs(recorded)
    whole = joined(runs)
    execution, plan = whole.execution, whole.plan
    assert execution is not None
    assert execution.object_poses is not None
    assert plan is not None
    assert len(plan.segments) == sum(len(run.plan.segments) for run in runs if run.plan is not None)
    assert np.all(np.diff(execution.t) >= 0.0)
    names = [obj.name for obj in whole.scenario.chain.objects]
    count = 0
    for run in runs:
        own = run.execution
        assert own is not None
        these, count = slice(count, count + len(own.t)), count + len(own.t)
        for k, name in enumerate(names):
            if name == errand_of(run):
                poses = se2.compose(own.load_poses, run.scenario.chain.objects[0].pose_chain)
                np.testing.assert_allclose(execution.object_poses[these, k], poses, atol=1e-12)
            else:
                assert np.ptp(execution.object_poses[these, k], axis=0).max() < 1e-9
    goals = [goal.objects for goal in whole.scenario.pushes.goals] if whole.scenario.pushes else []
    assert sorted(set(goals)) == [("blue",), ("red",)]


def test_an_errand_that_begins_elsewhere_is_found(recorded: Path) -> None:
    runs = read_runs(recorded)
    last = runs[-1]
    moved = replace(last, scenario=replace(last.scenario, start=last.scenario.start + 0.01))
    assert all(check.matches for check in check_errands(runs))
    assert [c.quantity for c in check_errands([*runs[:-1], moved]) if not c.matches] == [
        f"errand 3: the pose of {errand_of(last)}"
    ]
    elsewhere = replace(last, scenario=replace(last.scenario, obstacles=()))
    found = [check.quantity for check in check_errands([*runs[:-1], elsewhere]) if not check.matches]
    assert found
    assert all(name.endswith("among the obstacles") for name in found)


def test_a_log_that_is_cut_keeps_the_errands_before(recorded: Path, tmp_path: Path, capsys: Captured) -> None:
    log = recorded.read_bytes()
    cut, clean = tmp_path / "cut.mcap.partial", tmp_path / "clean.mcap"
    cut.write_bytes(log[: len(log) // 2])
    assert main(["replay", "--recover", str(cut), str(clean)]) == 0
    assert "errand 1:" in capsys.readouterr().out
    found, whole = read_runs(clean), read_runs(recorded)
    assert 1 <= len(found) < len(whole)
    first, original = found[0].execution, whole[0].execution
    assert first is not None
    assert original is not None
    np.testing.assert_array_equal(first.poses, original.poses)
    assert main(["replay", str(clean), "--verify"]) == 0


def test_readers_of_others_read_one_time_line(recorded: Path) -> None:
    with recorded.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        times = [message.log_time for _, _, message in reader.iter_messages(topics=["/tf"])]
        updates = [
            SceneUpdate.FromString(message.data) for _, _, message in reader.iter_messages(topics=["/scene"])
        ]
        runs = [record.metadata for record in reader.iter_metadata() if record.name == "pushplan.run"]
    assert np.all(np.diff(times) >= 0)
    assert [words["errand"] for words in runs] == [errand_of(run) for run in read_runs(recorded)]
    kinds = [[one.type for one in update.deletions] for update in updates if update.deletions]
    assert kinds == [[SceneEntityDeletion.ALL]] * 2


def test_check_tells_of_every_object_what_becomes_of_it(file: Path, capsys: Captured) -> None:
    assert main(["check", str(file)]) == 0
    told = capsys.readouterr().out
    assert "goes to one of 2 goals, can be pushed at right, front, left, rear" in told
    assert told.count("is moved where it is in the way") == 1
    assert main(["check", str(file), "--plot", str(file.with_name("x.svg"))]) == 0
    drawn = file.with_name("x.svg").read_text()
    assert all(f"<!-- {name} -->" in drawn for name in ("red", "blue", "bin"))


def test_editors_know_goals(file: Path) -> None:
    checker = jsonschema.Draft202012Validator(scenario_schema())
    stated = Source(file.read_bytes()).root.plain()
    checker.validate(stated)
    mistakes: list[dict[str, Any]] = [
        {"goal": {"pose": [0, 0, 0]}},
        {"goals": {}},
        {"goals": {"red": [0, 0]}},
        {"robot": {}},
        {"objects": [{"name": "red", "shape": {"box": [1, 1]}, "mass": 1}]},
    ]
    for wrong in mistakes:
        assert not checker.is_valid(stated | wrong), wrong
    for right in ([[0, 0, 0], {"pose": [1, 1, 0]}], {"pose": [0, 0, 0], "symmetry": 4}, [1, 1, "90 deg"]):
        checker.validate(stated | {"goals": {"red": right}})


def test_what_is_for_one_load_is_refused(file: Path, capsys: Captured) -> None:
    assert main(["plan", str(file), "--plot", str(file.with_name("x.png"))]) == 2
    assert "--plot does not go together with goals of several objects" in capsys.readouterr().err


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


def test_what_makes_room_on_its_goal_is_brought_back(tmp_path: Path, capsys: Captured) -> None:
    """Blue stands on its goal, in the mouth of the alcove in which red's goal is."""
    path = tmp_path / "alcove.yaml"
    path.write_text(ALCOVE, "utf-8")
    assert main(["plan", str(path), "--first", "--time-limit", "120", "--no-log", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    ends = {errand["object"]: errand["segments"][-1]["object_after"] for errand in told["errands"]}
    for name, goal in {"red": [2.0, 2.6], "blue": [2.0, 1.85]}.items():
        assert np.hypot(*(np.array(ends[name][:2]) - goal)) < 0.1 + 1e-6, (
            name
        )  # of the rear face's middle, or nearer


@pytest.mark.parametrize("command", ["check", "plan"])
@pytest.mark.parametrize("goals", ["[1.2, 1.1, 90 deg]", "[{pose: [1.2, 1.0, 0]}, {pose: [1.1, 1.0, 0]}]"])
def test_goals_that_overlap_are_refused_at_once(
    file: Path, command: str, goals: str, capsys: Captured
) -> None:
    """Red starts on its goal; wherever blue goes, it would stand on it."""
    stated = FILE.replace("red: {pose: [1.2, 2.2, 0.0], symmetry: 2}", "red: [1.2, 1.0, 0.0]")
    file.write_text(stated.replace("blue: [1.2, 1.0, 90 deg]", f"blue: {goals}"), "utf-8")
    assert main([command, str(file)]) == 2
    told = capsys.readouterr().err
    assert "15:9: goals.blue: at their goals, 'red' and 'blue' are 0 mm apart; allowed: at least" in told


def test_one_goal_of_several_that_is_apart_is_enough(file: Path) -> None:
    stated = FILE.replace("blue: [1.2, 1.0, 90 deg]", "blue: [[1.2, 2.2, 0], [1.2, 1.0, 90 deg]]")
    file.write_text(stated, "utf-8")
    assert list(load_scenario(file).goals) == ["red", "blue"]
