"""Planted runs as a module that processes find by name, and rows of results."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from pushplan.bench.processes.outcome import Task
from pushplan.scenario.file import load_scenario

HERE = Path(__file__).parent

Rows = list[dict[str, Any]]


@pytest.fixture
def planted(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the module of planted runs."""
    monkeypatch.syspath_prepend(HERE)
    return import_module("planted_runs")


@pytest.fixture
def make_task() -> Callable[..., Task]:
    """Return a maker of tasks on the packaged one-box problem."""

    def make(seed: int = 1, seconds: float = 20.0, megabytes: float = 500.0, **other: Any) -> Task:
        scenario = load_scenario("one-box")
        settings: dict[str, Any] = {
            "planner": "auto",
            "first": True,
            "time_limit": 5.0,
            "iterations": None,
            "cost": None,
            "gap": None,
            "stable_set": "ecof",
            "version": "test",
        }
        settings |= other
        return Task(
            f"key{seed}",
            "one-box",
            scenario.source,
            {},
            seed=seed,
            seconds=seconds,
            megabytes=megabytes,
            **settings,
        )

    return make


@pytest.fixture
def rows() -> Callable[[Path], Rows]:
    """Return a reader of all results in a folder, in the order of the plan."""

    def read(folder: Path) -> Rows:
        database = sqlite3.connect(folder / "results.db")
        database.row_factory = sqlite3.Row
        query = (
            "SELECT r.*, o.*, r.seed AS seed FROM runs r JOIN pushplan_runs o ON o.runid = r.id "
            "LEFT JOIN pushplan_plan p ON p.key = o.key ORDER BY p.number"
        )
        found = [dict(row) for row in database.execute(query)]
        database.close()
        return found

    return read
