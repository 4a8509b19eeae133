"""Reads every file in a folder, or each that a line on standard input names, strictly and recovering.

A JSON line for each way of reading each file tells what came of it, in which time and with which memory at the peak.
"""

from __future__ import annotations

import json
import re
import sys
import time
from pathlib import Path

from pushplan.logging.old.reader import read_run

from pushplan.errors import RunLogError


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


files = (
    sorted(Path(sys.argv[1]).iterdir()) if sys.argv[1:] else (Path(line.rstrip("\n")) for line in sys.stdin)
)
for path in files:
    for recover in (False, True):
        print(json.dumps({"name": path.name, "recover": recover, **attempt(path, recover)}), flush=True)
