"""Files in which several objects have goals of their own: read, refused with the place, planned, recorded."""

import json
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from pushplan.cli.main import main
from pushplan.errors import PushplanError, ScenarioError
from pushplan.logging.reader import load_run
from pushplan.planners.multi.room import TOLERANCE_USED
from pushplan.planners.validator import Validator
from pushplan.scenario.file import load_scenario, scenario_from_document, scenario_from_text
from pushplan.scenario.parts import TOLERANCE_OF_SEVERAL

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


@pytest.mark.parametrize(("wrong", "right", "told"), [
    ("  red: {", "  reed: {", "14:3: goals.reed: no object is called 'reed'; did you mean 'red'?"),
    ("mass: 4.0", "mass: -4.0", "5:51: objects[0].mass: is -4;"),
    ("[1.2, 1.0, 90 deg]\n", "[9.0, 1.0, 0]\n", "15:9: goals.blue: at the goal, 'blue' leaves the workspace"),
    ("pose: [3.0, 3.0, 0.0]", "pose: [1.2, 1.1, 0.0]", "objects[2].pose: 'bin' overlaps 'red' by 75 mm;"),
    (", pose: [3.0, 3.0, 0.0]", "", "objects[2].pose: is missing; needed: [x, y, theta] in the world"),
    ("name: bin", "name: red", "7:12: objects[2].name: 'red' is also objects[0]; give it another"),
    ("  start: [2.4, 1.6, 0.0]\n", "", "robot.start: is missing"),
    ("workspace:", "goal: {pose: [0, 0, 0]}\nworkspace:", "goal: does not go together with goals"),
])  # fmt: skip
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
    with pytest.raises(PushplanError, match=r"objects of the scenario stand apart.*scenario\.alone"):
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
    """One log of the whole run, as the command writes it."""
    path = tmp_path_factory.mktemp("objects") / "swap.yaml"
    path.write_text(FILE, "utf-8")
    log = path.with_name("swap.mcap")
    words = ["plan", str(path), "-o", str(log), "--plot", str(log.with_suffix(".svg"))]
    assert main([*words, "--first", "--time-limit", "60"]) == 0
    return log


def test_the_command_records_one_run_that_replay_verifies_and_shows(recorded: Path, capsys: Captured) -> None:
    assert recorded.with_suffix(".svg").stat().st_size > 10_000
    page, picture = recorded.with_name("again.html"), recorded.with_name("again.png")
    words = ["replay", str(recorded), "--verify", "--html", str(page), "--plot", str(picture), "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["solved"]
    assert told["verification"]["matches"]
    pushed = [s["load"][0]["object"] for s in told["segments"] if s["kind"] == "push"]
    assert [name for name, _ in groupby(pushed)] in (["red", "blue", "red"], ["blue", "red", "blue"])
    assert picture.stat().st_size > 10_000
    assert all(name in page.read_text("utf-8") for name in ("red", "blue", "bin"))


def test_nothing_but_what_is_pushed_moves(recorded: Path) -> None:
    run = load_run(recorded)
    assert run.plan is not None
    assert run.execution is not None
    assert np.all(np.diff(run.execution.t) >= 0.0)
    for k, segment in enumerate(run.plan.segments):
        here = run.execution.objects[run.execution.segment == k]
        pushed = segment.load.names if segment.pushes and segment.load is not None else ()
        for column, name in enumerate(run.execution.names):
            assert (np.ptp(here[:, column, :2], axis=0).max() > 0.01) == (name in pushed)
    assert run.execution.goal_error[0] <= TOLERANCE_USED * TOLERANCE_OF_SEVERAL[0] + 1e-9


def test_the_verdict_looks_at_all_goals(recorded: Path) -> None:
    """Both of two objects have to be at their goals, also one that was never pushed."""
    run = load_run(recorded)
    assert run.plan is not None
    last = [k for k, segment in enumerate(run.plan.segments) if segment.kind == "push"][-1]
    before = next(k for k in range(last, -1, -1) if run.plan.segments[k].kind == "transit")
    assert "misses the goal" in Validator(run.scenario).flaw(run.plan.segments[:before], None)
    assert "misses the goal" in Validator(run.scenario).flaw((), None)
    assert Validator(run.scenario).flaw(run.plan.segments, run.execution) == ""


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
    assert "blue" in {s["load"][0]["object"] for s in told["segments"] if s["kind"] == "push"}
    for name, goal in {"red": [2.0, 2.6], "blue": [2.0, 1.85]}.items():
        assert np.hypot(*(np.array(told["segments"][-1]["after"][name][:2]) - goal)) < 2e-3, name


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
