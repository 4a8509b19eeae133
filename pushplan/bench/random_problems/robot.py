"""A robot that stands somewhere beside the chain: a push problem becomes one of several pushes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pushplan.bench.random_problems.parameters import GeneratorError, Range
from pushplan.bench.random_problems.scenario_yaml import scenario_yaml
from pushplan.errors import ScenarioError
from pushplan.mechanics.chain import Chain
from pushplan.scenario.file import scenario_from_text

TRIES = 50
"""Places that are tried."""

BODY = 1.2
"""Length of the robot's body over the width of its plate."""


def robot_beside(
    rng: np.random.Generator, stated: Mapping[str, object], chain: Chain, away: Range
) -> dict[str, object]:
    """Return the section `robot` of a problem: a body behind the plate, and a free place.

    Args:
        rng: Random numbers.
        stated: The problem without it.
        chain: Of the problem.
        away: How far the plate is from the middle of the chain's first contact, m.

    Raises:
        GeneratorError: When no place is free.
    """
    plate, start = np.ptp(chain.pusher.outline, axis=0), stated["start"]
    assert isinstance(start, list)
    length = round(float(BODY * plate[1]), 4)
    footprint = {
        "box": [length, round(float(plate[1]), 4)],
        "pose": [-round(0.5 * length + float(plate[0]), 4), 0.0, 0.0],
    }
    for _ in range(TRIES):
        way, heading = rng.uniform(-np.pi, np.pi, 2)
        place = np.array(start[:2]) + rng.uniform(*away) * np.array([np.cos(way), np.sin(way)])
        robot = {"footprint": footprint, "start": np.round([*place, heading], 4).tolist()}
        try:
            scenario_from_text(scenario_yaml({**stated, "robot": robot}))
        except ScenarioError:
            continue
        return {"robot": robot}
    raise GeneratorError(
        f"none of {TRIES} places for the robot is free; allowed: a larger workspace or robot distance"
    )
