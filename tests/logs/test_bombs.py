"""Files below 100 MB that would explode are read or refused within 500 MB and 10 s of a processor.

With PUSHPLAN_PADDING=6 they are of 95 MB, which lets them hold more; that goes on for minutes.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

HERE = Path(__file__).parent
MOST_MB, MOST_SECONDS = 500.0, 10.0


def _load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


bombs: Any = _load("bombs")


@pytest.fixture(scope="module")
def reader() -> Iterator[subprocess.Popen[str]]:
    """Return a process that reads the files whose names it is sent."""
    command = [sys.executable, str(HERE / "read_many.py")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield process


@pytest.mark.parametrize("name", bombs.BOMBS)
def test_a_bomb_takes_little(
    name: str, reader: subprocess.Popen[str], whole_log: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(bombs.BOMBS[name](whole_log))
    assert reader.stdin is not None
    assert reader.stdout is not None
    print(path, file=reader.stdin, flush=True)
    verdicts = [json.loads(reader.stdout.readline()) for _ in range(2)]
    path.unlink()
    assert [verdict["recover"] for verdict in verdicts] == [False, True]
    for verdict in verdicts:
        assert verdict["kind"] in ("read", "RunLogError"), verdict
        assert verdict["peak_mb"] < MOST_MB, verdict
        assert verdict["seconds"] < MOST_SECONDS, verdict
