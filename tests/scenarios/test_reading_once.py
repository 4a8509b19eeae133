"""A scenario file is read once, and reading needs no compiled code."""

import subprocess
import sys
from pathlib import Path

import pytest

import pushplan
from pushplan.scenario import source
from pushplan.scenario.check import check_scenario, questions

REARRANGEMENT = """\
format: pushplan/1
floor: {friction: 0.30}
objects:
  - {name: red, shape: {box: [0.30, 0.20]}, mass: 4.0, pose: [1.2, 1.0, 0.0]}
  - {name: blue, shape: {box: [0.20, 0.20]}, mass: 3.0, pose: [1.2, 2.2, 90 deg], support: unknown}
pusher: {width: 0.28, friction: 0.50, limits: {speed: 9}}
robot: {start: [2.4, 1.6, 0.0]}
goals: {red: [2.0, 2.0, 0.0]}
stability: {set: ecof}
"""


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The texts that were parsed."""
    texts: list[str] = []
    decoded = source._decoded

    def noted(data: bytes) -> str:
        texts.append(decoded(data))
        return texts[-1]

    monkeypatch.setattr(source, "_decoded", noted)
    return texts


def test_reading_checking_and_asking_parse_a_file_once(tmp_path: Path, parsed: list[str]) -> None:
    file = tmp_path / "two.yaml"
    file.write_text(REARRANGEMENT)
    scenario = pushplan.load_scenario(file)
    assert scenario.origin is not None
    (question,) = questions(scenario.origin)
    assert (question.where, question.line, question.column) == ("pusher.limits.speed", 6, 55)
    (finding,) = check_scenario(scenario.alone("blue"))
    assert finding.where == "stability.set"
    assert check_scenario(scenario.alone("red")) == ()
    assert parsed == [REARRANGEMENT]


def test_loading_a_scenario_loads_no_planner() -> None:
    words = (
        "import sys, pushplan.scenario.file as f; f.load_scenario('two-crates'); print('ompl' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
