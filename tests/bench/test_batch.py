"""Batches: every run ends up as one row, whatever happens to it, to the batch, and in whatever order."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any

import pytest

from pushplan.bench.batch import Selection, Tally, run_suite
from pushplan.bench.executor import local_engine
from pushplan.bench.outcome import Outcome, perform
from pushplan.bench.store import ResultsFolder, StoreError
from pushplan.bench.suite import RunSpec, Suite, suite_from_text

HERE = Path(__file__).parent

Rows = list[dict[str, Any]]
ReadRows = Callable[[Path], Rows]

REAL = """\
format: pushplan-suite/1
problems: [one-box, {name: random, generate: {objects: 2, obstacles: 5}, count: 1}]
planners: [auto, {name: rrt, first: true}]
seeds: 2
limits: {time: 20 s, iterations: 3000}
"""

PROGRAM = """\
import sys
from pathlib import Path
from planted_runs import work
from pushplan.bench import executor
from pushplan.bench.batch import Selection, run_suite
from pushplan.bench.store import ResultsFolder
from pushplan.bench.suite import load_suite
executor.PRELOAD = "planted_runs"
folder = ResultsFolder(Path(sys.argv[1]))
with folder.locked(), executor.local_engine(2, folder.scratch, work) as engine:
    run_suite(load_suite(Path(sys.argv[2])), folder, engine, Selection(resume=True),
              lambda tally: print(tally.done, flush=True), "test")
"""


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
    """What a run's seed decides; when it was done and how long it took are chance."""
    return [(row["key"], row["outcome"], row["solution_length"], row["arcs"]) for row in found]


def test_a_batch_killed_at_random_and_resumed_has_the_same_rows(
    planted: Any, tmp_path: Path, rows: ReadRows
) -> None:
    seeds, rng = range(14, 21), random.Random(1)  # one that hangs, and three more that go wrong, among them
    (tmp_path / "suite.yaml").write_text(planted.suite_text(seeds))
    folder = tmp_path / "results"
    command = [sys.executable, "-c", PROGRAM, str(folder), str(tmp_path / "suite.yaml")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])}
    before: Rows = []
    while len(before) in (0, len(seeds)):  # also where this process was held up until all was done
        shutil.rmtree(folder, ignore_errors=True)
        for sign in (signal.SIGKILL, signal.SIGTERM):
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
    _check_planted(after, planted, seeds)
    assert not (folder / ".scratch").exists()
    (half,) = (row for row in after if planted.fate_of(row["seed"]) == "half a log")
    assert half["log"] == f"logs/one-box-auto-ecof-{half['seed']}-{half['key'][:8]}.mcap.partial"
    assert (folder / half["log"]).read_bytes() == b"half"


def test_one_job_and_two_resumed_jobs_give_the_same_costs_and_arcs(tmp_path: Path, rows: ReadRows) -> None:
    suite = suite_from_text(REAL)
    _run(suite, tmp_path / "1", 1)
    some = _run(suite, tmp_path / "2", selection=Selection(filters=("problem=one-box", "planner=rrt")))
    assert (some.total, some.done) == (2, 2)
    rest = _run(suite, tmp_path / "2", selection=Selection(resume=True))
    assert (rest.total, rest.before, rest.done, rest.left) == (8, 2, 6, 0)
    one, two = rows(tmp_path / "1"), rows(tmp_path / "2")
    assert _results(one) == _results(two)
    assert len(one) == 8
    assert sum(row["outcome"] == "ok" for row in one) >= 5
    assert len({row["log"] for row in one}) == 8
    assert all((tmp_path / "1" / row["log"]).read_bytes().startswith(b"\x89MCAP0\r\n") for row in one)
    (tmp_path / "1" / one[2]["log"]).unlink()
    tally = _run(suite, tmp_path / "1", selection=Selection(rerun=one[2]["key"][:8]))
    assert (tally.total, tally.done) == (1, 1)
    assert _results(rows(tmp_path / "1")) == _results(one)
    assert (tmp_path / "1" / one[2]["log"]).exists()
    assert (tmp_path / "1" / "suite.yaml").read_bytes() == suite.source
    assert (tmp_path / "1" / "problems" / "one-box.yaml").read_bytes() == suite.problems[0].source


def test_results_are_not_mixed_by_mistake(tmp_path: Path) -> None:
    suite = suite_from_text(REAL)

    def engine(specs: Iterable[RunSpec]) -> Generator[Outcome]:
        yield from (Outcome(spec.key, "no plan") for spec in specs)

    folder = ResultsFolder(tmp_path)
    with folder.locked():
        run_suite(suite, folder, engine, version="test")
        with pytest.raises(
            StoreError, match="has the results of 8 runs; go on with --resume, or name another"
        ):
            run_suite(suite, folder, engine, version="test")
        with (
            pytest.raises(StoreError, match="another benchmark writes into"),
            ResultsFolder(tmp_path).locked(),
        ):
            pass
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(StoreError, match="is a file; allowed: a folder, which may be new"),
        ResultsFolder(tmp_path / "file").locked(),
    ):
        pass
