"""Packaged scenarios planned once, for the tests of timing."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest

from pushplan.path import PushPath
from pushplan.plan import plan
from pushplan.reading.scenario_file import load_scenario
from pushplan.scenario import Scenario

Planned = Callable[[str], tuple[Scenario, PushPath]]


@cache
def _planned(name: str) -> tuple[Scenario, PushPath]:
    scenario = load_scenario(name)
    path = plan(scenario, seed=1, time_limit=60.0, iterations=20_000).path
    assert path is not None
    return scenario, path


@pytest.fixture(scope="session")
def planned() -> Planned:
    """Return the planner of packaged scenarios."""
    return _planned
