"""Recorded runs: every run leaves a log without being asked, lists tell it, old ones go, and nothing fails a plan."""

from __future__ import annotations

import fcntl
import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pushplan.logging.old.reader import read_run
from pushplan.recording import IncompleteLogError

import pushplan
from pushplan.cli.main import main
from pushplan.cli.runs import age_text
from pushplan.errors import OutputError, PlanningError
from pushplan.logging.runs import (
    RunsError,
    chosen,
    new_log,
    prune,
    recorded_logs,
    run_numbered,
    runs_folder,
    runs_of,
)

Captured = pytest.CaptureFixture[str]
KINDS = ("solved", "cut off", "damaged", "refused")


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A log."""
    path = tmp_path_factory.mktemp("one") / "run.mcap"
    assert main(["plan", "one-box", "--first", "-o", str(path)]) == 0
    return path.read_bytes()


@pytest.fixture
def folder(tmp_path: Path, one: bytes, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Four recorded runs, oldest first: solved, cut off, damaged, and one that is being written; and another file."""
    runs = tmp_path / "runs"
    runs.mkdir()
    names = [f"2026010{k}T000000.000Z-one-box-seed1.mcap" for k in range(1, 5)]
    contents = [
        one,
        one[: len(one) // 2],
        b"\x89MCAP0\r\n" + one[8:].replace(b"one-box", b"two-box"),
        one[:9000],
    ]
    ends = ["", ".partial", "", ".partial"]
    for name, content, end in zip(names, contents, ends, strict=True):
        (runs / f"{name}{end}").write_bytes(content)
    (runs / "mine.mcap").write_bytes(one)
    monkeypatch.setenv("PUSHPLAN_RUNS", str(runs))
    with (runs / f"{names[3]}.partial").open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield runs


def test_the_folder_is_the_option_else_the_variable_else_the_state_folder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HOME", "/home/me")
    monkeypatch.setenv("XDG_STATE_HOME", "/state")
    monkeypatch.setenv("PUSHPLAN_RUNS", "/runs")
    assert runs_folder("/asked") == Path("/asked")
    assert runs_folder() == Path("/runs")
    monkeypatch.setenv("PUSHPLAN_RUNS", "")
    assert runs_folder() == Path("/state/pushplan/runs")
    for state in ("", "relative"):  # the latter is to be ignored
        monkeypatch.setenv("XDG_STATE_HOME", state)
        assert runs_folder() == Path("/home/me/.local/state/pushplan/runs")


def test_every_run_is_recorded_and_says_where(tmp_path: Path, capsys: Captured) -> None:
    """Also one that is refused."""
    runs = tmp_path / "new" / "runs"
    assert main(["plan", "one-box", "--first", "--seed", "7", "--runs", str(runs)]) == 0
    (log,) = runs.iterdir()
    assert f"log              {log}" in capsys.readouterr().out
    assert log.name.endswith("Z-one-box-seed7.mcap")
    assert abs(time.time() - log.stat().st_mtime) < 60.0
    assert read_run(log).outcome == "solved"
    with pytest.raises(PlanningError):
        pushplan.run(pushplan.load_scenario("one-box"), margin=2.0, runs=runs)
    assert [entry.outcome for entry in runs_of(runs)] == ["refused", "solved"]


def test_python_records_and_tells_the_log(tmp_path: Path) -> None:
    done = pushplan.run(pushplan.load_scenario("one-box"), first=True, runs=tmp_path)
    assert done.log is not None
    assert done.log.parent == tmp_path
    assert read_run(done.log).plan is not None


@pytest.mark.parametrize("words", [["--no-log"], ["-o", "run.mcap"]])
def test_nothing_is_recorded_where_it_is_not_wanted(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PUSHPLAN_RUNS", str(tmp_path / "runs"))
    assert main(["plan", "one-box", "--first", *words]) == 0
    assert not (tmp_path / "runs").exists()
    assert main(["plan", "one-box", "--no-log", "-o", "run.mcap"]) == 2


def test_a_folder_that_cannot_be_written_is_a_warning(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "file").write_text("precious")
    for runs in (tmp_path / "file", tmp_path / "file" / "in"):
        assert main(["plan", "one-box", "--first", "--runs", str(runs), "--json"]) == 0
        out, error = capsys.readouterr()
        assert "warning: this run is not recorded: " in error
        assert json.loads(out)["log"] is None
    with pytest.warns(RuntimeWarning, match="this run is not recorded"):
        pushplan.run(pushplan.load_scenario("one-box"), first=True, runs=tmp_path / "file")
    assert (tmp_path / "file").read_text() == "precious"


def test_what_fails_while_writing_fails_no_recorded_run_and_keeps_the_plan_of_a_named_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OutputError("the log", "No space left on device")

    monkeypatch.setattr("pushplan.logging.old.writer.RunLogWriter.plan", full)
    scenario = pushplan.load_scenario("one-box")
    with pytest.warns(RuntimeWarning, match="not recorded: the log: No space left"):
        done = pushplan.run(scenario, first=True, runs=tmp_path / "runs")
    assert done.plan.solved
    assert done.log is None
    with pytest.raises(
        IncompleteLogError, match=r"No space left on device; what was written .*run\.mcap\.partial"
    ):
        pushplan.run(scenario, first=True, log=tmp_path / "run.mcap")
    assert read_run(tmp_path / "run.mcap.partial").outcome == "failed"


def test_runs_of_the_same_moment_get_names_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    for k in range(30):
        made.append(new_log(tmp_path, "a/b ü", 1))
        (made[-1] if k % 2 else made[-1].with_name(f"{made[-1].name}.partial")).touch()
    assert len(set(made)) == 30
    assert all(path.parent == tmp_path and "-a_b_-seed1" in path.name for path in made)
    assert len(recorded_logs(tmp_path)) == 30


def test_the_list_tells_what_the_logs_say(folder: Path) -> None:
    running, damaged, cut, solved = runs_of(folder)
    assert [entry.number for entry in (running, damaged, cut, solved)] == [None, 1, 2, 3]
    assert (running.outcome, damaged.outcome, cut.outcome) == ("running", "damaged", "cut off")
    recorded = read_run(solved.path)
    assert solved.outcome == recorded.outcome == "solved"
    assert recorded.plan is not None
    assert recorded.plan.path is not None
    assert solved.cost == recorded.plan.path.cost
    assert (solved.scenario, solved.planner, solved.seed) == ("one-box", recorded.plan.planner, "1")
    assert solved.set == cut.set == recorded.plan.stable_set
    assert solved.size == (folder / solved.path.name).stat().st_size


def test_the_command_lists_filters_and_counts(folder: Path, capsys: Captured) -> None:
    def listed(*words: str) -> list[dict[str, Any]]:
        assert main(["runs", "--json", *words]) == 0
        runs: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["runs"]
        return runs

    assert [run["number"] for run in listed()] == [None, 1, 2, 3]
    assert [run["number"] for run in listed("--filter", "outcome=s*")] == [3]
    assert [run["number"] for run in listed("--filter", "scenario=one-*", "--last", "2")] == [None, 2]
    assert [run["bytes"] for run in listed("--last", "1")] == [9000]
    assert main(["runs", "--filter", "colour=red"]) == 2
    assert "FIELD one of outcome, scenario, planner, set, seed" in capsys.readouterr().err
    assert main(["runs", "--filter", "outcome=solved"]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[1].split()[:2] == ["@3", "solved"]
    assert out.endswith(f"1 of 4 runs in {folder}\n")
    assert main(["runs", "--runs", str(folder / "none")]) == 0
    assert capsys.readouterr().out == f"0 runs in {folder / 'none'}\n"


def test_replay_takes_the_last_run_or_the_one_with_a_number(folder: Path, capsys: Captured) -> None:
    assert main(["replay", "@3", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["log"].endswith("20260101T000000.000Z-one-box-seed1.mcap")
    assert main(["replay", "@2"]) == 0  # cut off
    assert main(["replay"]) == 2  # damaged
    assert "20260103T000000.000Z-one-box-seed1.mcap" in capsys.readouterr().err
    for number in (0, 4):
        with pytest.raises(RunsError, match=f"there is no run @{number}; 3 are recorded"):
            run_numbered(folder, number)
    assert main(["replay", "--runs", str(folder / "none")]) == 2
    assert "no run is recorded here yet" in capsys.readouterr().err


def _fill(folder: Path, count: int, size: int = 1000) -> list[Path]:
    logs = [folder / f"20260101T0000{k:02d}.000Z-a-seed1.mcap" for k in range(count)]
    for log in logs:
        log.write_bytes(bytes(size))
    return logs


def test_the_oldest_are_removed_beyond_the_size_cap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.mcap").write_bytes(bytes(10_000))
    logs = _fill(tmp_path, 10)
    monkeypatch.setenv("PUSHPLAN_RUNS_MB", "0.0045")
    prune(tmp_path, logs[-1])
    assert [log.exists() for log in logs] == [False] * 6 + [True] * 4
    assert (tmp_path / "mine.mcap").exists()
    for wrong in ("0", "many", "nan"):
        monkeypatch.setenv("PUSHPLAN_RUNS_MB", wrong)
        with pytest.raises(OutputError, match=f"PUSHPLAN_RUNS_MB: '{wrong}' is no limit"):
            prune(tmp_path, logs[-1])


def test_neither_the_run_just_written_nor_one_being_written_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = _fill(tmp_path, 5)
    monkeypatch.setenv("PUSHPLAN_RUNS_MB", "0.0005")
    written = tmp_path / "20250101T000000.000Z-a-seed1.mcap.partial"
    cut = tmp_path / "20250102T000000.000Z-a-seed1.mcap.partial"
    with written.open("w") as file:
        cut.touch()
        fcntl.flock(file, fcntl.LOCK_EX)
        prune(tmp_path, logs[2])
    assert {entry.name for entry in recorded_logs(tmp_path)} == {written.name, logs[2].name}


def test_every_recorded_run_makes_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PUSHPLAN_RUNS_MB", "0.001")
    _fill(tmp_path, 5)
    done = pushplan.run(pushplan.load_scenario("one-box"), first=True, runs=tmp_path, tell=print)
    assert [Path(entry.path) for entry in recorded_logs(tmp_path)] == [done.log]


def test_a_hundred_runs_are_listed_with_less_than_is_read_of_ten(tmp_path: Path, one: bytes) -> None:
    for k in range(100):
        (tmp_path / f"20250101T000000.{k:03d}Z-one-box-seed1.mcap").write_bytes(one)
    began = _bytes_read()
    for k in range(10):
        read_run(tmp_path / f"20250101T000000.{k:03d}Z-one-box-seed1.mcap")
    read = _bytes_read() - began
    assert read >= 10 * len(one)
    began = _bytes_read()
    assert len(chosen(runs_of(tmp_path), ["outcome=solved"])) == 100
    assert _bytes_read() - began < read


def _bytes_read() -> int:
    """Return what this process has read of all files until now."""
    (line,) = (line for line in Path("/proc/self/io").read_text().splitlines() if line.startswith("rchar"))
    return int(line.split()[1])


def test_ages_are_told_in_the_unit_that_people_would_choose() -> None:
    told = [age_text(seconds) for seconds in (-1.0, 0.4, 90.0, 150.0, 9000.0, 2e5)]
    assert told == ["0 s", "0 s", "90 s", "2 min", "2 h", "2 d"]


def test_a_log_that_leads_elsewhere_is_none_of_the_recorded(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    victim = tmp_path / "victim.mcap"
    shutil.copy(folder / "mine.mcap", victim)
    (folder / "20240101T000000.000Z-a-seed1.mcap").symlink_to(victim)
    monkeypatch.setenv("PUSHPLAN_RUNS_MB", "0.001")
    prune(folder, folder / "none")
    assert victim.exists()
    assert (folder / "20240101T000000.000Z-a-seed1.mcap").is_symlink()
