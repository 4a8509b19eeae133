"""Solved means executed: a plan that loses a contact when it is driven is no solution, whoever asks."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pushplan.cli.main import main
from pushplan.mechanics.chain import Limits
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.planners.planner import plan
from pushplan.planners.timing.arc_limits import Bounds
from pushplan.planners.timing.exact_timing import time_path
from pushplan.plans.judge import judging_set, planning_set
from pushplan.plans.path import PushPath
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario
from pushplan.sets.named import stable_set
from pushplan.sets.stable_set import StableSet

ITERATIONS = 4000
FAST = Limits(5.0, 50.0, 2000.0, 50.0, 500.0, 2e4)


def too_fast(
    scenario: Scenario, path: PushPath, stable: StableSet, bounds: Bounds, rate: float, scene: object
) -> SimpleNamespace:
    return SimpleNamespace(trajectory=time_path(path, Bounds(FAST), rate))


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every path is driven much too fast for its contacts."""
    monkeypatch.setattr("pushplan.planners.planner.blend_path", too_fast)


def test_a_plan_in_cof_is_cut_down_to_what_the_judge_accepts() -> None:
    scenario = load_scenario("one-box")
    result = plan(scenario, stable_set="cof", time_limit=60.0, iterations=ITERATIONS)
    assert result.solved, result.reason
    assert result.stable_set == "cof"
    assert result.execution is not None
    assert result.execution.loss is None
    assert result.path is not None
    assert result.margin is not None
    for name in ("ecof", "cof"):
        assert stable_set(scenario.chain, name).margin(result.path.twists).min() > result.margin
    own = result.segments[0].contact_trajectory
    found = dynamic_margins(scenario.chain, own.directions, own.rates_at(own.t))
    assert found.min() == pytest.approx(result.min_dynamic_margin)
    assert found.min() > 0.0


def test_the_set_to_plan_in_is_what_both_sets_have_in_common() -> None:
    scenario = load_scenario("one-box")
    rng = np.random.default_rng(3)
    twists = rng.normal(size=(3000, 3)) * [0.2, 0.4, 2.0] + [1.0, 0.0, 0.0]
    cof, ecof = (stable_set(scenario.chain, name) for name in ("cof", "ecof"))
    both = planning_set(scenario, "cof")
    np.testing.assert_array_equal(both.margin(twists), np.minimum(cof.margin(twists), ecof.margin(twists)))
    assert ((cof.margin(twists) > 0.0) & (ecof.margin(twists) <= 0.0)).sum() > 10  # there is something to cut
    assert judging_set(scenario, "cof").name == "ecof"
    for name in ("ecof", "stable", "robust"):
        assert planning_set(scenario, name).name == name


def test_the_command_says_so_in_words_in_json_in_the_log_and_by_its_exit_code(
    hurried: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "run.mcap"
    words = ["--iterations", str(ITERATIONS), "--time-limit", "60", "--json", "-o", str(log)]
    assert main(["plan", "two-crates", *words]) == 3
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert found["solved"] is False
    assert found["reason"].startswith("the plan does not hold when it is executed: ")
    assert "two-crates: not solved" in said.err
    assert main(["replay", str(log)]) == 0
    assert "two-crates: not solved" in capsys.readouterr().out
