"""The logs of real runs: planned, executed, recorded, read, verified."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pushplan.logging.old.reader import read_run
from pushplan.logging.old.verify import verify

import pushplan
from pushplan.scenario.file import scenario_from_text

DOCUMENTED = {
    "pushplan.run/started_at",
    "pushplan.run/crc32",
    "pushplan.planning/planning_s",
    "pushplan.planning/first_solution_s",
    "pushplan.planning/progress_s",
    "pushplan.planning/extensions",
    "pushplan.planning/crc32",
    "pushplan.result/planning_s",
    "pushplan.result/first_solution_s",
    "pushplan.result/progress_s",
    "pushplan.result/extensions",
    "pushplan.result/finished_at",
    "pushplan.result/crc32",
}


@pytest.mark.parametrize("name", ["one-box", "feet"])
def test_a_run_is_recorded_read_and_verified(
    name: str, tmp_path: Path, assert_same: Callable[[Any, Any], None]
) -> None:
    scenario = pushplan.load_scenario(name)
    done = pushplan.run(scenario, log=tmp_path / "run.mcap", first=True)
    recorded = read_run(tmp_path / "run.mcap")
    assert_same(recorded.plan, done.plan)
    assert_same(recorded.execution, done.execution)
    assert recorded.scenario == scenario
    report = verify(recorded)
    assert report.checks
    assert [check.text for check in report.mismatches] == []


@pytest.mark.parametrize(
    ("settings", "stated"),
    [
        ("uncertainty: {contact_friction: 10 %, floor_friction: 10 %, load: 10 %}", "mass: 1.0"),
        ("stability: {set: robust}", "mass: [0.9, 1.2]"),
    ],
)
def test_a_push_of_uncertain_loads_is_recorded_read_and_verified(
    settings: str, stated: str, tmp_path: Path, assert_same: Callable[[Any, Any], None]
) -> None:
    """With all defaults, so that inertia counts for every value of the intervals."""
    scenario = scenario_from_text(f"""\
format: pushplan/1
floor: {{friction: 0.3}}
objects: [{{name: a, shape: {{box: [0.1, 0.2]}}, {stated}}}]
contacts: {{friction: 0.4}}
pusher: {{width: 0.2, friction: 0.5}}
goal: {{pose: [0.5, 0.05, 10 deg]}}
{settings}
""")
    assert scenario.interval is not None
    assert scenario.chain.pusher.limits.contact == "dynamic"
    done = pushplan.run(scenario, log=tmp_path / "run.mcap", first=True)
    assert done.plan.solved
    assert done.execution is not None
    assert done.execution.min_dynamic_margin is not None
    assert done.plan.margin is not None
    assert done.execution.min_dynamic_margin > 0.5 * done.plan.margin > 0.0
    recorded = read_run(tmp_path / "run.mcap")
    assert_same(recorded.plan, done.plan)
    words = recorded.words["pushplan.result"]
    assert (float(words["margin_asked"]), float(words["margin"])) == (
        done.plan.margin_asked,
        done.plan.margin,
    )
    assert float(words["min_dynamic_margin"]) == done.execution.min_dynamic_margin
    report = verify(recorded)
    assert "margin with inertia" in {check.quantity for check in report.checks}
    assert [check.text for check in report.mismatches] == []


def test_the_same_seed_gives_the_same_bytes(
    tmp_path: Path, differing: Callable[[bytes, bytes], set[str]]
) -> None:
    scenario = pushplan.load_scenario("two-crates")
    logs = []
    for name in ("a.mcap", "b.mcap"):
        pushplan.run(scenario, log=tmp_path / name, seed=3, iterations=6000, time_limit=60.0)
        logs.append((tmp_path / name).read_bytes())
    words = differing(*logs)
    timed = {
        word
        for word in words
        if word.startswith(("pushplan.result/", "pushplan.progress.")) and word.endswith(("_s", "/crc32"))
    }
    assert any(word.startswith("pushplan.progress.0001") for word in words)
    assert words - timed <= DOCUMENTED
    assert words


def test_a_run_that_is_refused_leaves_a_log_that_says_why(tmp_path: Path) -> None:
    text = """\
format: pushplan/1
floor: {friction: 0.3}
objects: [{name: a, shape: {box: [0.1, 0.1]}, mass: 1.0}]
contacts: {friction: 0.3}
pusher: {width: 0.2, thickness: 0.03, friction: 0.0}
goal: {pose: [1.0, 0.0, 0.0]}
"""
    scenario = scenario_from_text(text)
    with pytest.raises(pushplan.PushplanError) as caught:
        pushplan.run(scenario, log=tmp_path / "run.mcap")
    recorded = read_run(tmp_path / "run.mcap")
    assert recorded.outcome == "refused"
    assert recorded.lines[-1].text == str(caught.value)
