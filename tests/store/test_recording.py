"""A run is recorded as it grows; what keeps the log from being written never costs the plan."""

from pathlib import Path

import pytest
from store.conftest import Case

from pushplan.errors import OutputError
from pushplan.logging.recording import IncompleteLogError, Recording
from pushplan.logging.runs import runs_of
from pushplan.verification import verify_log


def test_a_recorded_run_is_found_in_the_folder_and_verified(cases: dict[str, Case], tmp_path: Path) -> None:
    plan = cases["rearrangement"].plan
    with Recording(plan.scenario, {"seed": 7, "planner": plan.planner}, runs=tmp_path) as recording:
        for improvement in plan.improvements:
            recording.improved(improvement)
        recording.end(plan)
    run = recording.finished(plan)
    assert run.log is not None
    assert run.log.parent == tmp_path
    assert verify_log(run.log).matches
    (entry,) = runs_of(tmp_path)
    assert (entry.outcome, entry.seed, entry.cost) == ("solved", "7", plan.cost)


def test_a_log_that_cannot_be_written_is_an_error_only_where_it_was_named(
    cases: dict[str, Case], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = cases["push"].plan
    with pytest.raises(OutputError, match="there is no folder"):
        Recording(plan.scenario, {"seed": 1}, tmp_path / "no" / "run.mcap")

    def full(*_: object) -> None:
        raise OutputError("the log", "No space left on device")

    monkeypatch.setattr("pushplan.logging.writer.RunLogWriter.plan", full)
    told: list[str] = []
    with Recording(plan.scenario, {"seed": 1}, runs=tmp_path, message=told.append) as recording:
        recording.end(plan)
    assert recording.finished(plan).log is None
    assert "this run is not recorded: the log: No space left" in told[0]
    with Recording(plan.scenario, {"seed": 1}, tmp_path / "run.mcap") as recording:
        recording.end(plan)
    with pytest.raises(IncompleteLogError, match=r"what was written .*run\.mcap\.partial") as caught:
        recording.finished(plan)
    assert caught.value.run.plan is plan
