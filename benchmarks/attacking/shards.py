"""Shards of a suite, killed at random moments, resumed and merged: `python benchmarks/attacking/shards.py`.

It compares the merged results with those of one machine: outcome, cost and arcs of every run. A process is killed
with the probability `--killed`: alone by SIGKILL, or with its whole process group by SIGTERM or SIGKILL, as a batch
system does. What was killed is resumed, and may be killed again. With `--quick` the processes of runs do not plan:
their outcome and cost follow from the seed, and they crash or raise for one seed in ten.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from pushplan.bench.outcome import Outcome
from pushplan.bench.store import Machine
from pushplan.bench.suite import RunSpec

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
WAYS = ("process", "group, SIGTERM", "group, SIGKILL")


def main() -> None:
    """Run, kill, resume, merge and compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--shards", type=int, default=32)
    parser.add_argument("--killed", type=float, default=0.3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    print(Machine.this().words)
    print(f"{options.runs} runs in {options.shards} shards, seed {options.seed}")
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory(prefix="shards-") as name:
        folder = Path(name)
        (folder / "suite.yaml").write_text(SUITE.format(seeds=-(-options.runs // 10)))
        began = time.monotonic()
        _bench(folder, "suite.yaml", "-o", "one").wait()
        whole = time.monotonic() - began
        print(f"one machine: {len(_rows(folder / 'one'))} runs in {whole:.0f} s")
        kills: dict[str, int] = {}
        processes, usual = 0, 2.0
        for part in range(1, options.shards + 1):
            while True:
                shard = f"{part}/{options.shards}"
                process = _bench(folder, "suite.yaml", "-o", f"part-{part}", "--shard", shard, "--resume")
                processes += 1
                doomed = rng.random() < options.killed
                share, began = rng.random(), time.monotonic()
                way = rng.choice(WAYS)
                try:
                    process.wait(share * usual if doomed else None)
                    usual = usual if doomed else time.monotonic() - began
                    break
                except subprocess.TimeoutExpired:
                    sign = signal.SIGTERM if "TERM" in way else signal.SIGKILL
                    (os.killpg if "group" in way else os.kill)(process.pid, sign)
                    process.wait()
                    kills[way] = kills.get(way, 0) + 1
        parts = [f"part-{part}" for part in range(1, options.shards + 1)]
        _bench(folder, "merge", *parts, "-o", "merged").wait()
        one, merged = _rows(folder / "one"), _rows(folder / "merged")
        lost = len(one.keys() - merged.keys())
        other = [key for key in one.keys() & merged.keys() if one[key] != merged[key]]
        print(f"{processes} processes, killed: {sum(kills.values())} ({kills})")
        rows = sum(len(_rows(folder / part)) for part in parts)
        print(f"rows: {rows} in the shards, {len(merged)} merged, {lost} lost")
        print(f"other outcome, cost or arcs than on one machine: {len(other)}")
        for key in other[:5]:
            print(f"  {one[key]}\n  {merged[key]}")
    sys.exit(bool(lost or other))


def quick(spec: RunSpec, folder: Path) -> Outcome:
    """Return a result that follows from problem and seed, and write a log."""
    chance = random.Random(spec.key).random()
    (folder / "run.mcap").write_text(spec.key)
    if chance < 0.05:
        os._exit(7)
    if chance < 0.1:
        raise ValueError("planted")
    time.sleep(0.01 * chance)
    return Outcome(
        spec.key, "ok", "", {"solution_length": chance, "duration": 2.0 * chance}, ((1.0, 0.0, 0.0, chance),)
    )


def _bench(folder: Path, *words: str) -> subprocess.Popen[bytes]:
    program = ["-c", QUICK] if "--quick" in sys.argv else ["-m", "pushplan"]
    found = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]),
    }
    command = [sys.executable, *program, "bench", *words, "--accept-broken"]
    return subprocess.Popen(command, cwd=folder, start_new_session=True, stdout=-3, stderr=-3, env=found)


def _rows(folder: Path) -> dict[str, tuple[object, ...]]:
    query = "SELECT key, outcome, message, arcs, solution_length, duration FROM pushplan_runs JOIN runs ON id = runid"
    with closing(sqlite3.connect(folder / "results.db")) as database:
        rows = database.execute(query).fetchall()
    assert len({row[0] for row in rows}) == len(rows), "a run has two results"
    return {key: tuple(rest) for key, *rest in rows}


if __name__ == "__main__":
    main()
