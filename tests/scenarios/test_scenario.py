"""A scenario as a whole: defaults, resolution, round trips, packaged ones, stable sets, any mutation."""

import json
from pathlib import Path
from random import Random

import mutators
import numpy as np
import pytest
from scenarios.conftest import Changed

from pushplan.errors import ScenarioError
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, UniformSupport, UnknownSupport
from pushplan.scenario.check import check_scenario
from pushplan.scenario.file import example_names, example_text, load_scenario, scenario_from_text
from pushplan.scenario.model import CircleObstacle, PolygonObstacle, Workspace

SMALLEST = """\
format: pushplan/1
floor: {friction: 0.3}
objects: [{name: box, shape: {box: [0.1, 0.2]}, mass: 1}]
pusher: {width: 0.3, friction: 0.5}
goal: {pose: [1, 0, 0]}
"""


def test_the_documented_example_is_understood(valid: Changed) -> None:
    scenario = valid.scenario(
        ("drive: omnidirectional", "drive: {car: {axle: [-0.3, 0, 10 deg], min_radius: 40 cm}}"),
        ("thickness: 0.03", "thickness: 3 cm\n  contact_height: 25 mm\n  limits: {speed: 500 mm/s}"),
        ("seed: 1", "seed: 7"),
        ("margin: auto", "margin: 0.05"),
    )
    assert scenario.workspace == Workspace(-0.5, 2.0, -0.5, 2.0)
    triangle, box, circle = scenario.obstacles
    assert isinstance(triangle, PolygonObstacle)
    assert isinstance(box, PolygonObstacle)
    assert isinstance(circle, CircleObstacle)
    np.testing.assert_allclose(box.outline.mean(axis=0), [0.3, 1.0])
    assert np.linalg.norm(box.outline[1] - box.outline[0]) == pytest.approx(0.2)
    assert circle.radius == 0.1
    drive, limits = scenario.chain.pusher.drive, scenario.chain.pusher.limits
    assert (drive.kind, drive.min_radius) == ("car", 0.4)
    assert drive.axle is not None
    np.testing.assert_allclose(drive.axle, [-0.3, 0.0, np.radians(10.0)])
    assert (limits.speed, limits.jerk) == (0.5, 5.0)
    assert scenario.chain.pusher.contact_height == 0.025
    assert scenario.stability.margin == 0.05
    assert scenario.planner.seed == 7


def test_supports_are_what_the_file_says(valid: Changed, tmp_path: Path) -> None:
    (tmp_path / "map.csv").write_text("x,y,pressure\n0.01,0,1\n-0.01,0,3\n")

    def support(text: str) -> object:
        file = tmp_path / "f.yaml"
        file.write_text(valid(("support: uniform", text)))
        return load_scenario(file).chain.objects[0].support

    assert isinstance(support("support: uniform"), UniformSupport)
    affine = support("center_of_mass: [0.01, 0.005]")
    assert isinstance(affine, UniformSupport)
    np.testing.assert_allclose(affine.center, [0.01, 0.005])
    loaded = support("support: {feet: [[0.04, 0.03, 25 %], [-0.04, 0.03, 0.25], [0, -0.03, 0.5]]}")
    assert isinstance(loaded, FeetSupport)
    assert loaded.fractions is not None
    np.testing.assert_allclose(loaded.fractions, [0.25, 0.25, 0.5])
    bare = support("support: {feet: [[0.04, 0.03], [-0.04, 0.03], [0, -0.03]]}")
    assert isinstance(bare, FeetSupport)
    assert not bare.known
    np.testing.assert_allclose(bare.center, [0.0, 0.0], atol=1e-12)
    shifted = support(
        "support: {feet: [[0.04, 0.03], [-0.04, 0.03], [0, -0.03]]}\n    center_of_mass: [0, 1 cm]"
    )
    assert isinstance(shifted, FeetSupport)
    np.testing.assert_allclose(shifted.center, [0.0, 0.01])
    measured = support("support: {pressure_map: map.csv}")
    assert isinstance(measured, PressureMapSupport)
    np.testing.assert_allclose(measured.center, [-0.005, 0.0])
    assert isinstance(support("support: unknown"), UnknownSupport)


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
    for one, other in zip(scenario.chain.contacts, again.chain.contacts, strict=True):
        np.testing.assert_allclose([one.right, one.left], [other.right, other.left], atol=1e-12)
        assert one.friction == other.friction


def test_a_file_comes_before_a_packaged_scenario_of_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one-box").write_text(SMALLEST)
    assert load_scenario("one-box").chain.objects[0].mass == 1.0
    (tmp_path / "one-box").unlink()
    assert load_scenario("one-box").chain.objects[0].mass == 6.0
    with pytest.raises(ScenarioError):
        load_scenario(Path("one-box"))


def test_a_text_and_its_attachments_give_the_scenario_back(valid: Changed, tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(valid(("support: uniform", "support: {pressure_map: map.csv}")))
    (tmp_path / "map.csv").write_text("x,y,pressure\n0,0,1\n")
    scenario = load_scenario(file)
    assert dict(scenario.attachments) == {"map.csv": b"x,y,pressure\n0,0,1\n"}
    assert scenario_from_text(scenario.source, "f.yaml", scenario.attachments) == scenario
    other = {"map.csv": b"x,y,pressure\n0.01,0,1\n"}
    assert scenario_from_text(scenario.source, "f.yaml", other) != scenario


def test_an_empty_stable_set_is_found_at_the_contact_that_makes_it_empty(valid: Changed) -> None:
    assert check_scenario(valid.scenario()) == ()
    slippery = check_scenario(valid.scenario(("friction: 0.20", "friction: 0")))
    assert [finding.where for finding in slippery] == ["contacts"]
    assert slippery[0].what.startswith("the stable set is empty: no push keeps 'far' on 'near' together")
    plate = check_scenario(valid.scenario(("friction: 0.55", "friction: 0")))
    assert [finding.where for finding in plate] == ["pusher.friction"]
    wide = check_scenario(valid.scenario(("margin: auto", "margin: 0.9")))
    assert [finding.where for finding in wide] == ["stability.margin"]
    assert wide[0].what.startswith("no push has a margin above 0.9; the largest is 0.")


def test_any_mutation_of_a_file_is_a_scenario_or_a_located_error(valid: Changed) -> None:
    document = json.loads(valid.scenario().to_json())
    for seed in range(120):
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
