"""`pushplan bench`: what it prints, what it leaves, how it ends."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from interrupts import heed_interrupts

from pushplan.bench.suite import load_suite, suite_names
from pushplan.cli.main import main

Captured = pytest.CaptureFixture[str]

SUITE = """\
format: pushplan-suite/1
name: small
problems: [one-box]
planners: [{name: auto, first: true}]
seeds: 2
"""

ENDLESS = SUITE.replace("first: true", "time: 86400 s")
"""Runs that go on for minutes: without a better path a search ends the later, the more time it has."""


@pytest.fixture
def suite(tmp_path: Path) -> str:
    (tmp_path / "small.yaml").write_text(SUITE)
    return str(tmp_path / "small.yaml")


def test_a_suite_is_run_reported_and_resumed(suite: str, tmp_path: Path, capsys: Captured) -> None:
    folder = tmp_path / "results"
    assert main(["bench", suite, "-o", str(folder), "--jobs", "2"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("small: 2 runs in ")
    assert out.endswith(f"report: {folder / 'report.html'}\n")
    names = {"results.db", "report.html", "runs.csv", "progress.csv", "logs", "problems", "suite.yaml"}
    assert names <= set(os.listdir(folder))
    assert len(os.listdir(folder / "logs")) == 2
    assert main(["bench", suite, "-o", str(folder)]) == 2
    assert f"{folder} has the results of 2 runs; go on with --resume" in capsys.readouterr().err
    assert main(["bench", suite, "-o", str(folder), "--resume", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["runs"], document["before"], document["done"], document["left"]) == (2, 2, 0, 0)
    assert main(["bench", suite, "-o", str(folder), "--resume", "--filter", "seed=9"]) == 2
    assert "no run fits seed=9" in capsys.readouterr().err


def test_ctrl_c_stops_it_and_says_how_to_go_on(tmp_path: Path) -> None:
    (tmp_path / "long.yaml").write_text(ENDLESS)
    command = [sys.executable, "-m", "pushplan", "bench", "long.yaml", "-o", "results", "--filter", "seed=*"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, preexec_fn=heed_interrupts
    ) as program:
        assert program.stderr is not None
        while "small ..." not in program.stderr.readline():
            pass
        program.send_signal(signal.SIGINT)
        _, rest = program.communicate(timeout=30.0)
    assert program.returncode == 130
    assert (
        "stopped; go on with: pushplan bench long.yaml -o results --resume --filter 'seed=*'\ninterrupted\n"
        in rest
    )
    assert "Traceback" not in rest
    assert not (tmp_path / "results" / ".scratch").exists()
    assert (tmp_path / "results" / "results.db").exists()


def test_runs_that_broke_off_have_an_exit_code(suite: str, tmp_path: Path, capsys: Captured) -> None:
    Path(suite).write_text(ENDLESS + "limits: {run: 1 ms}\n")
    words = ["bench", suite, "-o", str(tmp_path / "results")]
    assert main(words) == 4
    assert "timeout  2" in (out := capsys.readouterr().out)
    assert "2 runs broke off, which --accept-broken would take for done\n" in out
    assert main([*words, "--resume", "--json"]) == 4
    document = json.loads(capsys.readouterr().out)
    assert (document["done"], document["broken"]) == (0, 2)
    assert main([*words, "--resume", "--accept-broken"]) == 0


def test_smoke_is_bound_by_iterations_alone() -> None:
    """What it solves must not depend on how busy the machine is."""
    suite = load_suite("smoke")
    assert all(planner.iterations for planner in suite.planners)
    assert all(planner.time is not None and planner.time >= 60.0 for planner in suite.planners)


def test_packaged_suites_are_listed(capsys: Captured) -> None:
    assert main(["bench", "--json"]) == 0
    suites = json.loads(capsys.readouterr().out)["suites"]
    assert tuple(suites) == suite_names()
    assert all(suites.values())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["smoke"], "name a folder for the results: pushplan bench smoke -o DIR"),
        (["nosuite", "-o", "x"], "no packaged suite is called so either"),
        (["smoke", "-o", "x", "--jobs", "0"], "'0' is no number of jobs"),
        (["smoke", "-o", "x", "--jobs", "many"], "'many' is no number of jobs"),
        (["--compare", "a", "b", "--threshold", "-1"], "'-1' is no threshold"),
        (
            ["smoke", "--compare", "a", "b", "--resume"],
            "--compare does not go together with SUITE and --resume",
        ),
        (
            ["smoke", "-o", "x", "--rerun", "ab", "--filter", "seed=1"],
            "--rerun does not go together with --filter",
        ),
        (["smoke", "-o", "x", "--scheduler", "tcp://h:1", "--jobs", "2"], "does not go together with --jobs"),
        (
            ["smoke", "-o", "x", "--rerun", "nokey"],
            "no run of this suite and version has a key that begins with",
        ),
    ],
)
def test_wrong_words_end_with_exit_code_2(
    words: list[str], message: str, capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["bench", *words]) == 2
    assert message in capsys.readouterr().err
