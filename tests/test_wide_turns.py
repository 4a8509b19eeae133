"""Drives that turn wide: a goal that is out of reach is proven to be, and the drive's radius is blamed."""

import pytest

import pushplan
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario

ROOM = """
format: pushplan/1
name: wide
floor: {{friction: 0.3}}
objects:
  - {{name: a, shape: {{box: [0.2, 0.3]}}, mass: 1.0}}
  - {{name: b, shape: {{box: [0.2, 0.3]}}, mass: 1.0}}
contacts: {{friction: 0.3}}
pusher: {{width: 0.4, thickness: 0.03, friction: 0.5, drive: {drive}}}
start: [1.0, 1.0, 0.0]
goal: {{pose: {goal}}}
workspace: {{x: [0, 12], y: [0, 7]}}
"""
DRIVES = {
    "differential": "{differential: {axle: [-0.4, 0, 0]}}",
    "car": "{car: {axle: [-0.4, 0, 0], min_radius: 0.5}}",
}


def _room(drive: str, goal: str) -> Scenario:
    return scenario_from_text(ROOM.format(drive=DRIVES.get(drive, drive), goal=goal), "wide")


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("goal", ["[9, 5, 90 deg]", "[1.5, 3.5, 90 deg]"])
def test_wide_turns_find_their_way(drive: str, goal: str) -> None:
    assert pushplan.plan(_room(drive, goal), first=True, time_limit=60.0).solved


@pytest.mark.parametrize("drive", ["car"])
def test_a_goal_beside_the_wall_is_proven_out_of_reach_and_the_drive_is_to_blame(drive: str) -> None:
    result = pushplan.plan(_room(drive, "[2, 5, 0]"), time_limit=600.0)  # it ends with the proof
    assert not result.solved
    (found,) = result.diagnosis
    assert (found.cause, found.proven) == ("boxed in", True)
    assert f"the tightest turn that the {drive} drive can make has a radius of 2.38 m (without" in found.text


def test_without_the_drive_it_is_in_reach() -> None:
    assert pushplan.plan(_room("omnidirectional", "[2, 5, 0]"), first=True).solved
