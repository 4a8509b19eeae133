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

READ = """\
import json, pathlib, re, sys, time
from pushplan.errors import RunLogError
from pushplan.logging.reader import read_run
verdicts = []
for recover in (False, True):
    began = time.process_time()
    try:
        verdict = f"read, {len(read_run(sys.argv[1], recover=recover).losses)} losses"
    except RunLogError as error:
        verdict = str(error)
    verdicts.append((verdict, time.process_time() - began))
status = pathlib.Path("/proc/self/status").read_text()  # getrusage counts the process that started this one, too
print(json.dumps([verdicts, int(re.search(r"VmHWM:\\s+(\\d+)", status)[1]) / 1024]))
"""


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
    done = subprocess.run([sys.executable, "-c", READ, str(path)], check=True, capture_output=True, text=True)
    path.unlink()
    verdicts, peak_mb = json.loads(done.stdout)
    assert peak_mb < MOST_MB, verdicts
    assert max(seconds for _, seconds in verdicts) < MOST_SECONDS, verdicts


def test_the_bomb_of_lines_is_refused_by_its_first_line(whole_log: bytes, tmp_path: Path) -> None:
    """3.37 GB and 37 s it took once."""
    from pushplan.errors import RunLogError
    from pushplan.logging.reader import read_run

    path = tmp_path / "bomb.mcap"
    path.write_bytes(bombs.lines_of_16_megabytes(whole_log))
    with pytest.raises(RunLogError, match=r"a message on /log: 167\d+ bytes; at most 2097152 are allowed"):
        read_run(path)
