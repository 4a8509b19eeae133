"""One process a run: each end has its status, nothing is left behind, nothing leaks into the next run."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pushplan.bench.processes.child import _end_with
from pushplan.bench.processes.fork_server import supervisor
from pushplan.bench.processes.isolation import IsolatedRun, isolated
from pushplan.bench.processes.outcome import STATUSES, Outcome, Task

MakeTask = Callable[..., Task]


def _outcome(planted: Any, make_task: MakeTask, fate: str, folder: Path) -> Outcome:
    seconds = 1.0 if "hang" in fate else 30.0
    task = make_task(planted.FATES.index(fate), seconds=seconds, megabytes=100.0)
    return isolated(task, folder, planted.work)


@pytest.mark.parametrize(
    ("fate", "message"),
    [
        ("fine", ""),
        ("no plan", "there is none"),
        ("invalid", "it slips"),
        ("segfault", "killed by SIGSEGV\nFatal Python error: Segmentation fault"),
        ("abort", "killed by SIGABRT\nFatal Python error: Aborted"),
        ("leave", "the process ended by itself with exit code 7"),
        ("killed", "killed by SIGKILL, as the system does when memory runs out"),
        ("hang", "killed after 1 s"),
        ("stubborn hang", "killed after 1 s"),
        ("hog", "100 MB"),
        ("hog in C", "100 MB"),
        ("lists", "100 MB"),
        ("ask too much", "more than 100 MB were asked for"),
        ("raise", "ValueError: planted\nTraceback"),
        ("exit", "SystemExit: 3"),
        ("half a log", "the process ended by itself with exit code 1"),
    ],
)
def test_every_end_has_its_status(
    fate: str, message: str, planted: Any, make_task: MakeTask, tmp_path: Path
) -> None:
    supervisor().prepare()
    outcome = _outcome(planted, make_task, fate, tmp_path)
    assert outcome.status == planted.STATUS[fate]
    assert outcome.status in STATUSES
    assert message in outcome.message
    assert not list(tmp_path.iterdir())


def test_what_a_killed_run_had_logged_is_kept(planted: Any, make_task: MakeTask, tmp_path: Path) -> None:
    outcome = _outcome(planted, make_task, "half a log", tmp_path)
    assert (outcome.log, outcome.whole) == (b"half", False)


def test_a_real_run_comes_back_with_its_log_and_figures(make_task: MakeTask, tmp_path: Path) -> None:
    began = time.monotonic()
    outcome = isolated(make_task(3), tmp_path)
    seconds = time.monotonic() - began
    figures = outcome.figures
    assert outcome.status == "ok"
    assert outcome.whole
    assert outcome.log is not None
    assert outcome.log.startswith(b"\x89MCAP0\r\n")
    assert figures.path_cost == pytest.approx(sum(arc[3] for arc in figures.arcs))
    assert figures.valid
    assert figures.clearance is not None
    assert figures.clearance > 0.0
    assert figures.memory is not None
    assert 1.0 < figures.memory < 150.0
    assert figures.margin is not None
    assert 0.0 < figures.margin <= 0.05
    assert figures.min_margin is not None
    assert figures.min_margin > figures.margin
    assert figures.min_dynamic_margin is not None
    assert figures.min_dynamic_margin > 0.5 * figures.margin
    phases = {"loading", "posing", "search", "timing", "checking", "execution", "logging", "validation"}
    assert set(figures.seconds) == phases
    assert 0.0 < outcome.seconds < seconds
    assert 0.0 < sum(figures.seconds.values()) < seconds


def test_the_same_seed_gives_the_same_arcs_in_another_process(make_task: MakeTask) -> None:
    first, second, other = (isolated(make_task(seed, iterations=2000)) for seed in (5, 5, 6))
    assert first.figures.arcs == second.figures.arcs != other.figures.arcs


def test_an_unreadable_problem_is_an_error(make_task: MakeTask) -> None:
    task = make_task(1)
    broken = Task(**{**vars(task), "source": b"format: pushplan/1\n"})
    outcome = isolated(broken)
    assert outcome.status == "error"
    assert outcome.message.startswith("ScenarioError: one-box.yaml:1:1: floor: is missing")


def test_a_stopped_run_leaves_nothing(planted: Any, make_task: MakeTask, tmp_path: Path) -> None:
    run = IsolatedRun(make_task(planted.FATES.index("hang")), tmp_path, planted.work)
    assert run.poll() is None
    assert len(list(tmp_path.iterdir())) == 1
    run.stop()
    assert not list(tmp_path.iterdir())


def test_runs_die_with_their_supervisor_even_when_it_is_killed(tmp_path: Path) -> None:
    """A hanging run must not go on for ever when the benchmark was killed."""
    script = (
        "import sys, time; from pathlib import Path; from types import SimpleNamespace\n"
        "from pushplan.bench.processes.isolation import IsolatedRun\n"
        "from planted_runs import FATES, work\n"
        "task = SimpleNamespace(seed=FATES.index('stubborn hang'), key='k', seconds=99.0, megabytes=99.0)\n"
        "run = IsolatedRun(task, Path(sys.argv[1]), work)\n"
        "while run.process is None: run.poll(); time.sleep(0.01)\n"
        "print(run.process, flush=True); time.sleep(99.0)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    command = [sys.executable, "-c", script, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as supervisor:
        assert supervisor.stdout is not None
        number = int(supervisor.stdout.readline())
        time.sleep(0.5)  # past the beginning of the run
        os.kill(number, 0)
        supervisor.send_signal(signal.SIGKILL)
    end = time.monotonic() + 60.0
    with contextlib.suppress(ProcessLookupError):
        while time.monotonic() < end:
            os.kill(number, 0)
            time.sleep(0.05)
        pytest.fail("the run outlives its supervisor")


def test_a_run_whose_supervisor_is_gone_before_it_begins_ends_at_once() -> None:
    """The closing of the pipe from the supervisor is not seen then, only that it is closed."""
    reader, writer = os.pipe()
    os.close(writer)
    child = os.fork()
    if child == 0:
        _end_with(reader)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGIO
    os.close(reader)
