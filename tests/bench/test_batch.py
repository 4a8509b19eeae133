"""Batches: every run ends up as one row, whatever happens to it, to the batch, and in whatever order."""

from __future__ import annotations

import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any

import pytest

from pushplan.bench.batch import Choice, Engine, run_suite
from pushplan.bench.processes.local import local_outcomes
from pushplan.bench.processes.outcome import Figures, Outcome, Task
from pushplan.bench.storage.folder import FolderError, ResultsFolder
from pushplan.bench.suites.file import suite_from_text
from pushplan.bench.suites.suite import Suite
from pushplan.bench.tally import Tally

HERE = Path(__file__).parent

Rows = list[dict[str, Any]]
ReadRows = Callable[[Path], Rows]

REAL = """\
format: pushplan-suite/1
problems: [one-box, {name: random, generate: {objects: 2, obstacles: 5}, count: 2}]
planners: [auto, {name: rrt, first: true}]
seeds: 2
limits: {time: 20 s, iterations: 3000}
"""


def _engine(jobs: int, folder: ResultsFolder, work: Any = None) -> Engine:
    def engine(tasks: Iterable[Task]) -> Generator[Outcome]:
        return local_outcomes(tasks, jobs, folder.scratch, *([work] if work else []))

    return engine


def _run(
    suite: Suite, path: Path, jobs: int = 2, choice: Choice | None = None, work: Any = None, **more: Any
) -> Tally:
    folder = ResultsFolder(path)
    with folder.locked():
        return run_suite(suite, folder, _engine(jobs, folder, work), choice, version="test", **more)


def _check_planted(found: Rows, planted: Any, count: int) -> None:
    assert [row["seed"] for row in found] == list(range(count))
    for row in found:
        fate = planted.fate_of(row["seed"])
        assert (fate, row["outcome"]) == (fate, planted.STATUS[fate])
        if fate == "fine":
            assert row["solution_length"] == row["seed"] / 7.0


def test_planted_faults_end_as_rows_with_the_right_status(
    planted: Any, tmp_path: Path, rows: ReadRows
) -> None:
    """The same with 1,000 runs is in benchmarks/bench.py."""
    count = 2 * len(planted.FATES)
    seen: list[Tally] = []
    tally = _run(suite_from_text(planted.suite_text(count)), tmp_path, work=planted.work, tell=seen.append)
    _check_planted(rows(tmp_path), planted, count)
    assert (tally.total, tally.done, tally.left) == (count, count, 0)
    assert tally.solved == sum(planted.fate_of(seed) == "fine" for seed in range(count))
    assert tally.failed == sum(planted.fate_of(seed) not in ("fine", "no plan") for seed in range(count))
    assert [t.done for t in seen] == list(range(1, count + 1))
    assert seen[-1].to_end == 0.0
    assert not (tmp_path / ".scratch").exists()


@pytest.mark.parametrize("kind", ["planted", "real"])
def test_a_batch_killed_at_random_and_resumed_has_the_same_rows(
    kind: str, planted: Any, tmp_path: Path, rows: ReadRows
) -> None:
    """The same with 20 kills is in benchmarks/bench.py."""
    count = len(planted.FATES)
    text = planted.suite_text(count) if kind == "planted" else REAL
    (tmp_path / "suite.yaml").write_text(text)
    folder, rng = tmp_path / "results", random.Random(1)
    command = [
        sys.executable,
        str(HERE / "planted_batch.py"),
        str(folder),
        str(tmp_path / "suite.yaml"),
        kind,
    ]
    environment = {**os.environ, "PYTHONPATH": str(HERE)}
    total = len(list(suite_from_text(text).runs("test")))
    before: Rows = []
    while len(before) in (0, total):  # also where this process was held up until all was done
        shutil.rmtree(folder, ignore_errors=True)
        for sign in (signal.SIGKILL, signal.SIGTERM) if kind == "planted" else (signal.SIGKILL,):
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as program:
                assert program.stdout is not None
                program.stdout.readline()  # the first run is done
                time.sleep(rng.uniform(0.0, 0.7))
                program.send_signal(sign)
        before = rows(folder)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
    after = rows(folder)
    kept = {row["key"]: row["ended"] for row in before}
    assert kept.items() <= {row["key"]: row["ended"] for row in after}.items()
    if kind == "planted":
        _check_planted(after, planted, count)
    else:
        _run(suite_from_text(text), tmp_path / "whole")
        assert _results(after) == _results(rows(tmp_path / "whole"))


def _results(found: Rows) -> list[tuple[object, ...]]:
    """What a run's seed decides; when it was done and how long it took are chance."""
    return [(row["key"], row["outcome"], row["solution_length"], row["arcs"]) for row in found]


def test_one_job_and_two_jobs_give_the_same_costs_and_arcs(tmp_path: Path, rows: ReadRows) -> None:
    found = []
    for jobs in (1, 2):
        _run(suite_from_text(REAL), tmp_path / str(jobs), jobs)
        found.append(rows(tmp_path / str(jobs)))
    one, two = (_results(f) for f in found)
    assert one == two
    assert len(one) == 12
    assert sum(row[1] == "ok" for row in one) >= 8
    logs = [row["log"] for row in found[0]]
    assert len(set(logs)) == 12
    assert all((tmp_path / "1" / log).read_bytes().startswith(b"\x89MCAP0\r\n") for log in logs)


def test_two_jobs_are_two_runs_at_the_same_time(planted: Any, tmp_path: Path) -> None:
    """What that gains is measured by benchmarks/bench.py."""
    text = planted.suite_text(2)
    alone = _run(suite_from_text(text), tmp_path / "1", 1, Choice(filters=("seed=0",)), planted.meet)
    assert alone.counts == {"timeout": 1}
    patient = suite_from_text(text.replace(f"run: {planted.SECONDS} s", "run: 60 s"))
    assert _run(patient, tmp_path / "2", 2, work=planted.meet).counts == {"ok": 2}


def test_resuming_does_what_is_missing_and_nothing_else(tmp_path: Path, rows: ReadRows) -> None:
    suite = suite_from_text(REAL)
    some = _run(suite, tmp_path, choice=Choice(filters=("problem=one-box", "planner=rrt")))
    assert (some.total, some.done) == (2, 2)
    rest = _run(suite, tmp_path, choice=Choice(resume=True, filters=("problem=one-box",)))
    assert (rest.total, rest.before, rest.done, rest.left) == (4, 2, 2, 0)
    again = _run(suite, tmp_path, choice=Choice(resume=True, filters=("problem=one-box",)))
    assert (again.total, again.before, again.done) == (4, 4, 0)
    assert len(rows(tmp_path)) == 4


def test_a_single_run_can_be_done_again(tmp_path: Path, rows: ReadRows) -> None:
    suite = suite_from_text(REAL)
    _run(suite, tmp_path, choice=Choice(filters=("problem=one-box",)))
    before = rows(tmp_path)
    (tmp_path / before[2]["log"]).unlink()
    tally = _run(suite, tmp_path, choice=Choice(rerun=before[2]["key"][:8]))
    assert (tally.total, tally.done) == (1, 1)
    after = rows(tmp_path)
    assert [row["key"] for row in after] == [row["key"] for row in before]
    assert [row["arcs"] for row in after] == [row["arcs"] for row in before]
    assert (tmp_path / before[2]["log"]).exists()


def test_an_interrupt_stops_cleanly_and_can_be_resumed(planted: Any, tmp_path: Path, rows: ReadRows) -> None:
    def interrupt(tally: Tally) -> None:
        if tally.done == 3:
            raise KeyboardInterrupt

    suite = suite_from_text(planted.suite_text(6))
    with pytest.raises(KeyboardInterrupt):
        _run(suite, tmp_path, work=planted.work, tell=interrupt)
    assert len(rows(tmp_path)) == 3
    assert not (tmp_path / ".scratch").exists()
    _run(suite, tmp_path, work=planted.work, choice=Choice(resume=True))
    _check_planted(rows(tmp_path), planted, 6)


def test_results_are_not_mixed_by_mistake(planted: Any, tmp_path: Path) -> None:
    suite = suite_from_text(planted.suite_text(1))
    _run(suite, tmp_path, work=planted.work)
    with pytest.raises(
        FolderError, match="has the results of 1 runs; go on with --resume, or name another folder"
    ):
        _run(suite, tmp_path, work=planted.work)
    with ResultsFolder(tmp_path).locked(), pytest.raises(FolderError, match="another benchmark writes into"):
        _run(suite, tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(FolderError, match="is a file; allowed: a folder, which may be new"):
        _run(suite, tmp_path / "file")


def test_the_folder_says_what_was_run(planted: Any, tmp_path: Path) -> None:
    suite = suite_from_text(planted.suite_text(1))
    _run(suite, tmp_path, work=planted.work)
    assert (tmp_path / "suite.yaml").read_bytes() == suite.source
    assert (tmp_path / "problems" / "one-box.yaml").read_bytes() == suite.problems[0].scenario.source


def test_the_remains_of_a_log_keep_their_name(planted: Any, tmp_path: Path, rows: ReadRows) -> None:
    first = planted.FATES.index("half a log")
    _run(suite_from_text(planted.suite_text(1, first)), tmp_path, work=planted.work)
    (row,) = rows(tmp_path)
    assert row["log"] == f"logs/one-box-auto-ecof-{first}-{row['key'][:8]}.mcap.partial"
    assert (tmp_path / row["log"]).read_bytes() == b"half"


def test_a_second_outcome_of_a_run_replaces_the_first(tmp_path: Path, rows: ReadRows) -> None:
    """As when a cluster has lost sight of a worker and did a run twice."""
    suite = suite_from_text(REAL)

    def engine(tasks: Iterable[Task]) -> Generator[Outcome]:
        for task in tasks:
            for length in (1.0, 2.0):
                yield Outcome(task.key, "ok", "", Figures(found=True, valid=True, path_cost=length))

    folder = ResultsFolder(tmp_path)
    with folder.locked():
        run_suite(suite, folder, engine, version="test")
    assert [row["solution_length"] for row in rows(tmp_path)] == [2.0] * 12
    database = sqlite3.connect(tmp_path / "results.db")
    assert database.execute("SELECT COUNT(*) FROM runs").fetchone() == (12,)
    database.close()
    assert os.listdir(tmp_path).count("results.db-wal") == 0
