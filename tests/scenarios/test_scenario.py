"""A scenario as a whole: defaults, resolution, round trips, packaged ones, thousands of obstacles, random
mutations.
"""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import mutators
import numpy as np
import pytest
from conftest import calls_of, there
from kinds import MULTI
from scenarios.conftest import Changed

from pushplan.errors import ScenarioError
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport, UnknownSupport
from pushplan.scenario.builders import box, build_scenario, plate, polygon
from pushplan.scenario.check import check_scenario, questions
from pushplan.scenario.file import example_names, example_text, load_scenario, scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle, PolygonObstacle
from pushplan.scenario.room import MOST_LISTED

FEET = "support: {feet: [[0.04, 0.03], [-0.04, 0.03], [0, -0.03]]}"


@pytest.mark.parametrize(("text", "kind", "center", "known"), [
    ("support: uniform", UniformSupport, [0.0, 0.0], True), ("support: unknown", UnknownSupport, [0.0, 0.0], False),
    ("center_of_mass: [0.01, 0.005]", UniformSupport, [0.01, 0.005], True),
    ("support: {feet: [[0.04, 0.03, 25 %], [-0.04, 0.03, .55], [0, -0.03, .2]]}", FeetSupport, [-0.012, 0.018], True),
    (FEET, FeetSupport, [0.0, 0.0], False),
    (f"{FEET}\n    center_of_mass: [0, 1 cm]", FeetSupport, [0.0, 0.01], False),
    ("support: {pressure_map: map.csv}", PressureMapSupport, [-0.005, 0.0], True),
])  # fmt: skip
def test_supports_are_what_the_file_says(
    text: str, kind: type, center: list[float], known: bool, valid: Changed, tmp_path: Path
) -> None:
    (tmp_path / "map.csv").write_text("x,y,pressure\n0.01,0,1\n-0.01,0,3\n")
    (tmp_path / "f.yaml").write_text(valid(("support: uniform", text)))
    support = load_scenario(tmp_path / "f.yaml").chain.objects[0].support
    assert (type(support), support.known) == (kind, known)
    np.testing.assert_allclose(support.center, center, atol=1e-12)


@pytest.mark.parametrize("name", example_names())
def test_packaged_scenarios_load_and_resolve_to_themselves(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert example_text(name).startswith("# ")
    assert scenario_from_text(scenario.source, scenario.path) == scenario
    resolved = json.loads(scenario.to_json())
    again = scenario_from_text(scenario.to_json())
    assert again == scenario
    assert again.resolved() == resolved == scenario.resolved()


def test_reading_and_checking_parse_a_file_once(tmp_path: Path) -> None:
    (tmp_path / "crates.yaml").write_text(example_text("two-crates"))

    def work() -> None:
        scenario = load_scenario(tmp_path / "crates.yaml")
        assert (check_scenario(scenario), questions(there(scenario.origin))) == ((), ())
        assert scenario.resolved()["name"] == "two-crates"

    assert calls_of(work, "_Parser.document") == 1


def test_an_empty_stable_set_is_found_at_the_contact_that_makes_it_empty(valid: Changed) -> None:
    assert check_scenario(valid.scenario()) == ()
    (unknown,) = check_scenario(valid.scenario(("support: uniform", "support: unknown")))
    assert (unknown.where, unknown.line) == ("stability.set", 31)
    slippery = check_scenario(valid.scenario(("friction: 0.20", "friction: 0")))
    assert [finding.where for finding in slippery] == ["contacts"]
    assert slippery[0].what.startswith("the stable set is empty: no push keeps the contact of 'far' on 'near'")
    plate = check_scenario(valid.scenario(("friction: 0.55", "friction: 0")))
    assert [finding.where for finding in plate] == ["pusher.friction"]
    assert "(the largest margin is 0)" in plate[0].what
    wide = check_scenario(valid.scenario(("margin: auto", "margin: 0.9")))
    assert [finding.where for finding in wide] == ["stability.margin"]
    assert wide[0].what.startswith("no push has a margin above 0.9; allowed: less than 0.")


def test_any_mutated_file_gives_a_scenario_or_an_error_with_a_place(valid: Changed) -> None:
    document = json.loads(valid.scenario().to_json())
    for seed in range(60):
        assert_reads_or_refuses(mutators.mutated_text(valid(), Random(seed)))
        assert_reads_or_refuses(json.dumps(mutators.mutated_document(document, Random(seed))))


def assert_reads_or_refuses(text: str) -> None:
    try:
        scenario = scenario_from_text(text, "f.yaml")
    except ScenarioError as error:
        findings = error.findings
    else:
        assert scenario_from_text(scenario.to_json()) == scenario
        return
    assert findings
    for finding in findings:
        assert finding.line is not None
        assert finding.text("f.yaml").isprintable()


# Thousands of obstacles: files load or are refused with work that grows linearly (counted without a clock).

HEAD = """\
format: pushplan/1
name: many
floor: {friction: 0.35}
objects: [{name: box, shape: {box: [0.3, 0.4]}, mass: 6.0}]
pusher: {width: 0.5, friction: 0.5}
goal: {pose: [2.2, 1.2, 60 deg]}
obstacles:
"""
FORMS = {
    "circle": "  - {{circle: 0.05, center: [{x:.4f}, {y:.4f}]}}\n",
    "box": "  - {{box: [0.05, 0.04], pose: [{x:.4f}, {y:.4f}, 10 deg]}}\n",
    "polygon": "  - {{polygon: [[{x:.4f}, {y:.4f}], [{u:.4f}, {y:.4f}], [{x:.4f}, {v:.4f}]]}}\n",
}


def _text(form: str, count: int, spacing: float, begin: float) -> str:
    """Return a scenario with obstacles in rows of a hundred."""
    places = [(begin + spacing * (i % 100), begin + spacing * (i // 100)) for i in range(count)]
    return HEAD + "".join(FORMS[form].format(x=x, y=y, u=x + 0.05, v=y + 0.05) for x, y in places)


def _free(form: str, count: int) -> str:
    return _text(form, count, 0.2, 5.0)


def _met(form: str, count: int) -> str:
    """Return a scenario whose box overlaps every obstacle at the start."""
    return _text(form, count, 1e-4, 0.1)


def _refusal(text: str) -> ScenarioError:
    with pytest.raises(ScenarioError) as caught:
        scenario_from_text(text)
    return caught.value


@pytest.mark.parametrize("form", FORMS)
def test_a_body_among_thousands_of_obstacles_gives_few_errors(form: str) -> None:
    """A user does not read thousands of lines."""
    findings = [finding.what for finding in _refusal(_met(form, 600)).findings]
    near = [what for what in findings if "'box'" in what]
    assert 2 <= len(near) <= MOST_LISTED + 1  # obstacles at the same place give the same sentence
    assert near[0].startswith("at the start, 'box' overlaps the obstacle at (")
    assert near[-1] == (f"at the start, 'box' is too near to more obstacles; only the first {MOST_LISTED} are listed")


@pytest.mark.parametrize(("form", "make"), [("circle", _free), ("polygon", _met)])
def test_work_grows_linearly_with_the_file(form: str, make: Callable[[str, int], str]) -> None:
    few, many = (calls_of(partial(scenario_from_text, make(form, count))) for count in (100, 200))
    assert many < 2.2 * few


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


@pytest.mark.parametrize(
    ("bare", "stated"),
    [
        ("[1, 0.2, 5 deg]", "{pose: [1, 0.2, 5 deg]}"),
        ("[[1, 0.2, 5 deg], {pose: [1, 1, 0], of: box}]", "[{pose: [1, 0.2, 5 deg]}, {pose: [1, 1, 0], of: box}]"),
    ],
)
def test_a_goal_can_be_a_pose_alone(bare: str, stated: str) -> None:
    goal = "{pose: [0.6, 0.4, 0.0], of: box}"
    assert scenario_from_text(MULTI.replace(goal, bare)) == scenario_from_text(MULTI.replace(goal, stated))
    with pytest.raises(ScenarioError, match=r"goal: is a list of 2; allowed: \[x, y, theta\]"):
        scenario_from_text(MULTI.replace(goal, "[1, 2]"))


def test_all_errors_are_reported_at_once_by_place() -> None:
    with pytest.raises(ScenarioError) as caught:
        _row(objects=[box("a", -0.1, 0.08, 1.2)], goal=(0.0, np.nan, 0.0), widht=3)
    places = {finding.where for finding in caught.value.findings}
    assert places == {"objects[0].shape.box[0]", "goal.pose[1]", "widht"}
    assert all(finding.line is None for finding in caught.value.findings)
    assert str(caught.value).startswith("row.json: objects[0].shape.box[0]: is -0.1; allowed: a length")


def test_a_pressure_map_is_attached() -> None:
    table = b"x,y,pressure\n0.01,0,1\n-0.01,0,1\n"
    bodies = [box("a", 0.1, 0.08, 1.2, support={"pressure_map": "map.csv"})]
    scenario = _row(objects=bodies, of="a", attachments={"map.csv": table})
    assert scenario.attachments == {"map.csv": table}
    with pytest.raises(ScenarioError, match=r"'map.csv' is not attached"):
        _row(objects=bodies, of="a")
