"""Several pushes in a scenario file: what is read, what a file without them means, and what is wrong with it."""

import math
from typing import Any

import numpy as np
import pytest

from pushplan.errors import ScenarioError
from pushplan.scenario.file import scenario_from_document, scenario_from_text
from pushplan.scenario.model import Scenario

FILE = """\
format: pushplan/1
name: behind
floor: {friction: 0.3}
objects:
  - {name: box, shape: {box: [0.15, 0.15]}, mass: 1.0}
pusher: {width: 0.2, friction: 0.5}
robot: {start: [0.2, 1.0, 0.0]}
start: [1.0, 1.0, 0.0]
goal: {pose: [2.0, 1.0, 0.0], of: box}
workspace: {x: [0.0, 3.0], y: [0.0, 3.0]}
"""


def changed(*changes: tuple[str, str]) -> str:
    text = FILE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def read(*changes: tuple[str, str]) -> Scenario:
    return scenario_from_text(changed(*changes))


def findings(*changes: tuple[str, str]) -> list[str]:
    with pytest.raises(ScenarioError) as error:
        read(*changes)
    return [finding.text("s.yaml") for finding in error.value.findings]


def test_quantities_take_units_and_faces_take_angles() -> None:
    stated = "pusher: {width: 0.2, friction: 0.5, faces: [rear, 90 deg], offsets: [0, 15 mm]}"
    pushes = read(
        ("pusher: {width: 0.2, friction: 0.5}", stated),
        ("start: [1.0", "pushes: {most: 2, approach: 8 cm, settle: 10 mm}\nstart: [1.0"),
    ).pushes
    assert pushes is not None
    assert pushes.faces is not None
    assert pushes.faces[0] == "rear"
    assert pushes.faces[1] == pytest.approx(0.5 * math.pi)
    assert pushes.offsets == (0.0, 0.015)
    assert (pushes.most, pushes.approach, pushes.settle) == (2, 0.08, 0.01)


def test_symmetry_turns_the_goal_about_the_object_that_it_is_for() -> None:
    pushes = read(("of: box}", "of: box, symmetry: 4}")).pushes
    assert pushes is not None
    assert [round(math.degrees(goal.pose[2])) % 360 for goal in pushes.goals] == [0, 90, 180, 270]
    for goal in pushes.goals:
        ahead = 0.075 * np.array([math.cos(goal.pose[2]), math.sin(goal.pose[2])])
        np.testing.assert_allclose(goal.pose_chain[:2] + ahead, [2.0, 1.0], atol=1e-12)


ROBOT = "{footprint: {box: [0.1, 0.1], pose: [-0.1, 0, 0]}, drive: {differential: {axle: [-0.1, 0, 0]}}, "


@pytest.mark.parametrize(
    "change",
    [
        (("of: box}", "of: box, symmetry: 4}"),),
        (
            ("friction: 0.5}", "friction: 0.5, faces: [left, 0.5], offsets: [-0.01]}"),
            ("start: [1.0", "pushes: {most: 2}\nstart: [1.0"),
        ),
        (("robot: {", f"robot: {ROBOT}"),),
    ],
)
def test_what_is_resolved_reads_as_the_same_scenario(change: tuple[tuple[str, str], ...]) -> None:
    scenario = read(*change)
    assert scenario_from_document(scenario.resolved()) == scenario


WITHOUT = ("robot: {start: [0.2, 1.0, 0.0]}\n", "")
NEEDS = "is for multi-push plans: it needs a robot.start, the plate's pose in the world"

WRONG: dict[str, tuple[Any, str]] = {
    "several goals": (
        (WITHOUT, ("goal: {pose: [2.0, 1.0, 0.0], of: box}", "goal: [{pose: [2, 1, 0]}]")),
        f"s.yaml:8:1: goal: {NEEDS}",
    ),
    "symmetry": ((WITHOUT, ("of: box}", "of: box, symmetry: 4}")), f"s.yaml:8:40: goal.symmetry: {NEEDS}"),
    "faces": (
        (WITHOUT, ("friction: 0.5}", "friction: 0.5, faces: all}")),
        f"s.yaml:6:37: pusher.faces: {NEEDS}",
    ),
    "pushes": ((WITHOUT, ("start: [1", "pushes: {}\nstart: [1")), f"s.yaml:7:1: pushes: {NEEDS}"),
    "an unknown face": (
        (("friction: 0.5}", "friction: 0.5, faces: [behind]}"),),
        "pusher.faces[0]: is the text 'behind'; allowed: rear, front, left, right, or an angle in rad from -10 to "
        '10, or with a unit, e.g. "120 deg"',
    ),
    "no push": (
        (("start: [1", "pushes: {most: 0}\nstart: [1"),),
        "pushes.most: is 0; allowed: a whole number from 1 to 100",
    ),
    "a robot outside": (
        (("[0.2, 1.0, 0.0]}", "[0.0, 1.0, 0.0]}"),),
        "s.yaml:7:16: robot.start: at the robot's start, 'pusher' leaves the workspace (x >= 0) by 30 mm",
    ),
    "a robot in the box": (
        (("[0.2, 1.0, 0.0]}", "[1.05, 1.0, 0.0]}"),),
        "s.yaml:7:16: robot.start: at the robot's start, 'pusher' overlaps 'box' by 50 mm",
    ),
    "a goal outside": (
        (("[2.0, 1.0, 0.0]", "[3.0, 1.0, 0.0]"),),
        "s.yaml:9:14: goal.pose: at the goal, 'box' leaves the workspace (x <= 3) by 75 mm",
    ),
    "an unknown object": (
        (("of: box", "of: bix"),),
        "s.yaml:9:35: goal.of: no object is called 'bix'; did you mean 'box'? allowed: box",
    ),
    "another planner": (
        (("start: [1", "planner: {name: rrt}\nstart: [1"),),
        "s.yaml:8:17: planner.name: is for a single push; multi-push plans have auto only",
    ),
    "a price of arcs": (
        (("start: [1", "planner: {arc_price: 0}\nstart: [1"),),
        "s.yaml:8:11: planner.arc_price: is for a single push; multi-push plans (robot.start) are weighed by what "
        "'pushes' says",
    ),
    "a short approach": (
        (("start: [1", "clearance: 0.1\nstart: [1"),),
        "pushes.approach: is 0.05 m, and the robot keeps 0.1 m from the objects when it drives on; allowed: "
        "at least 0.101",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_told_with_its_place(what: str) -> None:
    changes, expected = WRONG[what]
    assert any(finding.endswith(expected) for finding in findings(*changes)), findings(*changes)
