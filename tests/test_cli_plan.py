"""The commands plan and replay, end to end: numbers, files, exit codes."""

import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Captured, Patch, there
from kinds import WALL

from pushplan.cli.main import main
from pushplan.logging.writer import RunLogWriter
from pushplan.plans.execution import Execution
from pushplan.plans.path import cost_rate
from pushplan.scenario.file import example_text, load_scenario
from pushplan.verification import execute_again

REPEATED = ("--time-limit", "60", "--iterations", "2000")
"""Iterations that end a search at the same point on every machine."""


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    """Return the JSON object of one plan, with its log, picture and page."""
    folder = tmp_path_factory.mktemp("plan")
    files = {"log": folder / "run.mcap", "plot": folder / "run.svg", "html": folder / "run.html"}
    words = ["plan", "two-crates", *REPEATED, "--seed", "3", "--json", "-o", str(files["log"])]
    words += ["--plot", str(files["plot"]), "--html", str(files["html"])]
    done = subprocess.run(
        [sys.executable, "-m", "pushplan", *words], capture_output=True, text=True, timeout=120, check=False
    )
    return {"code": done.returncode, "out": done.stdout, "err": done.stderr, **files}


def test_plan_prints_one_consistent_json_object(planned: Mapping[str, Any]) -> None:
    assert planned["code"] == 0, planned["err"]
    assert planned["out"].count("\n") == 1
    assert "two-crates: solved" in planned["err"]
    found = json.loads(planned["out"])
    assert found["solved"] is True
    settings = load_scenario("two-crates").planner.name, "ecof", 3
    assert (found["planner"], found["set"], found["seed"]) == settings
    assert 0.0 < found["first_solution_s"] <= found["planning_s"]
    assert sum(arc["length"] for arc in found["arcs"]) == pytest.approx(found["path_cost"])
    assert found["format"] == "pushplan-plan/2"
    assert [key for key, value in found.items() if value == found["path_cost"]] == ["path_cost"]
    assert np.allclose(cost_rate([arc["twist"] for arc in found["arcs"]]), 1.0)
    assert 0.0 <= found["goal_error"]["position"] <= 1e-6
    assert 0.0 <= found["goal_error"]["angle"] <= 1e-6
    assert found["min_margin"] > 0.0
    assert found["duration_s"] > 1.0
    assert set(found["robustness"]) >= {"contact_friction", "floor_friction", "load", "position", "angle"}
    assert "  robustness      " in planned["err"]
    assert Path(found["log"]) == planned["log"]


def test_replay_verifies_and_exports_a_log(planned: Mapping[str, Any], tmp_path: Path, capsys: Captured) -> None:
    words = ["replay", str(planned["log"]), "--verify", "--json", "--csv", str(tmp_path / "r.csv")]
    words += ["--html", str(tmp_path / "r.html"), "--plot", str(tmp_path / "r.svg")]
    words += ["--layout", str(tmp_path / "r.json")]
    assert main(words) == 0
    found = json.loads(capsys.readouterr().out)
    recorded = json.loads(planned["out"])
    assert found["verification"]["matches"] is True
    assert len(found["verification"]["checks"]) > 5
    assert found["outcome"] == "solved"
    for key in ("path_cost", "arcs", "goal_error", "min_margin", "duration_s", "seed", "robustness"):
        assert found[key] == recorded[key]
    assert (tmp_path / "r.csv").read_text().startswith("t,segment,x,y,theta,vx,vy,omega,")
    assert (tmp_path / "r.svg").read_bytes() == planned["plot"].read_bytes()
    assert json.loads((tmp_path / "r.json").read_text())
    assert (tmp_path / "r.html").read_bytes() == planned["html"].read_bytes()


def test_replay_reports_a_mismatch_with_exit_code_4(
    planned: Mapping[str, Any], monkeypatch: Patch, capsys: Captured
) -> None:
    def shifted(*words: Any) -> Execution:
        execution = there(execute_again(*words))
        return replace(execution, poses=execution.poses + 1e-3)

    monkeypatch.setattr("pushplan.verification.execute_again", shifted)
    assert main(["replay", str(planned["log"]), "--verify"]) == 4
    out = capsys.readouterr().out
    assert "the log differs from the re-executed plan:" in out
    assert "pose: differs by 0.001" in out


def test_replay_shows_the_rest_of_a_truncated_log(
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
    rest.write_bytes(data[: data.index(b"pushplan.progress.0000")])
    assert main(["replay", str(rest), "--verify"]) == 0
    out = capsys.readouterr().out
    assert "two-crates: the log ends before a plan" in out
    assert "verified as far as the log goes: all " in out


@pytest.mark.parametrize(("text", "reason"), [
    (WALL, "the chain cannot pass: obstacles and walls close every way"),
    (example_text("narrow-gap").replace("1.33", "1.26"), "no path found within the time limit of 60 s or 300 itera"),
])  # fmt: skip
def test_a_run_without_a_plan_is_logged_too(text: str, reason: str, tmp_path: Path, capsys: Captured) -> None:
    file, log = tmp_path / "blocked.yaml", tmp_path / "run.mcap"
    file.write_text(text)
    words = ["plan", str(file), "--time-limit", "60", "--iterations", "300", "-o", str(log), "--json"]
    assert main(words) == 3
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert found["solved"] is False
    assert found["reason"].startswith(reason)
    assert found["diagnosis"][0]["cause"] == "gap"
    nearest = found["nearest"]
    assert nearest["path_cost"] == pytest.approx(sum(arc["length"] for arc in nearest["arcs"]))
    assert re.search(rf"nearest path .*ends {nearest['position']:.3g} m and ", err)
    assert found["arcs"] == []
    assert found["path_cost"] is found["goal_error"] is found["duration_s"] is None
    assert main(["replay", str(log), "--verify", "--plot", str(tmp_path / "p.png")]) == 0
    assert "verified: all " in capsys.readouterr().out
    assert (tmp_path / "p.png").stat().st_size > 10_000


def test_a_log_is_not_a_scenario_and_replaces_none(
    planned: Mapping[str, Any], tmp_path: Path, capsys: Captured
) -> None:
    assert main(["plan", str(planned["log"])]) == 2
    assert (
        "run.mcap:1:1: this is a run log, not a scenario; read it with `pushplan replay`" in capsys.readouterr().err
    )
    mine = tmp_path / "mine.yaml"
    mine.write_text(example_text("one-box"))
    assert main(["plan", "two-crates", "-o", str(mine)]) == 2
    assert "mine.yaml: this file exists and is not a run log" in capsys.readouterr().err
    assert mine.read_text() == example_text("one-box")


def test_texts_of_a_log_are_escaped_on_screen_and_exact_in_json(tmp_path: Path, capsys: Captured) -> None:
    evil = "\x1b]0;owned\x07 \u202eno plan"
    path = tmp_path / "run.mcap"
    with RunLogWriter.create(path, load_scenario("free-space"), {}) as writer:
        writer.log("warning", evil)
        writer.finish(evil)
    assert main(["replay", str(path)]) == 0
    out = capsys.readouterr().out
    assert r"\x1b]0;owned\x07 \u202eno plan" in out
    assert not {"\x1b", "\x07", "\u202e"} & set(out)
    assert main(["replay", str(path), "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["outcome"] == evil
    assert not {"\x1b", "\x07", "\u202e"} & set(told.err)
