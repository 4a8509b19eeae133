"""One process a run: each end has its status, nothing is left behind, nothing leaks into the next run."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from pushplan.bench.executor import local_engine
from pushplan.bench.outcome import STATUSES, Outcome
from pushplan.bench.suite import RunSpec, suite_from_text

HERE = Path(__file__).parent

MESSAGES = {
    "fine": "",
    "no plan": "it is no plan",
    "invalid": "it is invalid",
    "segfault": "killed by SIGSEGV\nFatal Python error: Segmentation fault",
    "abort": "killed by SIGABRT\nFatal Python error: Aborted",
    "leave": "the process ended by itself with exit code 7",
    "killed": "killed by SIGKILL, as the system does when memory runs out",
    "hang": "killed after 3 s",
    "stubborn hang": "killed after 3 s",
    "hog": "100 MB",
    "hog in C": "100 MB",
    "lists": "100 MB",
    "ask too much": "more than 100 MB were asked for",
    "raise": "ValueError: planted\nTraceback",
    "exit": "SystemExit: 3",
    "half a log": "the process ended by itself with exit code 1",
}


DEATHS = ("segfault", "abort", "leave", "killed", "half a log")
"""Fates that are told by an exit code alone."""


def specs(planted: Any, count: int, seconds: int = 3) -> list[RunSpec]:
    text = planted.suite_text(range(count)).replace("run: 3 s", f"run: {seconds} s")
    return list(suite_from_text(text).runs("test"))


def test_each_fate_has_its_status_and_message_and_ends_no_other_run(planted: Any, tmp_path: Path) -> None:
    with local_engine(2, tmp_path, planted.work) as engine:
        found = {outcome.key: outcome for outcome in engine(specs(planted, len(planted.FATES)))}
    for spec in specs(planted, len(planted.FATES)):
        fate, outcome = planted.fate_of(spec.seed), found[spec.key]
        assert (fate, outcome.status) == (fate, planted.STATUS[fate])
        # Now and then the fork server does not tell how a process ended; that it ended is known all the same.
        untold = "the fork server cannot say how" in outcome.message and fate in DEATHS
        assert untold or MESSAGES[fate] in outcome.message
        assert outcome.log == (b"half" if fate == "half a log" else None)
        assert not outcome.whole
        assert "hang" not in fate or 3.0 <= outcome.values["total_time"] < 15.0  # type: ignore[operator]
    assert {outcome.status for outcome in found.values()} == set(STATUSES)
    assert not list(tmp_path.iterdir())


def test_runs_at_the_same_time_are_as_many_as_are_asked_for(planted: Any, tmp_path: Path) -> None:
    for jobs, seconds, statuses in ((1, 1, ["timeout", "timeout"]), (2, 60, ["ok", "ok"])):
        folder = tmp_path / str(jobs)
        folder.mkdir()
        with local_engine(jobs, folder, planted.meet) as engine:
            ends = [outcome.status for outcome in engine(specs(planted, 2, seconds))]
        assert ends == statuses


def test_leaving_kills_what_goes_on_and_leaves_nothing(planted: Any, tmp_path: Path) -> None:
    hang = planted.FATES.index("stubborn hang")
    chosen = [spec for spec in specs(planted, len(planted.FATES)) if spec.seed in (0, hang)]
    with local_engine(2, tmp_path, planted.work) as engine:
        found = engine(chosen)
        assert next(found).status == "ok"
        began = time.monotonic()
        found.close()
    assert time.monotonic() - began < 10.0
    assert not list(tmp_path.iterdir())


def test_runs_end_with_who_wanted_them_even_when_it_is_killed(planted: Any, tmp_path: Path) -> None:
    script = (
        "import sys; from pathlib import Path; import planted_runs\n"
        "from pushplan.bench import executor\n"
        "from pushplan.bench.suite import suite_from_text\n"
        "executor.PRELOAD = 'planted_runs'\n"
        "suite = suite_from_text(planted_runs.suite_text([0]).replace('run: 3 s', 'run: 100 s'))\n"
        "with executor.local_engine(1, Path(sys.argv[1]), planted_runs.leave_number) as engine:\n"
        "    list(engine(suite.runs('test')))\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])}
    path = tmp_path / "number"
    with subprocess.Popen([sys.executable, "-c", script, str(tmp_path)], env=environment) as program:
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


def test_a_real_run_is_planned_validated_and_logged(tmp_path: Path) -> None:
    text = "format: pushplan-suite/1\nproblems: [one-box]\nplanners: [{name: auto, first: true}]\n"
    text += "seeds: 1\ntrials: 3\nlimits: {run: 10 min}\n"
    with local_engine(1) as engine:
        (outcome,) = engine(suite_from_text(text).runs("test"))
    assert (outcome.status, outcome.message, outcome.whole) == ("ok", "", True)
    assert outcome.log is not None
    assert outcome.log.startswith(b"\x89MCAP0\r\n")
    assert 0.0 <= (outcome.values["trial_success"] or 0.0) <= 1.0
    assert 0.0 < (outcome.values["overhead_time"] or 0.0) < (outcome.values["total_time"] or 0.0)
    assert len(outcome.arcs) == outcome.values["solution_segments"]
    assert sum(arc[3] for arc in outcome.arcs) == pytest.approx(outcome.values["solution_length"])


def test_what_a_file_says_wrong_is_an_error_of_the_run() -> None:
    (spec,) = suite_from_text("format: pushplan-suite/1\nproblems: [one-box]\nseeds: 1\n").runs("test")
    object.__setattr__(spec.problem, "source", b"format: pushplan/1\n")
    with local_engine(1) as engine:
        (outcome,) = engine([spec])
    assert isinstance(outcome, Outcome)
    assert outcome.status == "error"
    assert outcome.message.startswith("ScenarioError: one-box.yaml:1:1: floor: is missing")
