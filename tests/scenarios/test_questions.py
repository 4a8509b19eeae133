"""Numbers that a file may state but hardly means are asked about; with a unit they never are."""

from pathlib import Path

import pytest

from pushplan.errors import ScenarioError
from pushplan.scenario.check import questions
from pushplan.scenario.file import load_scenario
from pushplan.scenario.source import Source

IN_MILLIMETRES = """\
format: pushplan/1
name: mm
floor: {friction: 0.30}
objects:
  - {name: near, shape: {box: [120, 80]}, mass: 1.2}
  - {name: far, shape: {polygon: [[-50, -40], [50, -40], [50, 40], [-50, 40]]}, mass: 0.8}
contacts: {friction: 0.5}
pusher: {width: 200, thickness: 30, friction: 0.50, limits: {speed: 200}}
start: [0, 0, 0]
goal: {pose: [3000, 1000, 5]}
workspace: {x: [-0.5, 4], y: [-0.5, 2]}
"""
SMALL = "[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]"


def asked(text: str) -> list[str]:
    return [question.text("f.yaml") for question in questions(Source(text.encode()))]


def test_what_follows_from_millimetres_is_one_finding(tmp_path: Path) -> None:
    file = tmp_path / "mm.yaml"
    file.write_text(IN_MILLIMETRES)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    (finding,) = caught.value.findings
    assert (finding.where, finding.line, finding.column) == ("objects[0].shape.box", 5, 31)
    assert 'is 120 m long: mm? plain numbers are m; write "120 mm"' in finding.what
    assert "more error" in finding.what


@pytest.mark.parametrize(
    ("pusher", "question"),
    [
        ("limits: {speed: 30}", "pusher.limits.speed: is 30 m/s: mm/s?"),
        ("limits: {speed: 1.0e-4}", "pusher.limits.speed: is 0.1 mm/s: m/s?"),
        ("drive: {differential: {axle: [-350, 0, 0]}}", "axle[0]: is -350 m from the plate: mm?"),
        ("drive: {differential: {axle: [-0.35, 0, 0]}}, limits: {speed: 30 m/s}", ""),
    ],
)
def test_speeds_and_axles_are_asked_about(pusher: str, question: str) -> None:
    text = IN_MILLIMETRES.replace("[3000, 1000, 5]", "[3, 1, 0]").replace("[120, 80]", "[0.12, 0.08]")
    text = text.replace("[-50, -40], [50, -40], [50, 40], [-50, 40]", SMALL)
    found = asked(text.replace("limits: {speed: 200}", pusher))
    assert len(found) == bool(question)
    assert question in "".join(found)
