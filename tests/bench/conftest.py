"""Planted runs as a module that processes find by name, and rows of results."""

import sqlite3
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from conftest import Patch

HERE = Path(__file__).parent

Rows = list[dict[str, Any]]


@pytest.fixture
def planted(monkeypatch: Patch) -> Any:
    """Return the module of planted runs."""
    monkeypatch.syspath_prepend(HERE)
    return import_module("planted_runs")


@pytest.fixture
def rows() -> Callable[[Path], Rows]:
    """Return a reader of all results in a folder, in the order of the suite."""

    def read(folder: Path) -> Rows:
        database = sqlite3.connect(folder / "results.db")
        database.row_factory = sqlite3.Row
        query = "SELECT r.*, o.*, r.seed AS seed FROM runs r JOIN pushplan_runs o ON o.runid = r.id ORDER BY o.number"
        found = [dict(row) for row in database.execute(query)]
        database.close()
        return found

    return read
