"""The process from which runs are forked may be killed or stopped at any moment: batches go on, rows are right."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import pytest

from pushplan.bench.processes import fork_server
from pushplan.bench.processes.fork_server import ForkServer, ForkServerError, Supervisor
from pushplan.bench.processes.isolation import ATTEMPTS, IsolatedRun
from pushplan.bench.processes.local import local_outcomes
from pushplan.bench.processes.outcome import Outcome, Task

MakeTask = Callable[..., Task]

PATIENCE = 120.0
"""Seconds after which a test gives up; no test measures time."""


@pytest.fixture
def server(
    planted: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[], ForkServer]]:
    """Return what gives the server that is asked now, of a supervisor that soon gives up a server that was stopped.

    One that is only slow, as on a busy machine, is waited for.
    """
    silent = ForkServer.silent

    def stopped_and_silent(asked: ForkServer, since: float) -> bool:
        return silent(asked, since) and (asked.process.poll() is not None or asked._stopped())

    monkeypatch.setattr(fork_server, "ANSWER", 0.5)
    monkeypatch.setattr(ForkServer, "silent", stopped_and_silent)
    made = Supervisor("planted_runs")
    monkeypatch.setattr("pushplan.bench.processes.isolation.supervisor", lambda: made)
    made.prepare()
    yield lambda: made.server
    made.server.end()


def _until(run: IsolatedRun, condition: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert run.poll() is None
        assert time.monotonic() < end
        wait(run.handles, timeout=0.01)


def _to_end(run: IsolatedRun) -> Outcome:
    end = time.monotonic() + PATIENCE
    while (outcome := run.poll()) is None:
        assert time.monotonic() < end
        wait(run.handles, timeout=0.01)
    return outcome


def _go(run: Path) -> None:
    (run.parent / "go").touch()


@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP])
@pytest.mark.parametrize("moment", ["before", "while it goes on", "before it dies"])
def test_a_run_ends_as_it_would_have_when_its_server_is_lost(
    sign: signal.Signals,
    moment: str,
    server: Callable[[], ForkServer],
    planted: Any,
    make_task: MakeTask,
    tmp_path: Path,
) -> None:
    """A run that ends well keeps its process; one whose exit code nobody knows is begun anew."""
    first = server().process
    if moment == "before":
        first.send_signal(sign)
    work = planted.end_badly if moment == "before it dies" else planted.end_well
    run = IsolatedRun(make_task(7), tmp_path, work)
    _until(run, lambda: list(tmp_path.glob("waits-*")))
    before = run.process
    if moment != "before":
        first.send_signal(sign)
    _go(run._folder)
    outcome = _to_end(run)
    if moment == "before it dies":
        assert (outcome.status, outcome.message) == ("crash", "the process ended by itself with exit code 7")
    else:
        assert (outcome.status, outcome.figures.path_cost) == ("ok", 7.0)
        assert len(list(tmp_path.glob("waits-*"))) == 1
    assert (server().process is first) == (moment == "while it goes on")
    assert not _lives(before)


@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGSTOP])
def test_a_run_beyond_its_time_is_killed_without_its_server(
    sign: signal.Signals,
    server: Callable[[], ForkServer],
    planted: Any,
    make_task: MakeTask,
    tmp_path: Path,
) -> None:
    run = IsolatedRun(make_task(1, seconds=1.0), tmp_path, planted.end_well)
    _until(run, lambda: run.process is not None)
    server().process.send_signal(sign)
    number = run.process
    assert _to_end(run).status == "timeout"
    assert not _lives(number)
    assert [path.name for path in tmp_path.iterdir()] == [f"waits-{number}"]


def _lives(number: int | None) -> bool:
    """Tell whether a process runs; what is left of one without a parent, init takes when it likes."""
    try:
        words = Path(f"/proc/{number}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return words.rpartition(")")[2].split()[0] != "Z"


def test_a_run_that_ends_its_servers_is_a_crash(
    server: Callable[[], ForkServer], planted: Any, make_task: MakeTask, tmp_path: Path
) -> None:
    first = server()
    outcome = _to_end(IsolatedRun(make_task(1), tmp_path, planted.end_server))
    assert outcome.status == "crash"
    assert (
        outcome.message == f"the process from which runs are forked was lost {ATTEMPTS} times during this run"
    )
    assert server() is not first
    assert not list(tmp_path.iterdir())


def test_a_batch_goes_on_when_servers_are_lost(
    server: Callable[[], ForkServer], planted: Any, make_task: MakeTask, tmp_path: Path
) -> None:
    count = 2 * len(planted.FATES)
    tasks = [make_task(seed, seconds=float(planted.SECONDS), megabytes=100.0) for seed in range(count)]
    outcomes = {}
    for i, outcome in enumerate(local_outcomes(tasks, 2, tmp_path, planted.work)):
        outcomes[outcome.key] = outcome.status
        if i % 5 == 0:
            server().process.send_signal(signal.SIGKILL if i % 2 else signal.SIGSTOP)
    assert outcomes == {f"key{seed}": planted.STATUS[planted.fate_of(seed)] for seed in range(count)}


def test_a_server_that_is_stopped_while_it_loads_is_replaced(
    planted: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fork_server, "ANSWER", 0.5)
    supervisor = Supervisor("planted_runs")
    first = supervisor.server
    first.process.send_signal(signal.SIGSTOP)
    supervisor.prepare()
    assert supervisor.server is not first
    assert first.process.returncode == -signal.SIGKILL
    supervisor.server.end()


def test_a_server_that_cannot_start_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    supervisor = Supervisor("no_such_module")
    with pytest.raises(
        ForkServerError, match="lost 5 times before it was ready, the last time with exit code 1"
    ):
        supervisor.prepare()
    assert "No module named 'no_such_module'" in capfd.readouterr().err
    with pytest.raises(ForkServerError, match="lost 5 times"):  # not once and for all: it is tried again
        supervisor.prepare()


@pytest.mark.parametrize("sign", [0, signal.SIGSTOP])
def test_a_server_ends_with_its_supervisor_even_when_it_is_stopped(sign: int) -> None:
    """The kernel lets go of stopped processes whose parent is gone, once they have stopped."""
    script = (
        "import os, sys; from pushplan.bench.processes.fork_server import Supervisor\n"
        "supervisor = Supervisor('planted_runs'); supervisor.prepare()\n"
        f"server = supervisor.server.process.pid; os.kill(server, {int(sign)})\n"
        "def state(task): return open(f'/proc/{server}/task/{task}/stat').read().rpartition(')')[2].split()[0]\n"
        f"while {int(sign)} and any(state(task) != 'T' for task in os.listdir(f'/proc/{{server}}/task')): pass\n"
        "print(supervisor.server.process.pid, flush=True); os.kill(os.getpid(), 9)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    done = subprocess.run([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, env=environment)
    end = time.monotonic() + PATIENCE
    while _lives(int(done.stdout)):
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize("patience", [0.0, 600.0])
def test_servers_that_are_killed_while_they_load_are_replaced_for_some_time(
    planted: Any, monkeypatch: pytest.MonkeyPatch, patience: float
) -> None:
    monkeypatch.setattr(fork_server, "KILLED", patience)
    supervisor = Supervisor("planted_runs")

    def kill() -> None:
        server = supervisor.server
        server.process.kill()
        server.process.wait()
        supervisor.replace(server)

    for _ in range(fork_server.ATTEMPTS - 1):
        kill()
    if patience:
        for _ in range(3):
            kill()
    else:
        with pytest.raises(ForkServerError, match=r"lost 5 times before .* exit code -9"):
            kill()
    supervisor.prepare()
    supervisor.server.end()
