"""Plans of a suite that are tried in sampled worlds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pushplan.bench.processes.outcome import Task
from pushplan.bench.processes.work import perform
from pushplan.bench.suites.file import SuiteError, suite_from_text

SUITE = "format: pushplan-suite/1\nproblems: [one-box]\nseeds: 1\n"


def test_a_suite_that_asks_for_trials_asks_for_other_runs() -> None:
    plain, tried = (next(iter(suite_from_text(SUITE + more).runs("1"))) for more in ("", "trials: 30\n"))
    assert (plain.trials, tried.trials) == (0, 30)
    assert plain.key != tried.key


def test_wrong_numbers_of_trials_are_findings() -> None:
    with pytest.raises(SuiteError, match=r"suite\.yaml:4:9: trials: is 0"):
        suite_from_text(SUITE + "trials: 0\n")


def test_a_run_tries_its_plan(make_task: Callable[..., Task], tmp_path: Path) -> None:
    figures = perform(make_task(1, trials=5), tmp_path)
    assert figures.trial_success is not None
    assert 0.0 <= figures.trial_success <= 1.0
    assert figures.seconds["trials"] > 0.0
