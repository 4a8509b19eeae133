"""Rooms in series: easy ones that take many nodes, and narrow gaps, which searches never come through by chance."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

import pushplan
from pushplan.scenario.model import Scenario


def _series() -> ModuleType:
    path = Path(__file__).parent.parent / "benchmarks" / "series.py"
    spec = importlib.util.spec_from_file_location("series", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("scenario", list(_series().scenes(quick=True)), ids=lambda scenario: scenario.name)
def test_rooms_in_series_are_passed(scenario: Scenario) -> None:
    found = pushplan.plan(scenario, first=True, seed=1, iterations=100_000, time_limit=600.0)
    assert found.solved, found.reason
