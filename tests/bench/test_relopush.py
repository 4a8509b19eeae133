"""Files of ReloPush in suites: each block is a problem, the others and the walls are in its way.

The instance is the first of `testdata/2o1r` of github.com/fluentrobotics/ReloPush, BSD-3-Clause.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pushplan.bench.suites.file import SuiteError, load_suite
from pushplan.geometry import se2
from pushplan.scenario.model import PolygonObstacle

INSTANCE: dict[str, Any] = {
    "blocks": {"b1": [2.067257, 3.632976, 0.0], "b2": [0.990244, 3.690533, 0.0]},
    "goals": {"d1": [0.014975, 0.021176, 0.0], "d2": [2.950766, 3.674034, 0.0]},
    "assignment": {"b1": "d1", "b2": "d2"},
    "robot": "1.9865706407227604,2.4870516741140825,1.5708",
}
OCCUPIED = {
    **INSTANCE,
    "assignment": {"b1": "d1", "b2": "d3"},
    "goals": {**INSTANCE["goals"], "d3": [2.1, 3.6, 0.0]},
}
SUITE = "format: pushplan-suite/1\nproblems:\n  - {scenario: two.json, format: relopush}\n"


def _suite(folder: Path, instances: list[Any], entry: str = "") -> Path:
    (folder / "two.json").write_text(json.dumps(instances, indent=1))
    path = folder / "suite.yaml"
    path.write_text(SUITE.replace("relopush}", f"relopush{entry}}}"))
    return path


def test_each_block_is_a_problem_with_the_other_in_the_way(tmp_path: Path) -> None:
    suite = load_suite(_suite(tmp_path, [INSTANCE]))
    assert [problem.name for problem in suite.problems] == ["two-1-b1", "two-1-b2"]
    assert {problem.family for problem in suite.problems} == {"two"}
    scenario = suite.problems[0].scenario
    (block,) = scenario.chain.objects
    np.testing.assert_allclose(
        se2.compose(scenario.start, block.pose_chain), INSTANCE["blocks"]["b1"], atol=1e-12
    )
    (other,) = scenario.obstacles
    assert isinstance(other, PolygonObstacle)
    np.testing.assert_allclose(other.outline.mean(axis=0), INSTANCE["blocks"]["b2"][:2], atol=1e-12)
    assert scenario.pushes is not None
    assert len(scenario.pushes.goals) == 4
    away = se2.relative(scenario.pushes.robot_start, [float(word) for word in INSTANCE["robot"].split(",")])
    np.testing.assert_allclose(away, [-0.30, 0.0, 0.0], atol=1e-12)
    assert scenario.chain.pusher.drive.min_radius == 1.008


def test_blocks_whose_goal_is_taken_are_left_out_and_so_are_instances_beyond_the_count(
    tmp_path: Path,
) -> None:
    suite = load_suite(_suite(tmp_path, [OCCUPIED, INSTANCE], ", count: 1, name: mine"))
    assert [problem.name for problem in suite.problems] == ["mine-1-b1"]


def test_strict_walls_are_those_of_the_room(tmp_path: Path) -> None:
    """A goal at the very corner of the room is none there: the block would be in the wall."""
    suite = load_suite(_suite(tmp_path, [INSTANCE], ", walls: strict"))
    assert [problem.name for problem in suite.problems] == ["two-1-b2"]
    area = suite.problems[0].scenario.workspace
    assert area is not None
    assert (area.xmin, area.xmax, area.ymin, area.ymax) == (0.0, 4.0, 0.0, 5.4)


@pytest.mark.parametrize(
    ("instances", "told"),
    [
        (
            [{**INSTANCE, "robot": "1,2"}],
            "two.json:31:12: [0].robot: is the text '1,2'; allowed: a text x,y,theta",
        ),
        ([{**INSTANCE, "blocks": {"b1": [0, 0]}}], "[0].blocks.b1: is a list of 2; allowed: [x, y, theta]"),
        ([{**INSTANCE, "walls": 1}], "[0].walls: unknown key; allowed: blocks, goals, assignment, robot"),
        ([{**INSTANCE, "assignment": {"b1": "d9"}}], "assigns 'b1' to 'd9', one of which is nowhere"),
        ([{}], "[0].blocks: is missing; needed: a mapping from names of blocks"),
        (INSTANCE, "two.json:1:1: "),
    ],
)
def test_what_is_wrong_in_a_file_is_told_with_its_place(tmp_path: Path, instances: Any, told: str) -> None:
    with pytest.raises(SuiteError) as caught:
        load_suite(_suite(tmp_path, instances))
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("{scenario: nowhere.json, format: relopush}", "nowhere.json: cannot read the file"),
        ("{scenario: one-box, walls: strict}", "has walls but no format"),
        ("{scenario: two.json, format: relopush, seed: 3}", "has a format but generates problems"),
        (
            "{scenario: two.json, format: relo}",
            "format: is the text 'relo'; did you mean 'relopush'?",
        ),
    ],
)
def test_what_is_wrong_in_a_suite_is_told(tmp_path: Path, entry: str, told: str) -> None:
    path = tmp_path / "suite.yaml"
    path.write_text(f"format: pushplan-suite/1\nproblems: [{entry}]\n")
    with pytest.raises(SuiteError) as caught:
        load_suite(path)
    assert told in str(caught.value)
