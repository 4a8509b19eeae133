"""Suite files and the command that runs them: meaning, errors, keys of runs, exit codes."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import Captured, Patch, heed_interrupts, there

from pushplan.bench.batch import Selection, run_suite
from pushplan.bench.executor import local_engine
from pushplan.bench.store import ResultsFolder
from pushplan.bench.suite import RunSpec, Suite, SuiteError, load_suite, suite_from_text
from pushplan.cli.main import main
from pushplan.scenario.file import example_text

SMALL = """\
format: pushplan-suite/1
problems:
  - one-box
  - name: gaps
    generate: {objects: 2, gap: [1.5, 2.0], obstacles: [0, 3], size: ["10 cm", 0.15]}
    count: 2
    seed: 5
planners: [auto, {name: rrt, label: rrt-first, first: true, time: 500 ms, cost: time, gap: 1 %}]
sets: [ecof, translation]
seeds: [3, 7]
limits: {time: 1.5 s, iterations: 1000, memory: 1 GB}
"""


def _runs(suite: Suite, version: str = "1") -> list[RunSpec]:
    return list(suite.runs(version))


def test_a_suite_is_the_product_of_problems_planners_sets_and_seeds() -> None:
    suite = suite_from_text(SMALL)
    assert [problem.name for problem in suite.problems] == ["one-box", "gaps-5", "gaps-6"]
    assert [problem.instance for problem in suite.problems] == [None, 5, 6]
    assert {len(problem.scenario().chain.objects) for problem in suite.problems[1:]} == {2}
    assert [planner.label for planner in suite.planners] == ["auto", "rrt-first"]
    assert [planner.time for planner in suite.planners] == [1.5, 0.5]
    assert [planner.iterations for planner in suite.planners] == [1000, 1000]
    assert [(planner.cost, planner.gap) for planner in suite.planners] == [(None, None), ("time", 0.01)]
    runs = _runs(suite)
    assert len(runs) == 3 * 2 * 2 * 2 == len({run.key for run in runs})
    assert {run.seed for run in runs[:12]} == {3}
    assert (runs[0].seconds, runs[0].megabytes) == (5.0 * 1.5 + 30.0, 1000.0)


def test_keys_of_runs_change_exactly_with_the_settings_that_affect_results() -> None:
    suite = suite_from_text(SMALL)
    keys = [run.key for run in _runs(suite)]
    renamed = replace(
        suite,
        name="other",
        planners=tuple(p.model_copy(update={"label": f"my {p.label}"}) for p in suite.planners),
        problems=tuple(replace(problem, name=f"my {problem.name}") for problem in suite.problems),
        limits=suite.limits.model_copy(update={"memory": 1.0}),
    )
    assert [run.key for run in _runs(renamed)] == keys
    others = [
        _runs(suite, "2"),
        _runs(suite_from_text(SMALL.replace("iterations: 1000", "iterations: 1001"))),
        _runs(suite_from_text(SMALL.replace("time: 1.5 s", "time: 1.4 s").replace("500 ms", "501 ms"))),
        _runs(suite_from_text(SMALL.replace("[3, 7]", "[4, 8]"))),
        _runs(suite_from_text(SMALL.replace("name: rrt,", "name: est,")))[1::2][1::2],
    ]
    for other in others:
        assert not set(keys) & {run.key for run in other}


def test_all_errors_of_a_suite_are_reported_with_their_places(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(example_text("one-box").replace("mass:", "maß:"))
    text = """\
format: pushplan-suite/1
problems:
  - one-box
  - {scenario: one-box, name: again}
  - bad.yaml
  - nowhere
  - {name: gaps, generate: {workspace: 0.5}}
planners: [auto, {name: auto, label: same}, {name: rrt, label: auto}]
"""
    with pytest.raises(SuiteError) as caught:
        suite_from_text(text, tmp_path / "suite.yaml")
    lines = [finding.text("s.yaml").replace(str(tmp_path), "") for finding in caught.value.findings]
    assert [line.split(": ")[0] for line in lines] == [
        f"s.yaml:{p}" for p in ("4:5", "5:5", "5:5", "6:5", "7:5", "8:18", "8:45")
    ]
    told = (
        "is the same problem as 'one-box'", "cannot be used: /bad.yaml:", "cannot be used: /bad.yaml:",
        "no packaged scenario", "no free start and goal", "the same as planners[0]", "has the label 'auto' of",
    )  # fmt: skip
    assert all(words in line for words, line in zip(told, lines, strict=True)), lines


WRONG = """\
problems: [] | 2:11: problems: is a list of 0; allowed: a list of scenarios
problem: [one-box] | 2:1: problem: unknown key; did you mean 'problems'?
problems: [{generate: {}}] | problems[0]: generates problems without a name; allowed: {name: ...
problems: [{scenario: x, count: 2}] | has count or seed but generates nothing
problems: [{scenario: x, format: relopush}] | suites no longer read files of ReloPush
problems: [{name: x, generate: {objects: [3, 1]}}] | is [3, 1]; allowed: [low, high] with low <= high
problems: [{name: x, generate: {drives: [car, tank]}}] | drives[1]: is the text 'tank'
problems: [one-box]; planners: [rtt] | planners[0]: is the text 'rtt'
problems: [one-box]; planners: [{name: rrt, first: 1}] | first: is 1; allowed: true to stop
problems: [one-box]; sets: [ecof, ecof] | 3:7: sets: holds ecof twice; allowed: each value once
problems: [one-box]; seeds: 0 | 3:8: seeds: is 0; allowed: a whole number from 1 to 100000
problems: [one-box]; limits: {time: 1 kg} | limits.time: '1 kg' is a mass; allowed: a time in s
"""


@pytest.mark.parametrize("row", WRONG.splitlines())
def test_wrong_values_are_reported_as_in_scenarios(row: str) -> None:
    wrong, message = row.split(" | ")
    with pytest.raises(SuiteError) as caught:
        suite_from_text(f"format: pushplan-suite/1\n{wrong.replace('; ', chr(10))}\n")
    assert message in str(caught.value)


@pytest.mark.parametrize("name", ["smoke", "paper"])
def test_a_subset_of_every_packaged_suite_runs(name: str, tmp_path: Path) -> None:
    suite = load_suite(name)
    assert suite.name == name
    patient = {"time": 600.0, "iterations": 3_000}  # independent of the load of the machine
    suite = replace(suite, planners=tuple(one.model_copy(update=patient) for one in suite.planners))
    last = f"problem={suite.problems[-1].name}"
    folder = ResultsFolder(tmp_path)
    with folder.locked(), local_engine(1) as engine:
        selection = Selection(filters=(last, "planner=auto", "set=ecof", "seed=1"))
        tally = run_suite(suite, folder, engine, selection)
    assert tally.counts == {"ok": 1}


SUITE = """\
format: pushplan-suite/1
name: small
problems: [one-box]
planners: [{name: auto, first: true}]
seeds: 2
"""
ENDLESS = SUITE.replace("first: true", "time: 86400 s")
"""Runs that take minutes, because a search without a better path ends late if it has more time."""


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
    assert f"{folder} has the results of 2 runs; continue with --resume" in capsys.readouterr().err
    assert main(["bench", suite, "-o", str(folder), "--resume", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["runs"], document["before"], document["done"], document["left"]) == (2, 2, 0, 0)
    assert main(["bench", suite, "-o", str(folder), "--resume", "--filter", "seed=9"]) == 2
    assert "no run matches seed=9" in capsys.readouterr().err


def test_shards_are_merged_and_reported(suite: str, tmp_path: Path, capsys: Captured) -> None:
    one, two, whole = (tmp_path / name for name in ("1", "2", "whole"))
    assert main(["bench", suite, "-o", str(one), "--shard", "1/2"]) == 0
    assert capsys.readouterr().out.endswith(f"results: {one}; after all shards: pushplan bench merge\n")
    assert main(["bench", "merge", str(one), "-o", str(tmp_path / "half")]) == 0
    assert capsys.readouterr().out.startswith("small: 1 run of 1 folder, 1 without a result\n")
    assert main(["bench", "merge", str(one), str(two), "-o", str(whole)]) == 2
    assert f"{two / 'results.db'}: there are no results" in capsys.readouterr().err
    assert main(["bench", suite, "-o", str(two), "--shard", "2/2"]) == 0
    capsys.readouterr()
    assert main(["bench", "merge", str(one), str(two), "-o", str(whole), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["runs"], document["done"], document["left"], document["processors"]) == (2, 2, 0, "")
    assert {"results.db", "report.html", "runs.csv", "logs", "problems", "suite.yaml"} <= set(os.listdir(whole))
    assert main(["bench", suite, "-o", str(whole), "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["before"] == 2


def test_ctrl_c_stops_a_suite_and_prints_how_to_resume(tmp_path: Path) -> None:
    (tmp_path / "long.yaml").write_text(ENDLESS)
    command = [sys.executable, "-m", "pushplan", "bench", "long.yaml", "-o", "results", "--filter", "seed=*"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, preexec_fn=heed_interrupts
    ) as program:
        while "small ..." not in there(program.stderr).readline():
            pass
        program.send_signal(signal.SIGINT)
        _, rest = program.communicate(timeout=30.0)
    assert program.returncode == 130
    assert (
        "stopped; continue with: pushplan bench long.yaml -o results --resume --filter 'seed=*'\ninterrupted\n"
        in rest
    )
    assert "Traceback" not in rest
    assert not (tmp_path / "results" / ".scratch").exists()
    assert (tmp_path / "results" / "results.db").exists()


def test_aborted_runs_have_an_exit_code(suite: str, tmp_path: Path, capsys: Captured) -> None:
    Path(suite).write_text(ENDLESS + "limits: {run: 1 ms}\n")
    words = ["bench", suite, "-o", str(tmp_path / "results")]
    assert main(words) == 4
    assert "timeout  2" in (out := capsys.readouterr().out)
    assert "2 runs crashed or exceeded a limit (--accept-broken accepts this); first:\n" in out
    assert main([*words, "--resume", "--json"]) == 4
    document = json.loads(capsys.readouterr().out)
    assert (document["done"], document["broken"]) == (0, 2)
    assert main([*words, "--resume", "--accept-broken"]) == 0


@pytest.mark.parametrize(("words", "message"), [
    (["smoke"], "name a folder for the results: pushplan bench smoke -o DIR"),
    (["nosuite", "-o", "x"], "no packaged suite has this name"),
    (["smoke", "-o", "x", "--jobs", "many"], "'many' is not a number of jobs"),
    (["smoke", "--compare", "a", "b", "--resume"], "--compare cannot be combined with SUITE and --resume"),
    (["smoke", "-o", "x", "--rerun", "ab", "--filter", "seed=1"], "--rerun cannot be combined with --filter"),
    (["smoke", "-o", "x", "--scheduler", "tcp://h:1", "--jobs", "2"], "cannot be combined with --jobs"),
    (["smoke", "-o", "x", "--shard", "4/3"], "--shard is '4/3'; allowed: I/N with I from 1 to N"),
    (["smoke", "-o", "x", "--rerun", "ab", "--shard", "1/3"], "--rerun cannot be combined with --shard"),
    (["merge", "-o", "x"], "name the folders of the shards: pushplan bench merge DIR... -o DIR"),
    (["merge", "a", "-o", "x", "--resume"], "merge cannot be combined with --resume"),
    (["smoke", "a", "-o", "x"], "'a' is one argument too many"),
    (["smoke", "-o", "x", "--rerun", "nokey"], "no run of this suite and version has a key that begins with"),
])  # fmt: skip
def test_wrong_arguments_give_exit_code_2(
    words: list[str], message: str, capsys: Captured, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["bench", *words]) == 2
    assert message in capsys.readouterr().err
