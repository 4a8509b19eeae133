"""Suites of several pushes: random rooms with a robot beside the chain, judged by where robot and objects are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pushplan.bench.processes.validation import clearance, flaw, with_kept_margin
from pushplan.bench.random_problems.generator import generate
from pushplan.bench.random_problems.parameters import DRIVES, GeneratorError, ProblemParameters
from pushplan.plan import plan
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import CircleObstacle

ROOMS = ProblemParameters(objects=(1, 1), obstacles=(2, 4), drives=DRIVES, robot=(0.5, 1.0))


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_stands_as_far_away_as_is_asked_for(seed: int) -> None:
    scenario = scenario_from_text(generate(ROOMS, seed))
    assert scenario.pushes is not None
    away = float(np.hypot(*(scenario.pushes.robot_start - scenario.start)[:2]))
    assert 0.499 < away < 1.001
    assert scenario.chain.pusher.footprint


def test_a_room_without_a_place_for_the_robot_is_told() -> None:
    with pytest.raises(GeneratorError, match="places for the robot"):
        generate(replace(ROOMS, workspace=(3.0, 3.0), robot=(50.0, 60.0)), 1)


def test_an_execution_is_judged_by_where_the_objects_are() -> None:
    """An obstacle where the chain would be if the robot held it all the time is none in the way."""
    scenario = scenario_from_text(generate(replace(ROOMS, obstacles=(0, 0)), 1))
    result = plan(scenario, first=True, time_limit=60.0)
    assert result.solved
    assert result.execution is not None
    kept = with_kept_margin(scenario, result)
    assert flaw(kept, result.execution) == ""
    free = clearance(kept, result.execution)
    assert free is not None
    assert free > 0.0
    middle = result.execution.load_poses[len(result.execution.t) // 2, :2]
    hit = replace(kept, obstacles=(CircleObstacle(middle, 0.02),))
    assert "meets obstacle 0" in flaw(hit, result.execution)
