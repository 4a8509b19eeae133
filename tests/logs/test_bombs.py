"""Files below 100 MB that would explode are read or refused within 500 MB and 10 s of a processor.

With PUSHPLAN_PADDING=6 they are of 95 MB, which lets them hold more; that goes on for minutes.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
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


@pytest.mark.parametrize("name", bombs.BOMBS)
def test_a_bomb_takes_little(name: str, whole_log: bytes, tmp_path: Path) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(bombs.BOMBS[name](whole_log))
    command = [sys.executable, str(HERE / "read_many.py"), str(tmp_path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    path.unlink()
    verdicts = [json.loads(line) for line in done.stdout.splitlines()]
    assert [verdict["recover"] for verdict in verdicts] == [False, True]
    for verdict in verdicts:
        assert verdict["kind"] in ("read", "RunLogError"), verdict
        assert verdict["peak_mb"] < MOST_MB, verdict
        assert verdict["seconds"] < MOST_SECONDS, verdict


def test_the_bomb_of_lines_is_refused_by_its_first_line(whole_log: bytes, tmp_path: Path) -> None:
    """3.37 GB and 37 s it took once."""
    from pushplan.errors import RunLogError
    from pushplan.logging.reader import read_run

    path = tmp_path / "bomb.mcap"
    path.write_bytes(bombs.lines_of_16_megabytes(whole_log))
    with pytest.raises(RunLogError, match=r"a message on /log: 167\d+ bytes; at most 2097152 are allowed"):
        read_run(path)
