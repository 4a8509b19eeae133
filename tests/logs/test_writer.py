"""What the writer leaves on the disk, whatever happens on the way."""

from __future__ import annotations

import dataclasses
import errno
import math
import os
import resource
import signal
import stat
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pushplan.logging.old.messages.channels import Channels
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.writer import RunLogWriter

from pushplan.errors import OutputError, RunLogError


def in_child(work: Callable[[], None]) -> int:
    """Run `work` in a forked process and return its id."""
    child = os.fork()
    if child:
        return child
    try:
        work()
    finally:
        os._exit(0)


def test_a_finished_log_has_its_final_name_only(case: Any, tmp_path: Path) -> None:
    case.write(tmp_path / "run.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


def test_a_log_is_readable_for_others_as_any_file_that_one_writes(case: Any, tmp_path: Path) -> None:
    (tmp_path / "usual").write_text("")
    case.write(tmp_path / "run.mcap")
    modes = {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert len(modes) == 1


def test_the_start_of_a_run_is_readable_at_once(case: Any, tmp_path: Path) -> None:
    with RunLogWriter.create(tmp_path / "run.mcap", case.scenario, {"seed": 5}) as log:
        run = read_run(log.partial)
        assert run.scenario == case.scenario
        assert run.words["pushplan.run"]["seed"] == "5"
        assert run.outcome == "cut off"
        assert run.plan is None
        assert any("the file ends here, without a footer" in loss for loss in run.losses)
        log.finish("nothing")


def test_an_older_log_stays_until_the_new_one_is_finished(case: Any, tmp_path: Path) -> None:
    path = case.write(tmp_path / "run.mcap")
    before = path.read_bytes()
    with RunLogWriter.create(path, case.scenario, {}) as log:
        log.plan(case.plan)
        assert path.read_bytes() == before
        log.finish("solved")
    assert path.read_bytes() != before


@pytest.mark.parametrize(
    ("error", "outcome"), [(ValueError("the model broke"), "failed"), (KeyboardInterrupt(), "interrupted")]
)
def test_after_an_exception_the_partial_file_stays_and_says_so(
    case: Any, tmp_path: Path, error: BaseException, outcome: str
) -> None:
    path = tmp_path / "run.mcap"
    log = RunLogWriter.create(path, case.scenario, {})

    def plan_and_fail() -> None:
        with log:
            log.plan(case.plan)
            raise error

    with pytest.raises(type(error)):
        plan_and_fail()
    assert [found.name for found in tmp_path.iterdir()] == ["run.mcap.partial"]
    run = read_run(log.partial)
    assert run.outcome == outcome
    assert run.plan is not None
    assert run.losses == ()
    assert run.lines[-1].level == "error"
    assert str(error) in run.words["pushplan.result"]["error"]


def test_without_finish_the_partial_file_stays_and_says_so(case: Any, tmp_path: Path) -> None:
    with RunLogWriter.create(tmp_path / "run.mcap", case.scenario, {}) as log:
        log.plan(case.plan)
    assert [found.name for found in tmp_path.iterdir()] == ["run.mcap.partial"]
    assert read_run(log.partial).outcome == "unfinished"


def test_two_runs_cannot_write_the_same_log(case: Any, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RunLogWriter.create(path, case.scenario, {}) as log:
        with pytest.raises(OutputError, match="cannot create the file: another process is writing it"):
            RunLogWriter.create(path, case.scenario, {})
        log.plan(case.plan)
        log.finish("solved")
    assert read_run(path).plan is not None


def test_what_a_killed_run_left_is_overwritten(case: Any, tmp_path: Path) -> None:
    (tmp_path / "run.mcap.partial").write_bytes(b"old" * 100_000)
    read_run(case.write(tmp_path / "run.mcap"))


def test_a_log_is_never_written_through_a_link(case: Any, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / "run.mcap.partial").symlink_to(victim)
    with pytest.raises(OutputError, match="cannot create the file"):
        RunLogWriter.create(tmp_path / "run.mcap", case.scenario, {})
    assert victim.read_text() == "precious"


def test_a_missing_folder_is_named(case: Any, tmp_path: Path) -> None:
    path = tmp_path / "no" / "run.mcap"
    with pytest.raises(OutputError) as caught:
        RunLogWriter.create(path, case.scenario, {})
    assert str(caught.value) == f"{path}: there is no folder {path.parent}"


def test_a_folder_of_that_name_is_refused(case: Any, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="this is a folder"):
        RunLogWriter.create(tmp_path, case.scenario, {})


@pytest.mark.skipif(sys.platform != "linux", reason="needs a folder that nobody may write to")
def test_a_folder_without_permission_ends_in_a_clear_error(case: Any) -> None:
    with pytest.raises(
        OutputError, match=r"^/sys/run\.mcap: (cannot create the file|nothing may be written)"
    ):
        RunLogWriter.create("/sys/run.mcap", case.scenario, {})


@pytest.mark.parametrize("room", [0, 2_000, 30_000, 60_000])
def test_a_full_disk_ends_in_a_clear_error_and_a_readable_partial_file(
    case: Any, tmp_path: Path, room: int
) -> None:
    def write() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))  # writing beyond fails as on a full disk
        try:
            case.write(tmp_path / "run.mcap")
        except OutputError as error:
            (tmp_path / "message").write_text(str(error)[: room or None]) if room else os._exit(7)
            os._exit(7)

    _, status = os.waitpid(in_child(write), 0)
    assert os.waitstatus_to_exitcode(status) == 7
    assert not (tmp_path / "run.mcap").exists()
    if room:
        message = (tmp_path / "message").read_text()
        assert message == f"{tmp_path / 'run.mcap'}: cannot write the file: {os.strerror(errno.EFBIG)}"
    partial = tmp_path / "run.mcap.partial"
    if room >= 30_000:
        assert read_run(partial).scenario == case.scenario
    else:
        assert not partial.exists()


def test_a_killed_run_keeps_what_was_flushed(
    case: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, assert_same: Callable[[Any, Any], None]
) -> None:
    """Kill a writer at 200 random moments, at more and later ones where it gets on slowly; read what it left."""
    path, flushed = tmp_path / "run.mcap", tmp_path / "flushed"
    flush = Channels.flush

    def telling_flush(channels: Channels) -> None:
        flush(channels)
        with flushed.open("a") as file:
            file.write(".")
        time.sleep(0.001)

    monkeypatch.setattr(Channels, "flush", telling_flush)

    def write_again_and_again() -> None:
        while True:
            flushed.unlink(missing_ok=True)
            case.write(path)

    rng, stages = np.random.default_rng(3), set[int]()
    for kill in range(600):
        if kill >= 200 and len(stages) > 2:
            break
        for leftover in tmp_path.iterdir():
            leftover.unlink()
        child = in_child(write_again_and_again)
        time.sleep(0.001 + rng.uniform(0.0, 0.03 * 4 ** (kill // 200)))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        count = len(flushed.read_text()) if flushed.exists() else 0
        if path.exists():
            assert_same(read_run(path).execution, case.execution)  # never half a file under the final name
        if (tmp_path / "run.mcap.partial").exists() and count:
            stages.add(_check_recovered(case, tmp_path / "run.mcap.partial", count, assert_same))
    assert len(stages) > 2


def _check_recovered(case: Any, partial: Path, count: int, assert_same: Callable[[Any, Any], None]) -> int:
    """Check that a recovered file holds what `count` flushes have written; return how many there were."""
    if partial.stat().st_size == 0:
        return 0  # the next run had just begun
    run = read_run(partial)
    assert run.scenario == case.scenario
    if count >= 2:
        assert run.plan is not None
        assert_same(dataclasses.replace(run.plan, execution=None), case.plan)
    if count >= 3:
        assert run.execution is not None
        samples = len(run.execution.t)
        assert samples >= min(100 * (count - 2), len(case.execution.t))
        assert_same(run.execution.forces, case.execution.forces[:samples])
        assert math.isnan(run.execution.goal_error[0]) or samples == len(case.execution.t)
    return count


def test_time_cannot_run_backwards(case: Any, tmp_path: Path) -> None:
    execution = dataclasses.replace(case.execution, t=case.execution.t - 0.5)
    with (
        pytest.raises(RunLogError, match=r"time -0\.5 s cannot follow 0\.0 s"),
        RunLogWriter.create(tmp_path / "run.mcap", case.scenario, {}) as log,
    ):
        log.execution(execution)
    assert read_run(log.partial).outcome == "failed"


def test_an_unknown_level_is_refused(case: Any, tmp_path: Path) -> None:
    with RunLogWriter.create(tmp_path / "run.mcap", case.scenario, {}) as log:
        with pytest.raises(ValueError, match="level 'verbose' is none of debug, info, warning, error, fatal"):
            log.log("verbose", "text")
        log.finish("nothing")
