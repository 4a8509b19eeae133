"""Packaged scenarios planned once, for the tests of timing: by travel, without a margin and without inertia.

Such paths are the hardest to blend: few metres, sharp corners, twists on the boundary of the stable set.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest

from pushplan.path import PushPath
from pushplan.plan import plan
from pushplan.reading.scenario_file import load_scenario
from pushplan.scenario import Scenario

Planned = Callable[[str], tuple[Scenario, PushPath]]


def _by_travel(scenario: Scenario) -> Scenario:
    """Return the scenario ranked by travel, with a margin of 0, quasi-static contacts and exact timing."""
    pusher = scenario.chain.pusher
    limits = replace(pusher.limits, contact="quasi-static")
    return replace(
        scenario,
        chain=replace(scenario.chain, pusher=replace(pusher, limits=limits)),
        stability=replace(scenario.stability, margin=0.0),
        planner=replace(scenario.planner, cost="travel", arc_price=0.002),
        trajectory="exact",
    )


@cache
def _planned(name: str) -> tuple[Scenario, PushPath]:
    scenario = _by_travel(load_scenario(name))
    path = plan(scenario, seed=1, time_limit=60.0, iterations=20_000).path
    assert path is not None
    return scenario, path


@pytest.fixture(scope="session")
def planned() -> Planned:
    """Return the planner of packaged scenarios."""
    return _planned
