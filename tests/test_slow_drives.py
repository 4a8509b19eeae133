"""Very long drives: their number of samples is limited, and their logs can be read."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from conftest import Patch

import pushplan
from pushplan.logging import shown
from pushplan.planners.clearance import MOST
from pushplan.plans import trajectory as trajectories
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import example_text

MOST_SAMPLES, MOST_VIEWED = 800, 600


@pytest.fixture(autouse=True)
def _fewer(monkeypatch: Patch) -> None:
    """Use more samples than the viewers' limit."""
    monkeypatch.setattr(trajectories, "MOST_SAMPLES", MOST_SAMPLES)
    monkeypatch.setattr(shown, "MOST_VIEWED", MOST_VIEWED)


def test_a_push_of_one_day_is_checked_with_limited_poses_and_its_log_is_read(
    tmp_path: Path, monkeypatch: Patch
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
