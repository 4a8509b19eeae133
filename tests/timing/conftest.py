"""Packaged scenarios planned once, by travel, without a margin and without inertia, for the tests of timing."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
from plain import load_plain

from pushplan.path import PushPath
from pushplan.plan import plan
from pushplan.scenario import Scenario

Planned = Callable[[str], tuple[Scenario, PushPath]]


@cache
def _planned(name: str) -> tuple[Scenario, PushPath]:
    scenario = load_plain(name)
    path = plan(scenario, seed=1, time_limit=60.0, iterations=20_000).path
    assert path is not None
    return scenario, path


@pytest.fixture(scope="session")
def planned() -> Planned:
    """Return the planner of packaged scenarios."""
    return _planned
