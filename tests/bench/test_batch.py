"""Batches: every run is one row and one process, whatever its outcome and its order."""

import contextlib
import os
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from bench.conftest import Rows, environment, rows
from conftest import there

from pushplan.bench.batch import Selection, Tally, merge, run_suite
from pushplan.bench.executor import local_engine
from pushplan.bench.outcome import STATUSES, perform
from pushplan.bench.results import read_results
from pushplan.bench.store import ResultsFolder, StoreError
from pushplan.bench.suite import RunSpec, Suite, suite_from_text

REAL = """\
format: pushplan-suite/1
problems: [one-box, {name: random, generate: {objects: 2, obstacles: 5}, count: 1}]
planners: [auto, {name: rrt, first: true}]
seeds: 1
trials: 2
limits: {time: 20 s, iterations: 3000}
"""
PROGRAM = """\
import sys
from pathlib import Path
import planted_runs
from pushplan.bench import executor
from pushplan.bench.batch import Selection, run_suite
from pushplan.bench.store import ResultsFolder
from pushplan.bench.suite import load_suite
executor.PRELOAD = "planted_runs"
part = tuple(map(int, sys.argv[2].split("/")))
folder, work = ResultsFolder(Path(f"results-{part[0]}")), getattr(planted_runs, sys.argv[1])
with folder.locked(), executor.local_engine(2, folder.scratch, work) as engine:
    run_suite(load_suite(Path("suite.yaml")), folder, engine, Selection(resume=True, shard=part),
              lambda tally: print(tally.done, flush=True), "test")
"""


def _started(work: str, folder: Path, shard: str = "1/1", **pipes: Any) -> subprocess.Popen[str]:
    """Start a program that runs or resumes the suite of a folder, or a shard of it."""
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, work, shard], cwd=folder, env=environment(), text=True, **pipes
    )


def _run(
    suite: Suite,
    path: Path,
    jobs: int = 2,
    selection: Selection | None = None,
    work: Any = perform,
    observer: Any = None,
) -> Tally:
    folder = ResultsFolder(path)
    with folder.locked(), local_engine(jobs, folder.scratch, work) as engine:
        return run_suite(suite, folder, engine, selection, observer, "test")


def _check_planted(found: Rows, planted: Any, seeds: range) -> None:
    assert [row["seed"] for row in found] == list(seeds)
    for row in found:
        fate = planted.fate_of(row["seed"])
        assert (fate, row["outcome"]) == (fate, planted.STATUS[fate])
        if fate == "fine":
            assert row["solution_length"] == row["seed"] / 7.0


def _results(found: Rows) -> list[tuple[object, ...]]:
    """Return the results that a seed determines, without times."""
    return [(row["key"], row["outcome"], row["solution_length"], row["arcs"]) for row in found]


def test_a_batch_killed_at_random_and_resumed_has_the_same_rows(planted: Any, tmp_path: Path) -> None:
    seeds, rng = range(14, 21), random.Random(1)  # with one that hangs and three others that fail
    (tmp_path / "suite.yaml").write_text(planted.suite_text(seeds))
    folder = tmp_path / "results-1"
    before: Rows = []
    while len(before) in (0, len(seeds)):  # also if this process was delayed until the end
        shutil.rmtree(folder, ignore_errors=True)
        for sign in (signal.SIGKILL, signal.SIGTERM):
            with _started("work", tmp_path, stdout=subprocess.PIPE) as program:
                there(program.stdout).readline()  # the first run is done
                time.sleep(rng.uniform(0.0, 0.7))
                program.send_signal(sign)
        before = rows(folder)
    assert _started("work", tmp_path, stdout=subprocess.DEVNULL).wait() == 0
    after = rows(folder)
    kept = {row["key"]: row["ended"] for row in before}
    assert kept.items() <= {row["key"]: row["ended"] for row in after}.items()
    _check_planted(after, planted, seeds)
    assert not (folder / ".scratch").exists()
    (half,) = (row for row in after if planted.fate_of(row["seed"]) == "half a log")
    assert half["log"] == f"logs/one-box-auto-ecof-{half['seed']}-{half['key'][:8]}.mcap.partial"
    assert (folder / half["log"]).read_bytes() == b"half"


def test_merged_shards_equal_the_results_of_one_machine_after_random_kills(planted: Any, tmp_path: Path) -> None:
    seeds = [seed for seed in range(20, 41) if "hang" not in planted.fate_of(seed)]
    (tmp_path / "suite.yaml").write_text(planted.suite_text(seeds))
    suite, rng = suite_from_text(planted.suite_text(seeds)), random.Random(1)
    _run(suite, tmp_path / "one", work=planted.work)
    with contextlib.ExitStack() as stack:
        for shard in ("1/4", "2/4", "3/4", "4/4"):
            program = stack.enter_context(_started("work", tmp_path, shard, stdout=subprocess.PIPE))
            there(program.stdout).readline()
            time.sleep(rng.uniform(0.0, 0.2))
            program.kill()
    parts = [tmp_path / f"results-{part}" for part in range(1, 5)]
    rng.shuffle(parts)
    early = ResultsFolder(tmp_path / "early")
    with early.locked():
        assert merge(early, parts) == 0
    assert 4 <= len(rows(early.path)) < len(seeds)
    for part in range(1, 5):
        assert _started("work", tmp_path, f"{part}/4", stdout=subprocess.DEVNULL).wait() == 0
    assert {len(rows(part)) for part in parts} == {len(seeds) // 4, -(-len(seeds) // 4)}
    with contextlib.closing(sqlite3.connect(parts[1] / "results.db")) as database, database:
        database.execute("UPDATE pushplan_runs SET cpu = 'another' WHERE outcome IS NOT NULL")
    whole = ResultsFolder(tmp_path / "whole")
    with whole.locked():
        assert merge(whole, [*parts, parts[0]]) == len(rows(parts[0]))
        with pytest.raises(StoreError, match="name another folder"):
            merge(whole, parts)
    one, merged = rows(tmp_path / "one"), rows(whole.path)
    assert _results(one) == _results(merged)
    assert {row["key"]: row["ended"] for row in merged} == {
        row["key"]: row["ended"] for p in parts for row in rows(p)
    }
    half = [row["log"] for row in merged if row["log"]]
    assert [(whole.path / log).read_bytes() for log in half] == [b"half"]
    assert (whole.path / "problems" / "one-box.yaml").exists()
    assert f"another: {len(rows(parts[1]))}" in read_results(whole.path).processors
    assert read_results(tmp_path / "one").processors == ""
    (tmp_path / "suite.yaml").write_text(planted.suite_text(seeds[1:]))
    assert _started("work", tmp_path, "1/4", stdout=subprocess.DEVNULL).wait() == 0
    other = ResultsFolder(tmp_path / "other")
    with other.locked(), pytest.raises(StoreError, match="is from another suite or another version than the first"):
        merge(other, parts)
    assert not other.database.exists()


def test_costs_and_arcs_do_not_depend_on_the_number_of_jobs(tmp_path: Path) -> None:
    suite = suite_from_text(REAL)
    _run(suite, tmp_path / "1", 1)
    some = _run(suite, tmp_path / "2", selection=Selection(filters=("problem=one-box", "planner=rrt")))
    assert (some.total, some.done) == (1, 1)
    rest = _run(suite, tmp_path / "2", selection=Selection(resume=True))
    assert (rest.total, rest.before, rest.done, rest.left) == (4, 1, 3, 0)
    one, two = rows(tmp_path / "1"), rows(tmp_path / "2")
    assert _results(one) == _results(two)
    solved = [row for row in one if row["outcome"] == "ok"]
    assert len(solved) >= 3
    for row in solved:
        assert 0.0 <= row["trial_success"] <= 1.0
        assert 0.0 < row["overhead_time"] < row["total_time"]
    assert len({row["log"] for row in one}) == len(one) == 4
    assert all((tmp_path / "1" / row["log"]).read_bytes().startswith(b"\x89MCAP0\r\n") for row in one)
    (tmp_path / "1" / one[2]["log"]).unlink()
    tally = _run(suite, tmp_path / "1", selection=Selection(rerun=one[2]["key"][:8]))
    assert (tally.total, tally.done) == (1, 1)
    assert _results(rows(tmp_path / "1")) == _results(one)
    assert (tmp_path / "1" / one[2]["log"]).exists()
    assert (tmp_path / "1" / "suite.yaml").read_bytes() == suite.source
    assert (tmp_path / "1" / "problems" / "one-box.yaml").read_bytes() == suite.problems[0].source


MESSAGES = {
    "ok": "^$", "no plan": "it is", "invalid": "it is", "error": "planted\nTraceback|SystemExit: 3",
    "crash": "killed by SIG|by itself with exit code [17]$", "timeout": "killed after [0-9]+ s$",
    "out of memory": "100 MB",
}  # fmt: skip


def specs(planted: Any, count: int, seconds: int | None = None) -> list[RunSpec]:
    text = planted.suite_text(range(count), seconds or planted.SECONDS)
    return list(suite_from_text(text).runs("test"))


def test_each_failure_has_its_status_and_message_and_stops_no_other_run(planted: Any, tmp_path: Path) -> None:
    with local_engine(2, tmp_path, planted.work) as engine:
        found = {outcome.key: outcome for outcome in engine(specs(planted, len(planted.FATES)))}
    for spec in specs(planted, len(planted.FATES)):
        fate, outcome = planted.fate_of(spec.seed), found[spec.key]
        assert (fate, outcome.status) == (fate, planted.STATUS[fate])
        assert re.search(MESSAGES[outcome.status], outcome.message)
        assert outcome.log == (b"half" if fate == "half a log" else None)
        assert not outcome.whole
        assert "hang" not in fate or 0.0 <= outcome.values["total_time"] - planted.SECONDS < 12.0
    assert {outcome.status for outcome in found.values()} == set(STATUSES)
    assert not list(tmp_path.iterdir())


def test_the_number_of_parallel_runs_is_the_requested_one(planted: Any, tmp_path: Path) -> None:
    for jobs, seconds, statuses in ((1, 1, ["timeout", "ok"]), (2, 60, ["ok", "ok"])):
        folder = tmp_path / str(jobs)
        folder.mkdir()
        with local_engine(jobs, folder, planted.meet) as engine:
            ends = [outcome.status for outcome in engine(specs(planted, 2, seconds))]
        assert ends == statuses


def test_runs_end_when_their_batch_is_killed(planted: Any, tmp_path: Path) -> None:
    (tmp_path / "suite.yaml").write_text(planted.suite_text([0], 100))
    path = tmp_path / "results-1" / ".scratch" / "number"
    with _started("leave_number", tmp_path) as program:
        while not (path.exists() and path.read_text()):
            assert program.poll() is None
            time.sleep(0.05)
        program.send_signal(signal.SIGKILL)
    number, end = int(path.read_text()), time.monotonic() + 30.0
    with contextlib.suppress(ProcessLookupError):
        while time.monotonic() < end:
            os.kill(number, 0)
            time.sleep(0.05)
        pytest.fail("the run outlives who wanted it")


def test_modules_in_the_working_directory_are_not_those_of_the_standard_library(tmp_path: Path) -> None:
    program = tmp_path / "elsewhere" / "program.py"
    program.parent.mkdir()
    program.write_text(
        "import os\n"
        "from pushplan.bench import executor\n"
        "executor.PRELOAD, before = 'secrets', dict(os.environ)\n"
        "with executor.local_engine(1): print('done', dict(os.environ) == before)\n"  # its child processes inherit it
    )
    for name in ("secrets", "selectors", "json"):
        (tmp_path / f"{name}.py").write_text("open('executed', 'w').close()\n")
    done = subprocess.run([sys.executable, program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == "done True\n", done.stderr
    assert not (tmp_path / "executed").exists()
