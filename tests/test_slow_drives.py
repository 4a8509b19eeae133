"""Drives that take very long: they are sampled by a budget, and their logs are read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

import pushplan
from pushplan.cli.main import main
from pushplan.logging import shown
from pushplan.logging.shown import smoothed_times, viewed
from pushplan.planners.clearance import MOST
from pushplan.plans import trajectory as trajectories
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import example_text

MOST_SAMPLES, MOST_VIEWED = 2_000, 1_500


@pytest.fixture(autouse=True)
def _fewer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Still more samples than viewers are shown."""
    monkeypatch.setattr(trajectories, "MOST_SAMPLES", MOST_SAMPLES)
    monkeypatch.setattr(shown, "MOST_VIEWED", MOST_VIEWED)


def _with_limit(name: str, limit: tuple[str, float], path: Path) -> Path:
    stated = yaml.safe_load(example_text(name))
    key, value = limit
    stated["pusher"].setdefault("limits", {})[key] = value
    path.write_text(yaml.safe_dump(stated), "utf-8")
    return path


def test_the_log_of_a_slow_drive_is_read_and_verified(tmp_path: Path) -> None:
    file = _with_limit("feet", ("acceleration", 3e-4), tmp_path / "slow.yaml")
    log = tmp_path / "slow.mcap"
    assert main(["plan", str(file), "-o", str(log), "--first", "--time-limit", "60"]) == 0
    plan = pushplan.read_run(log).plan
    assert plan is not None
    assert (plan.duration or 0.0) > 600.0
    assert main(["replay", str(log), "--verify"]) == 0


def test_a_drive_of_hours_has_a_bounded_number_of_exact_samples(tmp_path: Path) -> None:
    file = _with_limit("one-box", ("speed", 1e-3), tmp_path / "slow.yaml")
    result = pushplan.plan(pushplan.load_scenario(file), first=True, time_limit=60.0)
    assert result.trajectory is not None
    assert result.execution is not None
    assert result.trajectory.duration > 3600.0
    assert len(result.trajectory.t) <= MOST_SAMPLES + 2
    assert len(result.execution.t) == len(result.trajectory.t)
    assert 0.9 * MOST_VIEWED < len(viewed(result.execution)) <= MOST_VIEWED + 3
    assert len(smoothed_times(result.trajectory)) <= MOST_VIEWED + 2
    assert result.trajectory.t[-1] == result.trajectory.duration
    assert np.max(result.execution.goal_error) < 1e-9


def test_a_push_of_a_day_is_judged_by_a_bounded_number_of_poses_and_its_log_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stated = yaml.safe_load(example_text("free-space"))
    stated["pusher"].setdefault("limits", {})["speed"] = 0.01
    stated["goal"] = {"pose": [900.0, 0.0, 0.0]}
    looked, log = list[int](), tmp_path / "day.mcap"
    poses_at = Trajectory.poses_at

    def counted(way: Trajectory, t: np.ndarray) -> np.ndarray:
        looked.append(np.size(t))
        return poses_at(way, t)

    monkeypatch.setattr(Trajectory, "poses_at", counted)
    result = pushplan.run(pushplan.scenario_from_document(stated), log=log, first=True, time_limit=60.0)
    assert (result.plan.duration or 0.0) > 86_400.0
    assert max(looked) <= MOST
    assert pushplan.verify_log(log).matches


@pytest.mark.parametrize("duration", [1.0, 1234.5])
def test_samples_are_evenly_spaced(duration: float) -> None:
    moving = np.array([[[1.0, 0.0, 0.1], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]])
    t = Trajectory(np.zeros(3), np.array([0.0, duration]), moving, np.zeros(1)).t
    assert (t[0], t[-1]) == (0.0, duration)
    np.testing.assert_allclose(np.diff(t)[:-1], max(0.01, duration / MOST_SAMPLES), rtol=1e-6)
