"""Shards of a suite, killed at random moments, resumed and merged.

    python benchmarks/attacking/shards.py [--runs 2000] [--shards 32] [--killed 0.3] [--seed 1] [--quick]

It compares the merged results with those of one machine: outcome, cost and arcs of every run. A process is killed
with the probability `--killed`: alone by SIGKILL, or with its whole process group by SIGTERM or SIGKILL, as a batch
system does. A killed process is resumed, and may be killed again. With `--quick` the processes of runs do not plan:
their outcome and cost follow from the seed, and they crash or raise for one seed in ten.
"""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import closing
from pathlib import Path

from pushplan.bench.outcome import Outcome
from pushplan.bench.suite import RunSpec

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent))
from script import options  # noqa: E402

SUITE = """\
format: pushplan-suite/1
name: shards
problems: [one-box, {{name: random, generate: {{objects: [1, 2], obstacles: [0, 5]}}, count: 9}}]
planners: [{{name: auto, first: true}}]
seeds: {seeds}
limits: {{time: 60 s, iterations: 300}}
"""
QUICK = """\
import sys
import shards
from functools import partial
from pushplan.bench import executor
from pushplan.cli.main import main
executor.PRELOAD = "shards"
executor.local_engine = partial(executor.local_engine, work=shards.quick)
sys.exit(main(sys.argv[1:]))
"""
WAYS = {
    "process": (os.kill, signal.SIGKILL),
    "group, SIGTERM": (os.killpg, signal.SIGTERM),
    "group, SIGKILL": (os.killpg, signal.SIGKILL),
}


def main() -> int:
    """Run, kill, resume, merge and compare."""
    asked = options(__doc__, runs=2000, shards=32, killed=0.3, seed=1, quick=False)
    rng, kills, processes, usual = random.Random(asked.seed), Counter[str](), 0, 2.0
    with tempfile.TemporaryDirectory(prefix="shards-") as name:
        folder = Path(name)
        (folder / "suite.yaml").write_text(SUITE.format(seeds=-(-asked.runs // 10)))
        bench(folder, "suite.yaml", "-o", "one").wait()
        parts = [f"part-{part}" for part in range(1, asked.shards + 1)]
        for k, part in enumerate(parts, start=1):
            way: str | None = "none yet"
            while way is not None:
                shard = "--shard", f"{k}/{asked.shards}", "--resume"
                process, began = bench(folder, "suite.yaml", "-o", part, *shard), time.monotonic()
                doomed, share = rng.random() < asked.killed, rng.random()
                way, processes = kill(process, share * usual if doomed else None, rng.choice([*WAYS])), processes + 1
                kills += Counter([] if way is None else [way])
            usual = usual if doomed else time.monotonic() - began
        bench(folder, "merge", *parts, "-o", "merged").wait()
        one, merged = results(folder / "one"), results(folder / "merged")
        rows = sum(len(results(folder / part)) for part in parts)
    lost, other = one.keys() - merged.keys(), [key for key in one.keys() & merged.keys() if one[key] != merged[key]]
    print(f"{processes} processes, killed: {kills.total()} ({dict(kills)})")
    print(f"{rows} rows in the shards, {len(merged)} merged, {len(lost)} lost of {len(one)}")
    print(f"other outcome, cost or arcs than on one machine: {len(other)}")
    for key in other[:5]:
        print(f"  {one[key]}\n  {merged[key]}")
    return int(bool(lost or other))


def kill(process: subprocess.Popen[bytes], after: float | None, way: str) -> str | None:
    """Kill a process after a time (s) unless it ends before; return the way, or None if it ended."""
    try:
        process.wait(after)
        return None
    except subprocess.TimeoutExpired:
        send, sign = WAYS[way]
        send(process.pid, sign)
        process.wait()
        return way


def quick(spec: RunSpec, folder: Path) -> Outcome:
    """Return a result that follows from problem and seed, and write a log."""
    chance = random.Random(spec.key).random()
    (folder / "run.mcap").write_text(spec.key)
    if chance < 0.05:
        os._exit(7)
    if chance < 0.1:
        raise ValueError("planted")
    time.sleep(0.01 * chance)
    numbers = {"solution_length": chance, "duration": 2.0 * chance}
    return Outcome(spec.key, "ok", "", numbers, ((1.0, 0.0, 0.0, chance),))


def bench(folder: Path, *words: str) -> subprocess.Popen[bytes]:
    """Start a command of `pushplan bench`."""
    program = ["-c", QUICK] if "--quick" in sys.argv else ["-m", "pushplan"]
    found = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, *program, "bench", *words, "--accept-broken"]
    return subprocess.Popen(command, cwd=folder, start_new_session=True, stdout=-3, stderr=-3, env=found)


def results(folder: Path) -> dict[str, tuple[object, ...]]:
    """Return the result of each run of a folder by key."""
    query = "SELECT key, outcome, message, arcs, solution_length, duration FROM pushplan_runs JOIN runs ON id = runid"
    with closing(sqlite3.connect(folder / "results.db")) as database:
        rows = database.execute(query).fetchall()
    assert len({row[0] for row in rows}) == len(rows), "a run has two results"
    return {key: tuple(rest) for key, *rest in rows}


if __name__ == "__main__":
    sys.exit(main())
