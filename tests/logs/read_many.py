"""Reads every file in a folder, strictly and recovering; a JSON line for each tells what came of it."""

from __future__ import annotations

import json
import re
import sys
import time
from pathlib import Path

from pushplan.errors import RunLogError
from pushplan.logging.reader import read_run


def peak_mb() -> float:
    status = Path("/proc/self/status").read_text()
    found = re.search(r"VmHWM:\s+(\d+) kB", status)
    return int(found[1]) / 1024 if found else 0.0


def attempt(path: Path, recover: bool) -> dict[str, object]:
    Path("/proc/self/clear_refs").write_text("5")  # the peak counts from here
    begin = time.process_time()
    try:
        run = read_run(path, recover=recover)
        verdict: dict[str, object] = {"kind": "read", "losses": list(run.losses)}
    except RunLogError as error:
        verdict = {"kind": "RunLogError", "offset": error.offset, "text": str(error)}
    except Exception as error:
        verdict = {"kind": type(error).__name__, "text": str(error)}
    return {**verdict, "seconds": time.process_time() - begin, "peak_mb": peak_mb()}


for path in sorted(Path(sys.argv[1]).iterdir()):
    for recover in (False, True):
        print(json.dumps({"name": path.name, "recover": recover, **attempt(path, recover)}), flush=True)
