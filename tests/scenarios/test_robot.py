"""The robot and its pushes in a scenario file: poses of its parts, allowed faces, errors."""

import math

import numpy as np
import pytest
import shapely
from conftest import there
from kinds import MULTI
from scenarios.conftest import Changed

from pushplan.scenario.file import scenario_from_document

ROOMY = "  - {circle: 0.1, center: [1.0, 0.2]}\n", ""
"""Text to replace and its replacement: without this obstacle a robot has room at the goal."""


def with_robot(stated: str) -> tuple[str, str]:
    return "start: [0.0, 0.0, 0.0]", f"robot: {stated}\nstart: [0.0, 0.0, 0.0]"


@pytest.mark.parametrize("offset", [0.0, 0.07, -0.055])
def test_poses_are_in_the_plate_frame_for_every_contact_position(valid: Changed, offset: float) -> None:
    """If the first object moves along the plate, the chain frame moves with it; plate and robot stay together."""
    stated = (
        "{footprint: [{polygon: [[0, 0], [0.2, 0], [0, 0.1]], pose: [-0.3, 0.02, 90 deg]}], "
        "drive: {car: {axle: [-0.3, 0.01, 5 deg], min_radius: 1.0}}}"
    )
    changes = (
        ("    support: uniform\n", f"    support: uniform\n    offset: {offset}\n"),
        ("  drive: omnidirectional\n", ""),
    )
    pusher = valid.scenario(with_robot(stated), ROOMY, *changes).chain.pusher
    front = np.array([pusher.outline[:, 0].max(), pusher.outline[:, 1].mean()])
    assert abs(front[1] + offset) < 0.5 * 0.08 + 1e-12
    expected = shapely.Polygon([(-0.3, 0.02), (-0.3, 0.22), (-0.4, 0.02)])
    assert shapely.Polygon(pusher.footprint[0] - front).symmetric_difference(expected).area < 1e-15
    assert (pusher.drive.kind, pusher.drive.min_radius) == ("car", 1.0)
    np.testing.assert_allclose(
        there(pusher.drive.axle), [front[0] - 0.3, front[1] + 0.01, np.radians(5.0)], atol=1e-15
    )


@pytest.mark.parametrize("stated", [
    "{footprint: {box: [0.42, 0.285], pose: [-0.21, 0, 0]}}",
    "{footprint: [{polygon: [[-0.03, -0.1], [-0.3, -0.1], [-0.2, 0], [-0.3, 0.1], [-0.03, 0.1]]}, "
    "{box: [0.1, 0.1], pose: [-0.4, 0, 0.3]}], drive: {differential: {axle: [-0.3, 0, 0]}}}",
    "{drive: omnidirectional}",
    "{}",
])  # fmt: skip
def test_a_resolved_scenario_is_the_same_scenario(valid: Changed, stated: str) -> None:
    scenario = valid.scenario(with_robot(stated), ROOMY, ("  drive: omnidirectional\n", ""))
    again = scenario_from_document(scenario.resolved())
    assert again == scenario
    for one, other in zip(scenario.chain.bodies, again.chain.bodies, strict=True):
        np.testing.assert_allclose(one.outline, other.outline, atol=1e-12)


BEHIND = Changed(MULTI)


def test_symmetry_turns_the_goal_about_its_object() -> None:
    goals = BEHIND.scenario(("of: box}", "of: box, symmetry: 4}")).goals["box"]
    assert [round(math.degrees(goal.pose[2])) % 360 for goal in goals] == [0, 90, 180, 270]
    for goal in goals:
        ahead = 0.1 * np.array([math.cos(goal.pose[2]), math.sin(goal.pose[2])])
        np.testing.assert_allclose(goal.pose_chain[:2] + ahead, [0.6, 0.4], atol=1e-12)


def test_a_default_approach_is_longer_than_the_clearance() -> None:
    task = BEHIND.scenario(("name: box", "clearance: 0.1")).transport
    assert task.approach == task.retreat == pytest.approx(0.101)


WRONG = """\
of: box} | of: box, symmetry: 4} | 7:40: goal.symmetry: is for multi-push plans only: it needs a robot.start,
friction: 0.5} | friction: 0.5, faces: all} | 5:37: pusher.faces: is for multi-push plans only: it needs a robot.start
friction: 0.5} | friction: 0.5, faces: [behind]} | faces[0]: is the text 'behind'; allowed: rear, front, left, right,
[-0.5, 0.0, 0.0]} | [-3.0, 0.0, 0.0]} | 6:16: robot.start: at the robot's start, 'pusher' leaves the workspace (x
[-0.5, 0.0, 0.0]} | [0.05, 0.0, 0.0]} | 6:16: robot.start: at the robot's start, 'pusher' overlaps 'box' by 50 mm
[0.6, 0.4, 0.0] | [6.0, 0.4, 0.0] | 8:14: goal.pose: at the goal, 'box' leaves the workspace (x <= 6) by 100 mm
of: box | of: bix | 8:35: goal.of: no object is called 'bix'; did you mean 'box'? allowed: box
name: box | planner: {name: rrt} | planner.name: is only for a single push; allowed for multi-push plans: auto
name: box | pushes: {most: 0} | pushes.most: is 0; allowed: a whole number from 1 to 100
name: box | clearance: 0.1\\npushes: {approach: 0.05} | pushes.approach: is 0.05 m, but the robot keeps 0.1 m from the
"""
"""Text of the file, its replacement, and the error; a missing start of the robot is an error of its own."""


@pytest.mark.parametrize("row", WRONG.splitlines())
def test_errors_are_reported_with_their_places(row: str) -> None:
    old, new, expected = row.replace("\\n", "\n").split(" | ")
    without = [("robot: {start: [-0.5, 0.0, 0.0]}\n", "")] if "needs a robot.start" in expected else []
    found = BEHIND.findings((old, new), *without)
    assert any(expected in finding for finding in found), found
