"""`--physics` of `plan` and `replay`: what is executed, what is refused, and the exit code."""

import json
from pathlib import Path

import pytest

from pushplan.cli.main import main

SCENARIO = """\
format: pushplan/1
floor: {{friction: 0.3}}
objects:
  - {{name: box, shape: {{box: [0.1, 0.1]}}, mass: 1.0, {support}}}
pusher:
  width: 0.2
  friction: 0.5
  limits: {{speed: 0.8, acceleration: {acceleration}, jerk: 1000, contact: quasi-static}}
goal: {{pose: [{goal}, 0, 0]}}
stability: {{margin: 0}}
"""
FEET = "support: {feet: [[-0.04, -0.04, 0.25], [0.04, -0.04, 0.25], [0.04, 0.04, 0.25], [-0.04, 0.04, 0.25]]}"


@pytest.fixture
def _engine() -> None:
    pytest.importorskip("mujoco", reason="MuJoCo is not installed; the extra pushplan[physics] brings it")


def written(folder: Path, support: str = FEET, acceleration: float = 0.5, goal: float = 0.2) -> str:
    path = folder / "scenario.yaml"
    path.write_text(SCENARIO.format(support=support, acceleration=acceleration, goal=goal), "utf-8")
    return str(path)


@pytest.mark.usefixtures("_engine")
def test_a_gentle_push_holds_in_plan_and_in_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(tmp_path / "run.mcap")
    assert main(["plan", written(tmp_path), "--first", "--physics", "--json", "-o", log]) == 0
    planned = capsys.readouterr()
    physics = json.loads(planned.out)["physics"]
    assert physics["kept"] is True
    (contact,) = physics["contacts"]
    assert (contact["contact"], contact["moved"], contact["moved_at"]) == ("pusher-box", False, None)
    assert contact["slide"] < 1e-4
    assert "in the physics engine, at full speed: every contact held" in planned.err
    assert main(["replay", log, "--physics", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["physics"] == physics


@pytest.mark.usefixtures("_engine")
def test_a_push_that_brakes_too_hard_is_a_mismatch(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It brakes with 6 m/s^2 where friction gives 2.94."""
    code = main(["plan", written(tmp_path, acceleration=6.0), "--first", "--physics"])
    out = capsys.readouterr().out
    assert code == 4, out
    assert "in the physics engine, at full speed: a contact moved" in out
    assert "pusher-box  moved from 0." in out
