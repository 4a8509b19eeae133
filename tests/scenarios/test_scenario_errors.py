"""Everything wrong in a scenario is told with its place, what is wrong, and what is allowed."""

from pathlib import Path

import pytest
from scenarios.conftest import Changed

from pushplan.errors import ScenarioError
from pushplan.scenario.file import load_scenario
from pushplan.util import names

MASS = 'a mass in kg from 1e-06 to 1000000, or with a unit, e.g. "800 g"'
SETS = "one of ecof, cof, translation, stable, robust"


def mistakes() -> list[tuple[str, str, str]]:
    """Return what is replaced in the valid scenario, by what, and the finding that this gives."""
    text = Path(__file__).with_name("mistakes.txt").read_text(encoding="utf-8")
    blocks = [block.splitlines() for block in text.split("\n\n")[1:]]
    sides = [["\n".join(line[1:] for line in block if line[0] == sign) for sign in "-+"] for block in blocks]
    return [(old, new, block[-1]) for (old, new), block in zip(sides, blocks, strict=True)]


@pytest.mark.parametrize(("old", "new", "finding"), mistakes())
def test_one_mistake_gives_one_finding(valid: Changed, old: str, new: str, finding: str) -> None:
    (found,) = valid.findings((old, new))
    assert found.startswith(finding)


def test_findings_of_all_stages_are_told_at_once_in_the_order_of_the_file(valid: Changed) -> None:
    changes = [
        ("friction: 0.30", "friction: 0.30, colour: grey"),
        ("mass: 1.2", "mass: -1.2"),
        ("offset: 0.01", "pose: [0.1468, 0, 0]"),
        ("start: [0.0, 0.0, 0.0]", "start: [-1.0, 0.0, 0.0]"),
        ("of: far", "of: nowhere"),
        ("margin: auto", "margin: &m auto"),
        ("seed: 1", "seed: one"),
    ]
    assert valid.findings(*changes) == [
        "f.yaml:3:25: floor.colour: unknown key; allowed: friction",
        f"f.yaml:7:11: objects[0].mass: is -1.2; allowed: {MASS}",
        "f.yaml:9:5: objects[1]: 'far' overlaps 'near' by 3.2 mm; move them apart",
        "f.yaml:24:7: goal.of: no object is called 'nowhere'; allowed: near, far",
        "f.yaml:31:32: stability.margin: anchors (&m) are not supported; leave it out",
        "f.yaml:32:45: planner.seed: is the text 'one'; allowed: a whole number from 0 to 2147483647",
    ]


def test_a_planner_that_went_to_the_benchmarks_is_told_with_its_replacement(
    valid: Changed, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(names, "PLANNERS", ("rrt", "auto"))
    (found,) = valid.findings(("name: rrt,", "name: rrt-dubins,"))
    assert found.startswith(
        "f.yaml:32:17: planner.name: is 'rrt-dubins', a baseline that is in the benchmarks now;"
    )
    assert "allowed: auto" in found


def test_start_and_goal_are_checked_beside_wrong_values(valid: Changed) -> None:
    found = valid.findings(
        ("start: [0.0, 0.0, 0.0]", "start: [-0.48, 0, 0]"),
        ("set: ecof", "set: all"),
        ("mass: 0.8", "mass: 0"),
    )
    assert found == [
        f"f.yaml:11:11: objects[1].mass: is 0; allowed: {MASS}",
        "f.yaml:21:8: start: at the start, 'pusher' leaves the workspace (x >= -0.5) by 10 mm",
        f"f.yaml:31:18: stability.set: is the text 'all'; allowed: {SETS}",
    ]


def test_a_file_that_cannot_be_read_says_why(tmp_path: Path) -> None:
    for path, reason in ((tmp_path / "none.yaml", "No such file or directory"), (tmp_path, "Is a directory")):
        with pytest.raises(ScenarioError) as caught:
            load_scenario(path)
        assert str(caught.value) == f"{path}: cannot read the file: {reason}"


def test_a_name_that_is_no_file_is_held_against_the_packaged_ones() -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("two_crates")
    expected = (
        "two_crates: cannot read the file: No such file or directory; no packaged scenario is called so either; "
        "did you mean 'two-crates'? there are asymmetric, carts, "
    )
    assert str(caught.value).startswith(expected)


def test_a_pressure_map_stays_in_the_folder_of_the_scenario(valid: Changed, tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    (tmp_path / "secret.csv").write_text("x,y,pressure\n0,0,1\n")
    (tmp_path / "inside" / "link.csv").symlink_to(tmp_path / "secret.csv")
    file = tmp_path / "inside" / "f.yaml"
    for name in ("../secret.csv", str(tmp_path / "secret.csv"), "link.csv"):
        file.write_text(valid(("support: uniform", f"support: {{pressure_map: '{name}'}}")))
        with pytest.raises(ScenarioError) as caught:
            load_scenario(file)
        assert [f.text("f.yaml") for f in caught.value.findings] == [
            f"f.yaml:8:14: objects[0].support: is the name '{name if len(name) < 41 else name[:37] + '...'}'; "
            "allowed: a file in the scenario's folder"
        ]
