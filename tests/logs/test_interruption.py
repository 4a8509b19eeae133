"""Ctrl-C, kills and full disks: the best path known at that moment is kept, told and replayed."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interrupts import heed_interrupts, interrupts_heeded
from pushplan.logging.old.cut_off import with_best_path
from pushplan.logging.old.messages import plan_message, schemas
from pushplan.logging.old.messages.recorded import RecordedRun
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.verify import verify
from pushplan.plans.result import ProgressPoint

import pushplan
from pushplan.cli.main import main
from pushplan.errors import RunLogError
from pushplan.util.interruption import Interruption

Captured = pytest.CaptureFixture[str]

PATIENT = 60.0
"""Time limit of searches that end by something else, s."""

ENDLESS = ("two-crates", "--time-limit", "86400")
"""A plan that is sought for minutes: without a better path a search ends the later, the more time it has."""


def assert_best(run: RecordedRun, point: ProgressPoint) -> None:
    """Check that the log's best path is the one of an improvement, bit for bit."""
    assert run.best_path is not None
    assert point.path is not None
    for name in ("start", "twists", "lengths"):
        np.testing.assert_array_equal(getattr(run.best_path, name), getattr(point.path, name))
    assert run.progress[-1] == point


def test_every_improvement_is_in_the_log_when_it_is_told(tmp_path: Path) -> None:
    """Read at that moment, as a kill would leave it."""
    log, seen = tmp_path / "run.mcap", []

    def improved(point: ProgressPoint) -> None:
        run = read_run(tmp_path / "run.mcap.partial")
        assert run.outcome == "cut off"
        assert_best(run, point)
        seen.append(run.progress)

    scenario = pushplan.load_scenario("two-crates")
    done = pushplan.run(scenario, log=log, time_limit=PATIENT, iterations=20_000, progress=improved)
    assert len(seen) > 3
    whole = read_run(log)
    assert whole.progress == done.plan.progress == seen[-1]
    costs = [point.cost for point in whole.progress]
    assert all(
        point.path is not None and point.path.cost == pytest.approx(point.cost) for point in whole.progress
    )
    assert min(costs) <= costs[0]


@pytest.mark.parametrize("planner", ["auto", "rrt", "sst", "rrt-dubins"])
def test_a_search_told_to_stop_ends_at_once_with_its_best_path(planner: str, tmp_path: Path) -> None:
    found: list[ProgressPoint] = []
    scenario = pushplan.load_scenario("two-crates")

    def stop() -> bool:
        return len(found) >= 2

    done = pushplan.run(
        scenario,
        log=tmp_path / "run.mcap",
        planner=planner,
        time_limit=120.0,
        stop=stop,
        progress=found.append,
    )
    assert done.plan.planning_s < 60.0
    assert done.plan.solved
    assert done.plan.path is not None
    costs = np.array([point.cost for point in found])  # the soonest counts: not always the last one
    assert np.abs(costs - done.plan.path.cost).min() < 1e-9
    run = read_run(tmp_path / "run.mcap")
    assert run.outcome == "interrupted"
    assert run.execution is not None
    assert verify(run).matches


def test_a_search_stopped_before_its_first_path_says_so(tmp_path: Path) -> None:
    done = pushplan.run(pushplan.load_scenario("narrow-gap"), log=tmp_path / "run.mcap", stop=lambda: True)
    if done.plan.path is None:
        assert done.plan.reason == "the search was interrupted before it found a path"
    assert read_run(tmp_path / "run.mcap").outcome == "interrupted"


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return what a run leaves that is killed when it has found its third path."""
    log = tmp_path_factory.mktemp("cut") / "run.mcap"
    child = os.fork()
    if child == 0:
        found: list[ProgressPoint] = []

        def improved(point: ProgressPoint) -> None:
            found.append(point)
            if len(found) == 3:
                os.kill(os.getpid(), signal.SIGKILL)

        pushplan.run(pushplan.load_scenario("two-crates"), log=log, time_limit=PATIENT, progress=improved)
        os._exit(0)
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
    return log.with_name("run.mcap.partial")


def test_the_log_of_a_killed_run_replays_with_its_best_path(
    cut: Path, tmp_path: Path, capsys: Captured
) -> None:
    run = read_run(cut)
    assert run.plan is None
    assert len(run.progress) == 3
    assert all(point.seconds > 0.0 for point in run.progress)
    completed = with_best_path(run)
    assert completed.plan is not None
    assert completed.plan.path is run.best_path
    assert completed.execution is not None
    assert completed.execution.loss is None
    assert max(completed.execution.goal_error) < 1e-6
    assert main(["replay", str(cut), "--csv", str(tmp_path / "run.csv"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["outcome"] == "cut off"
    assert told["path_cost"] == pytest.approx(run.progress[-1].cost)
    assert len((tmp_path / "run.csv").read_text().splitlines()) == 1 + len(completed.execution.t)
    assert main(["replay", "--recover", str(cut), str(tmp_path / "clean.mcap")]) == 0
    clean = read_run(tmp_path / "clean.mcap")
    assert clean.losses == ()
    assert_best(clean, run.progress[-1])


def test_a_whole_run_and_one_without_a_path_stay_as_they_are(case: Any, tmp_path: Path) -> None:
    run = read_run(case.write(tmp_path / "run.mcap"))
    assert with_best_path(run) is run


def test_an_exception_in_python_keeps_the_best_path_too(tmp_path: Path) -> None:
    def improved(point: ProgressPoint) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pushplan.run(pushplan.load_scenario("one-box"), log=tmp_path / "run.mcap", progress=improved)
    run = read_run(tmp_path / "run.mcap.partial")
    assert run.outcome == "interrupted"
    assert run.best_path is not None


def test_a_path_that_is_not_what_it_is_said_to_cost_is_refused(case: Any) -> None:
    message = plan_message.encode_progress(ProgressPoint(0.1, case.plan.path.cost, 5, case.plan.path))
    assert plan_message.decode_progress(message).cost == case.plan.path.cost
    message.cost += 0.1
    with pytest.raises(ValueError, match="is said to cost"):
        plan_message.decode_progress(message)
    assert plan_message.decode_progress(schemas.Progress(cost=1.0)).path is None


def test_an_improvement_that_begins_elsewhere_than_the_plan_is_refused(case: Any, tmp_path: Path) -> None:
    path = case.plan.path
    other = replace(path, start=np.add(path.start, [0.0, 1e-9, 0.0]))
    logs = [
        replace(case, plan=replace(case.plan, progress=(ProgressPoint(0.1, path.cost, 5, one),))).write(
            tmp_path / f"{k}.mcap"
        )
        for k, one in enumerate((path, other))
    ]
    assert read_run(logs[0]).plan is not None
    with pytest.raises(RunLogError, match="a path that was found begins elsewhere"):
        read_run(logs[1])


class Planning:
    """`pushplan plan` in a process of its own, recorded into a folder."""

    def __init__(
        self, runs: Path, *words: str, limit: int | None = None, program: tuple[str, str] = ("-m", "pushplan")
    ) -> None:
        def prepare() -> None:
            heed_interrupts()
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        self._runs = runs
        self.process = subprocess.Popen(
            [sys.executable, *program, "plan", *words],
            env={**os.environ, "PUSHPLAN_RUNS": str(runs)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=prepare,
        )

    def wait_for_a_path(self) -> Path:
        """Return the log, once there is a path in it."""
        for _ in range(6000):
            for log in self._runs.glob("*.partial") if self._runs.exists() else ():
                if b"pushplan.progress.0000" in log.read_bytes():
                    time.sleep(
                        0.05
                    )  # the path itself is there, its message comes within the same millisecond
                    return log
            time.sleep(0.01)
        raise AssertionError(self.process.communicate())

    def interrupt(self) -> None:
        self.process.send_signal(signal.SIGINT)

    def end(self) -> tuple[int, str, str]:
        """Return exit code, standard output and standard error."""
        out, error = self.process.communicate(timeout=120.0)
        return self.process.returncode, out, error


def test_ctrl_c_ends_the_search_and_everything_else_goes_on(tmp_path: Path) -> None:
    planning = Planning(tmp_path, *ENDLESS, "--json")
    planning.wait_for_a_path()
    planning.interrupt()
    code, out, error = planning.end()
    assert code == 130
    told = json.loads(out)
    assert told["interrupted"]
    assert told["solved"]
    assert told["goal_error"]["position"] < 1e-6
    assert "Ctrl-C again leaves at once" in error
    assert "this is the best path until then" in error
    assert "Traceback" not in error
    run = read_run(told["log"])
    assert run.outcome == "interrupted"
    assert run.plan is not None
    assert run.plan.path is not None
    assert run.plan.path.cost == told["path_cost"]


def test_a_second_ctrl_c_leaves_at_once(tmp_path: Path) -> None:
    """While the first is being worked off; the log keeps what it has."""
    planning = Planning(tmp_path, *ENDLESS)
    log = planning.wait_for_a_path()
    planning.interrupt()
    while (
        planning.process.stderr is not None
        and "again leaves at once" not in planning.process.stderr.readline()
    ):
        pass
    planning.interrupt()
    code, _, error = planning.end()
    assert code == 130
    assert "Traceback" not in error
    left = log if log.exists() else log.with_suffix("")  # where it was faster than the second one
    assert read_run(left).best_path is not None


TELLS_THAT_IT_LOADS = """\
import os, sys
from pushplan.cli.entry import entry

class Telling:
    def find_spec(self, name, *more):
        if name == "pushplan.cli.main":
            os.write(1, b"loading")

sys.meta_path.insert(0, Telling())
entry()
"""


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.25, 0.5, 1.0])
def test_ctrl_c_while_the_program_loads_leaves_no_traceback(delay: float, tmp_path: Path) -> None:
    """From where its own beginning is over: before, Ctrl-C meets that of Python."""
    planning = Planning(tmp_path, *ENDLESS, program=("-c", TELLS_THAT_IT_LOADS))
    assert planning.process.stdout is not None
    assert planning.process.stdout.read(7) == "loading"
    time.sleep(delay)
    planning.interrupt()
    code, _, error = planning.end()
    assert code == 130
    assert "Traceback" not in error


class Dropping:
    """What a library in C does with an exception of a callback: it says "Exception ignored in ..." and goes on."""

    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)


def test_a_ctrl_c_that_a_library_drops_is_not_lost(capsys: pytest.CaptureFixture[str]) -> None:
    outer, search = Interruption(), Interruption()

    def command() -> None:
        with outer.raising():
            Dropping()
            with search.listening():
                assert search()

    with interrupts_heeded():
        with pytest.raises(KeyboardInterrupt):
            command()
        later = Interruption()
        with later.listening():
            assert not later()
    assert search()
    assert capsys.readouterr().err == ""


def test_a_full_disk_keeps_the_summary_and_names_the_partial_file(tmp_path: Path) -> None:
    log = tmp_path / "run.mcap"
    words = ("two-crates", "--time-limit", "60", "--iterations", "20000", "-o", str(log), "--json")
    code, out, error = Planning(tmp_path / "runs", *words, limit=60_000).end()
    assert code == 1
    told = json.loads(out)
    assert told["solved"]
    assert told["path_cost"] > 0.0
    assert told["log"] is None
    expected = (
        f"{log}: cannot write the file: File too large; what was written of the log is in {log}.partial"
    )
    assert told["error"]["message"] == expected
    assert f"error: {expected}" in error
    assert "optimality gap" in error
    run = read_run(f"{log}.partial")
    assert run.best_path is not None
    assert not log.exists()


def test_ctrl_c_is_left_alone_where_it_is_to_be_ignored() -> None:
    """As under `nohup`, and in the background of a shell."""
    with interrupts_heeded():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        with Interruption().listening():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    with interrupts_heeded():
        interruption = Interruption()
        with interruption.listening():
            os.kill(os.getpid(), signal.SIGINT)
            while not interruption():
                time.sleep(0.001)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_error_that_comes_of_ctrl_c_is_told_as_ctrl_c(
    monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    """What is being imported may turn it into an error of its own."""

    def importing(*_: object) -> Callable[[], None]:
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(10.0)
        except KeyboardInterrupt as error:
            raise ImportError("no module") from error
        raise AssertionError

    monkeypatch.setattr("pushplan.cli.check.run", importing)
    with interrupts_heeded():
        assert main(["check", "two-crates"]) == 130
    assert capsys.readouterr().err == "interrupted\n"
