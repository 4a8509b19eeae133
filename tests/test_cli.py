"""The command line, end to end: what is printed where, what is written, and the exit codes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from pushplan.cli import COMMANDS, main
from pushplan.commands import plan as plan_command
from pushplan.examples import example_names, example_text
from pushplan.path import cost_rate
from pushplan.run import execute
from pushplan.scenario import load_scenario
from pushplan.sim.kinematic import Execution
from pushplan.stable_set import stable_set

Captured = pytest.CaptureFixture[str]

WALLS = """
obstacles:
  - {box: [0.1, 1.0], pose: [-0.4, 0.0, 0.0]}
  - {box: [0.1, 1.0], pose: [0.6, 0.0, 0.0]}
  - {box: [1.2, 0.1], pose: [0.1, -0.5, 0.0]}
  - {box: [1.2, 0.1], pose: [0.1, 0.5, 0.0]}
"""
"""A room without a door around the start of the example free-space."""


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    """The JSON object of one plan, with its log, picture and page."""
    folder = tmp_path_factory.mktemp("plan")
    files = {"log": folder / "run.mcap", "plot": folder / "run.svg", "html": folder / "run.html"}
    words = ["plan", "two-crates", "--time-limit", "0.5", "--seed", "3", "--json", "-o", str(files["log"])]
    words += ["--plot", str(files["plot"]), "--html", str(files["html"])]
    done = subprocess.run(
        [sys.executable, "-m", "pushplan", *words], capture_output=True, text=True, timeout=120, check=False
    )
    return {"code": done.returncode, "out": done.stdout, "err": done.stderr, **files}


def test_plan_prints_one_json_object_and_nothing_else_on_stdout(planned: Mapping[str, Any]) -> None:
    assert planned["code"] == 0, planned["err"]
    assert planned["out"].count("\n") == 1
    assert isinstance(json.loads(planned["out"]), dict)
    assert "two-crates: solved" in planned["err"]


def test_the_interpreters_end_writes_nothing(planned: Mapping[str, Any]) -> None:
    assert "leak" not in planned["err"].lower()


def test_plan_tells_all_numbers_and_they_fit_together(planned: Mapping[str, Any]) -> None:
    found = json.loads(planned["out"])
    assert found["solved"] is True
    settings = load_scenario("two-crates").planner.name, "ecof", 3
    assert (found["planner"], found["set"], found["seed"]) == settings
    assert 0.0 < found["first_solution_s"] <= found["planning_s"] < 2.0
    assert sum(arc["length"] for arc in found["arcs"]) == pytest.approx(found["path_cost"])
    assert np.allclose(cost_rate([arc["twist"] for arc in found["arcs"]]), 1.0)
    assert 0.0 <= found["goal_error"]["position"] <= 1e-6
    assert 0.0 <= found["goal_error"]["angle"] <= 1e-6
    assert found["min_margin"] > 0.0
    assert found["duration_s"] > 1.0
    assert Path(found["log"]) == planned["log"]


def test_plan_writes_what_was_asked_for(planned: Mapping[str, Any]) -> None:
    assert planned["log"].read_bytes().startswith(b"\x89MCAP0")
    assert "<!-- two-crates: " in planned["plot"].read_text()
    assert "two-crates" in planned["html"].read_text()


def test_the_plans_twists_lie_in_the_stable_set(planned: Mapping[str, Any]) -> None:
    twists = np.array([arc["twist"] for arc in json.loads(planned["out"])["arcs"]])
    assert stable_set(load_scenario("two-crates").chain, "ecof").contains(twists).all()


def test_replay_verifies_and_exports_a_log(
    planned: Mapping[str, Any], tmp_path: Path, capsys: Captured
) -> None:
    words = ["replay", str(planned["log"]), "--verify", "--json", "--csv", str(tmp_path / "r.csv")]
    words += ["--html", str(tmp_path / "r.html"), "--plot", str(tmp_path / "r.svg")]
    assert main(words) == 0
    found = json.loads(capsys.readouterr().out)
    recorded = json.loads(planned["out"])
    assert found["verification"]["matches"] is True
    assert len(found["verification"]["checks"]) > 5
    assert found["outcome"] == "solved"
    for key in ("path_cost", "arcs", "goal_error", "min_margin", "duration_s", "seed"):
        assert found[key] == recorded[key]
    assert (tmp_path / "r.csv").read_text().startswith("t,x,y,theta,vx,vy,omega,")
    assert (tmp_path / "r.svg").read_bytes() == planned["plot"].read_bytes()
    assert (tmp_path / "r.html").read_bytes() == planned["html"].read_bytes()


def test_replay_reports_a_mismatch_with_exit_code_4(
    planned: Mapping[str, Any], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    def shifted(*words: Any) -> Execution:
        execution = execute(*words)
        assert execution is not None
        return replace(execution, poses=execution.poses + 1e-3)

    monkeypatch.setattr("pushplan.logging.verify.execute", shifted)
    assert main(["replay", str(planned["log"]), "--verify"]) == 4
    out = capsys.readouterr().out
    assert "the execution differs from the record:" in out
    assert "pose: differs by 0.001" in out


def test_replay_refuses_a_damaged_log_and_says_where(
    planned: Mapping[str, Any], tmp_path: Path, capsys: Captured
) -> None:
    (tmp_path / "cut.mcap").write_bytes(planned["log"].read_bytes()[:5000])
    assert main(["replay", str(tmp_path / "cut.mcap")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "cut.mcap at byte " in err
    assert "Traceback" not in err


def test_replay_shows_what_a_cut_off_log_still_has(
    planned: Mapping[str, Any], tmp_path: Path, capsys: Captured
) -> None:
    data = planned["log"].read_bytes()
    rest = tmp_path / "run.mcap.partial"
    rest.write_bytes(data[: len(data) // 2])
    assert main(["replay", str(rest), "--json"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert found["outcome"] == "cut off"
    assert found["lost"]
    assert "two-crates" in err


def test_a_plan_not_found_in_time_is_logged_all_the_same(tmp_path: Path, capsys: Captured) -> None:
    file, log = tmp_path / "walled-in.yaml", tmp_path / "run.mcap"
    file.write_text(example_text("free-space") + WALLS)
    words = ["plan", str(file), "--time-limit", "0.2", "-o", str(log), "--json"]
    assert main(words) == 3
    found = json.loads(capsys.readouterr().out)
    assert found["solved"] is False
    assert "0.2 s" in found["reason"]
    assert found["arcs"] == []
    assert found["path_cost"] is found["goal_error"] is found["duration_s"] is None
    assert main(["replay", str(log), "--verify", "--plot", str(tmp_path / "p.png")]) == 0
    assert "nothing to verify" in capsys.readouterr().out
    assert (tmp_path / "p.png").stat().st_size > 10_000


def test_the_words_override_the_scenario(capsys: Captured) -> None:
    assert (
        main(["plan", "free-space", "--planner", "est", "--seed", "7", "--time-limit", "0.1", "--json"]) == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert (found["planner"], found["seed"]) == ("est", 7)
    assert found["planning_s"] < 0.5


def test_people_see_a_table_without_json(capsys: Captured) -> None:
    assert main(["plan", "free-space", "--time-limit", "0.1"]) == 0
    out = capsys.readouterr().out
    for label in ("path cost", "duration", "planning", "goal error", "smallest margin"):
        assert f"\n  {label}" in out
    assert "\x1b" not in out


def test_a_wrong_scenario_is_told_with_all_findings(tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(
        example_text("two-crates").replace("mass: 1.2", "mass: -1").replace("width: 0.20", "widht: 0.2")
    )
    for command in ("plan", "stable-set", "check"):
        assert main([command, str(file)]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count(f"{file}:") >= 2
        assert "mass" in err
        assert "did you mean 'width'" in err
        assert "Traceback" not in err


def test_findings_are_data_in_json_mode(tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(example_text("two-crates").replace("mass: 1.2", "mass: -1"))
    assert main(["plan", str(file), "--json"]) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert error["kind"] == "ScenarioError"
    assert error["findings"][0]["where"] == "objects[0].mass"
    assert error["findings"][0]["line"] == 8


@pytest.mark.parametrize("command", ["plan", "check"])
def test_a_chain_that_cannot_be_pushed_is_a_finding(command: str, tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "slippery.yaml"
    text = example_text("two-crates")
    assert "between: [{objects: [near, far], friction: 0.30}]" in text
    file.write_text(
        text.replace("offset: 0.01", "offset: 0.075").replace("friction: 0.30}]", "friction: 0.0}]")
    )
    assert main([command, str(file)]) == 2
    assert "the stable set is empty" in capsys.readouterr().err


def test_check_shows_what_was_understood(capsys: Captured) -> None:
    assert main(["check", "two-crates"]) == 0
    out = capsys.readouterr().out
    for words in (
        "pusher               0.200 m wide, 0.030 m thick",
        "object near          0.100 x 0.080 m, 4 corners, 1.2 kg (11.8 N), floor friction 0.3",
        "contact near-far     0.070 m long, friction 0.3 (16.7 deg)",
        "8 obstacles",
        "start                chain frame at (0, 0) m, 0 deg; 0.256 m from the nearest thing",
        "tightest left turn   radius 0.146 m",
        "no findings",
    ):
        assert words in out


@pytest.mark.parametrize("name", example_names())
def test_every_example_passes_its_check(name: str, capsys: Captured) -> None:
    assert main(["check", name, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["objects"]) == len(found["contacts"])
    for place in ("start", "goal"):
        assert found[place]["room"] is None or found[place]["room"] > 0.0


def test_examples_are_listed_with_their_first_line_and_printed_whole(capsys: Captured) -> None:
    assert main(["examples"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(example_names())
    assert all(len(line.split()) > 3 for line in lines)
    assert main(["examples", "two-crates"]) == 0
    assert capsys.readouterr().out == example_text("two-crates")
    assert main(["examples", "no-such"]) == 2
    assert "no packaged scenario is called 'no-such'" in capsys.readouterr().err


def test_a_printed_example_can_be_planned_from_its_file(tmp_path: Path, capsys: Captured) -> None:
    main(["examples", "free-space"])
    (tmp_path / "mine.yaml").write_text(capsys.readouterr().out)
    assert main(["plan", str(tmp_path / "mine.yaml"), "--time-limit", "0.1"]) == 0


def test_stable_set_tells_cones_radii_and_regions(tmp_path: Path, capsys: Captured) -> None:
    assert main(["stable-set", "two-crates", "--json", "--plot", str(tmp_path / "s.svg")]) == 0
    found = json.loads(capsys.readouterr().out)
    stable = stable_set(load_scenario("two-crates").chain, "ecof")
    each = found["sets"]["ecof"]
    cone = stable.translation_cone()
    assert cone is not None
    assert np.allclose(each["translation_cone"], cone)
    assert each["min_turning_radius"]["left"] == pytest.approx(stable.turning_radii().left)
    assert each["seconds"] > 0.0
    for sense, region in ((1, each["cor_regions"]["ccw"]), (-1, each["cor_regions"]["cw"])):
        shape = shapely.from_geojson(json.dumps(region))
        assert shapely.box(*found["window"]).buffer(1e-9).contains(shape)
        point = np.asarray(shape.representative_point().coords)[0]
        assert stable.contains(sense * np.array([[point[1], -point[0], 1.0]]))[0]
    assert "<!-- counter-clockwise turns -->" in (tmp_path / "s.svg").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "the following arguments are required: COMMAND"),
        (["pul"], "invalid choice: 'pul'"),
        (["plan"], "the following arguments are required: SCENARIO"),
        (["plan", "two-crates", "--planner", "rtr"], "invalid choice: 'rtr'"),
        (["plan", "two-crates", "--set", "none"], "invalid choice: 'none'"),
        (["plan", "two-crates", "--time-limit", "nan"], "nan s is no time limit"),
        (["plan", "two-crates", "--time-limit", "0"], "0 s is no time limit"),
        (["plan", "two-crates", "--time-limit", "soon"], "invalid seconds value: 'soon'"),
        (["plan", "two-crates", "--seed", "-1"], "-1 is no seed"),
        (["plan", "two-crates", "--see", "1"], "unrecognized arguments: --see"),
        (["plan", "two-crates", "--plot", "p.bmp"], "a picture ends in .png, .svg, .pdf, not in .bmp"),
        (["plan", "two-crates", "-o", "/no/such/folder/r.mcap"], "there is no folder /no/such/folder"),
        (["plan", "two-crates", "--html", "x", "-o", "./x"], "this file is read or written already"),
        (["plan", "no-such.yaml"], "no-such.yaml: cannot read the file: No such file"),
        (["replay", "no-such.mcap"], "no-such.mcap"),
    ],
)
def test_wrong_words_end_with_a_message_and_exit_code_2(
    words: list[str], message: str, capsys: Captured
) -> None:
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert "Traceback" not in err


@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_is_on_stdout(words: list[str], capsys: Captured) -> None:
    assert main(words) == 0
    assert capsys.readouterr().out.startswith("usage: pushplan")


def test_version_is_that_of_the_installed_package(capsys: Captured) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"pushplan {version('pushplan')}\n"


def test_an_interruption_ends_with_130(monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    def interrupted(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(plan_command, "run", interrupted)
    assert main(["plan", "two-crates"]) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_a_reader_that_leaves_early_sees_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "pushplan", "examples"],
        stdout=writer,
        stderr=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    os.close(writer)
    assert done.returncode == 141
    assert done.stderr == b""


def test_closed_streams_do_no_harm() -> None:
    command = f"{sys.executable} -m pushplan examples >&- 2>&-"
    assert subprocess.run(["sh", "-c", command], timeout=60, check=False).returncode == 0


def test_a_full_disk_is_no_defect() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "pushplan", "examples"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr == "error: No space left on device\n"
