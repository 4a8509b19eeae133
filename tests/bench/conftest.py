"""Runs with planned failures as a module that processes import by name, and rows of results."""

import os
import sqlite3
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from conftest import Patch

HERE = Path(__file__).parent

Rows = list[dict[str, Any]]


def environment() -> dict[str, str]:
    """Return the environment of a program that finds the planted runs."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])}


@pytest.fixture
def planted(monkeypatch: Patch) -> Any:
    """Return the module of planted runs."""
    monkeypatch.syspath_prepend(HERE)
    return import_module("planted_runs")


def rows(folder: Path) -> Rows:
    """Return all results in a folder, in the order of the suite."""
    database = sqlite3.connect(folder / "results.db")
    database.row_factory = sqlite3.Row
    query = "SELECT r.*, o.*, r.seed AS seed FROM runs r JOIN pushplan_runs o ON o.runid = r.id ORDER BY o.number"
    found = [dict(row) for row in database.execute(query)]
    database.close()
    return found
