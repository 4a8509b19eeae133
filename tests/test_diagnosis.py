"""Diagnosis of failures: every cause, no false proof of infeasibility, the nearest path."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import Patch, there
from kinds import WALL
from plans_of import load_plain, plain

import pushplan
from pushplan.geometry import se2
from pushplan.mechanics.chain import Drive
from pushplan.planner import plan
from pushplan.planners.controls import drive_radii, straight_pushes
from pushplan.planners.infeasible import pockets as pocket
from pushplan.planners.infeasible.diagnosis import InfeasibilityMonitor, diagnose, passage_faults
from pushplan.planners.problem import build_problem
from pushplan.plans.diagnosis import CAUSES, Diagnosis
from pushplan.plans.plan import Plan
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.file import (
    example_names,
    example_text,
    load_scenario,
    scenario_from_document,
    scenario_from_text,
)
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.sets.named import stable_set
from pushplan.util.arrays import FloatArray


def gap(top: float) -> Scenario:
    """Return the example narrow-gap, whose gap begins at y = 1.07, with another end of the gap."""
    return plain(scenario_from_text(example_text("narrow-gap").replace("1.33", f"{top}"), "gap.yaml"))


def short(scenario: Scenario, planner: str = "auto") -> Plan:
    result = plan(scenario, planner=planner, time_limit=60.0, iterations=600)
    assert not result.solved
    assert {item.cause for item in result.diagnosis} <= set(CAUSES)
    return result


def faults(scenario: Scenario) -> list[Diagnosis]:
    segments = build_problem(scenario, stable_set(scenario.chain)).segments
    steps = list(passage_faults(scenario, straight_pushes(segments)))
    return steps[-1] if steps else []


def diagnosed(scenario: Scenario, segments: FloatArray) -> tuple[Diagnosis, ...]:
    """Return the diagnosis of a scenario with control segments (k, 6)."""
    stable = stable_set(scenario.chain)
    problem = build_problem(scenario, stable).with_segments(segments)
    return diagnose(InfeasibilityMonitor(scenario, stable, lambda: problem), 1234, (0.25, 0.5))


def test_a_time_limit_used_up_by_preparation_is_reported() -> None:
    """A search without iterations reports no nearest path."""
    scenario = plain(load_scenario("two-crates"))
    stable = stable_set(scenario.chain)
    monitor = InfeasibilityMonitor(scenario, stable, lambda: build_problem(scenario, stable))
    (told,) = diagnose(monitor, 0, (2.0, 0.5), 0.0)
    assert told.text == "no reason was found: preparing the search took all of the time; more time may help"


def test_walls_all_around_are_proven_to_block_every_path() -> None:
    result = short(plain(scenario_from_text(WALL)))
    assert result.reason == "the chain cannot pass: obstacles and walls close every way from start to goal"
    (found,) = result.diagnosis
    assert (found.cause, found.proven) == ("gap", True)


def test_a_gap_narrower_than_a_disc_in_the_chain_is_proven() -> None:
    """The boxes are 0.16 m wide and 0.24 m long together: the largest disc in them has that diameter."""
    result = short(gap(1.20))
    (found,) = result.diagnosis
    assert (found.cause, found.proven) == ("gap", True)
    assert found.numbers["passage"] == pytest.approx(0.13, abs=2e-5)
    assert found.numbers["disc"] == pytest.approx(0.16, abs=1e-4)


def test_a_gap_narrower_than_the_plate_is_reported_as_perhaps_too_narrow() -> None:
    result = short(gap(1.26))
    first, last = result.diagnosis
    assert (first.cause, first.proven, last.cause) == ("gap", False, "time")
    assert first.text.startswith("perhaps the passage is too narrow: the widest one from start to goal is about 190")
    assert last.text.startswith("a path may still exist: ")


def test_a_passage_that_is_used_is_never_called_too_narrow() -> None:
    for name in example_names():
        assert [item for item in faults(load_plain(name)) if item.proven] == []
    scenario = gap(1.29)
    result = plan(scenario, time_limit=60.0, first=True)
    assert result.solved
    assert result.diagnosis == ()
    assert faults(scenario) == []


def test_another_heading_without_turns_is_proven_impossible() -> None:
    scenario = load_plain("narrow-gap")
    (found,) = diagnosed(scenario, np.array([[1.0, 0.1, 0.0, 1.0, -0.1, 0.0]]))
    assert (found.cause, found.proven) == ("heading", True)
    assert "it needs a turn of -40 deg" in found.text


def test_a_goal_beside_straight_pushes_is_proven_impossible_without_turns() -> None:
    scenario = load_plain("narrow-gap")
    cone = there(stable_set(scenario.chain).translation_cone(0.0))
    edge = float(np.arctan2(cone[1, 1], cone[1, 0]))
    segments = np.array([[1.0, 0.1, 0.0, 1.0, -0.1, 0.0]])
    for direction, expected in ((1.05 * edge, ["direction"]), (0.95 * edge, [])):
        away = 0.5 * np.array([np.cos(direction), np.sin(direction), 0.0])
        goal = replace(scenario.goal, pose_chain=scenario.start + away)
        found = diagnosed(replace(scenario.with_goal(goal), obstacles=()), segments)
        assert [item.cause for item in found if item.proven] == expected
        words = f"straight pushes go {np.degrees(-edge):.4g} to {np.degrees(edge):.4g} deg"
        assert [words in item.text for item in found if item.proven] == [True] * len(expected)


@pytest.mark.parametrize(("end", "x", "text"), [
    ("start", 0.243, "none of 300 pushes tried leads farther from the start than "),
    ("goal", -0.033 - 0.02, "none of 300 pushes tried leads to the goal from farther away than "),
])  # fmt: skip
def test_an_obstacle_close_to_start_or_goal_is_reported_as_perhaps_boxing_in(
    end: str, x: float, text: str, monkeypatch: Patch
) -> None:
    """A bar before the front box at the start, or behind the plate at the goal; a closer search proves it."""
    scenario = load_plain("narrow-gap")
    pose = scenario.start if end == "start" else scenario.goal.pose_chain
    bar = np.array([[x, -0.3], [x + 0.02, -0.3], [x + 0.02, 0.3], [x, 0.3]])
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turned = bar @ np.array([[c, s], [-s, c]]) + pose[:2]
    barred = replace(scenario, obstacles=(PolygonObstacle(turned),))
    unsolved = short(barred)
    (proven,) = unsolved.diagnosis
    assert f"in the way: {barred.obstacles[0]}" in unsolved.why_not
    assert (proven.cause, proven.proven, [*proven.numbers]) == ("boxed in", True, [f"radius_around_{end}"])
    assert proven.blocking == (0,)
    monkeypatch.setattr(pocket, "LOOKS", ())
    result = short(barred)
    boxed = [item for item in result.diagnosis if item.cause == "boxed in"]
    assert len(boxed) == 1
    assert boxed[0].text.startswith(f"perhaps the {end} is boxed in: {text}")
    assert 0.0 < boxed[0].numbers[f"free_from_{end}"] < 0.02
    assert not boxed[0].proven
    assert boxed[0].blocking == (0,)


DRIVES = {
    "differential": {"differential": {"axle": [-0.4, 0.0, 0.0]}},
    "car": {"car": {"axle": [-0.4, 0.0, 0.0], "min_radius": 0.5}},
}


def _room(drive: str, goal: tuple[float, float, float]) -> Scenario:
    return build_scenario(
        "wide",
        [box("a", 0.2, 0.3, 1.0), box("b", 0.2, 0.3, 1.0)],
        plate(0.4, 0.5, thickness=0.03, drive=DRIVES[drive]),
        goal,
        floor_friction=0.3,
        contact_friction=0.3,
        start=(1.0, 1.0, 0.0),
        workspace={"x": [0.0, 12.0], "y": [0.0, 7.0]},
    )


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("goal", [(9.0, 5.0, np.pi / 2), (1.5, 3.5, np.pi / 2)])
def test_wide_turns_find_a_path(drive: str, goal: tuple[float, float, float]) -> None:
    assert pushplan.plan(_room(drive, goal), first=True, time_limit=60.0).solved


def test_a_goal_beside_the_wall_is_proven_out_of_reach_because_of_the_drive() -> None:
    result = pushplan.plan(_room("car", (2.0, 5.0, 0.0)), time_limit=600.0)  # the search ends with the proof
    assert not result.solved
    (found,) = result.diagnosis
    assert (found.cause, found.proven) == ("boxed in", True)
    assert "the tightest turn that the car drive can make has a radius of 2.38 m (without" in found.text
    assert re.search(r"without the drive: [\d.]+ m; with the axle at the contact: [\d.]+ m\)", found.text)


TURNING = (
    Drive("differential", np.array([-0.45, 0.0, 0.0])),
    Drive("differential", np.array([-0.3, 0.1, 0.1])),
    Drive("differential", np.array([0.9, 0.0, 0.0])),
    Drive("car", np.array([-0.45, 0.0, 0.0]), 5.0),
)


@pytest.fixture(scope="module")
def carts() -> Scenario:
    return load_scenario("carts").with_margin(0.02)


@pytest.mark.parametrize("drive", TURNING)
@pytest.mark.parametrize("margin", [0.0, 0.03])
def test_no_stable_motion_of_the_axle_turns_tighter(carts: Scenario, drive: Drive, margin: float) -> None:
    """An axle that rolls ahead has its centre of rotation beside it, at a signed distance 1 / turn."""
    stable = stable_set(carts.chain)
    radii = drive_radii(stable, drive, margin)
    beside = np.concatenate([np.geomspace(1e-2, 1e3, 40_000), -np.geomspace(1e-2, 1e3, 40_000)])
    beside = beside[np.abs(beside) >= drive.min_radius]
    centers = se2.transform_points(there(drive.axle), np.column_stack([np.zeros_like(beside), beside]))
    turn = np.sign(beside)
    twists = turn[:, None] * np.column_stack([centers[:, 1], -centers[:, 0], np.ones_like(beside)])
    allowed = stable.margin(twists) > margin
    reach = np.hypot(*centers.T)
    for radius, side in ((radii.left, turn > 0.0), (radii.right, turn < 0.0)):
        assert radius == pytest.approx(np.min(reach[allowed & side], initial=np.inf), rel=2e-3)
    of_set = stable.turning_radii(margin)
    assert radii.left >= of_set.left * (1.0 - 1e-9)
    assert radii.right >= of_set.right * (1.0 - 1e-9)


def _behind_a_door(width: float, start: float, goal: float, several: bool) -> dict[str, Any]:
    """Return a room divided by a wall with a door, with a box of 0.2 m and a robot of 0.3 m on the left."""
    walls = [[[2.0, y0], [2.1, y0], [2.1, y1], [2.0, y1]] for y0, y1 in ((0, 1.5 - width / 2), (1.5 + width / 2, 3))]
    other = {"name": "other", "shape": {"box": [0.2, 0.2]}, "mass": 1.0, "pose": [1.0, 2.5, 0.0]}
    return {
        "format": "pushplan/1",
        "name": "door",
        "floor": {"friction": 0.3},
        "objects": [{"name": "box", "shape": {"box": [0.2, 0.2]}, "mass": 1.0, "pose": [start, 1.5, 0.0]}]
        + [other] * several,
        "goals": {"box": [goal, 1.5, 0.0]} | ({"other": [0.5, 2.5, 0.0]} if several else {}),
        "contacts": {"friction": 0.5},
        "pusher": {"width": 0.3, "friction": 0.5},
        "robot": {"footprint": {"box": [0.3, 0.3], "pose": [-0.18, 0.0, 0.0]}, "start": [0.4, 0.7, 0.0]},
        "workspace": {"x": [0.0, 4.0], "y": [0.0, 3.0]},
        "obstacles": [{"polygon": wall} for wall in walls],
        "clearance": 0.02,
    }


@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize(
    ("width", "start", "goal", "reason"),
    [
        (0.18, 1.0, 3.2, "'box' cannot pass: the widest passage from start to goal is 180 mm wide, and 'box' needs"),
        (0.25, 1.0, 3.2, "the robot cannot pass: the widest passage to the goal of 'box' is 250 mm wide, and the"),
        (0.25, 3.0, 1.0, "the robot cannot pass: the widest passage to"),
        (0.0, 1.0, 3.2, "'box' cannot pass: obstacles and walls close every way from start to goal"),
        (0.40, 1.0, 3.2, ""),
    ],
)
def test_a_door_too_narrow_for_an_object_or_the_robot_is_reported_with_its_width(
    width: float, start: float, goal: float, reason: str, several: bool
) -> None:
    scenario = scenario_from_document(_behind_a_door(width, start, goal, several))
    found = plan(scenario, seed=1, iterations=40, time_limit=600.0, first=True)
    assert reason in found.reason
    assert found.solved == (not reason)
    if reason:
        assert found.blocking == {0, 1}
    if reason and several:
        assert list(found.undelivered) == ["box"]
