"""Times of whole processes: the help, the first plan on a machine (which compiles), and later plans.

Run `python benchmarks/startup.py`. Wall-clock and CPU seconds are printed; on a shared machine the CPU seconds tell
more. A later plan is timed whole (`plan free-space --first`), so it bounds the time before planning begins.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time

from pushplan.bench.processes.machine import Machine

RUNS = 5


def timed(arguments: list[str], cache: str) -> tuple[float, float]:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    command = [sys.executable, "-m", "pushplan", *arguments]
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, "NUMBA_CACHE_DIR": cache})
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def show(name: str, runs: list[tuple[float, float]]) -> None:
    wall, cpu = (sorted(column)[len(runs) // 2] for column in zip(*runs, strict=True))
    print(f"{name:34} {wall:8.2f} s wall {cpu:8.2f} s CPU  (median of {len(runs)})", flush=True)


def main() -> None:
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    print(Machine.this().words)
    plan = ["plan", "free-space", "--first"]
    with tempfile.TemporaryDirectory() as cache:
        show("pushplan --help", [timed(["--help"], cache) for _ in range(RUNS)])
        show("first plan, compiling", [timed(plan, cache)])
        show("later plan, whole command", [timed(plan, cache) for _ in range(RUNS)])


if __name__ == "__main__":
    main()
