"""What the benchmark runner promises, at full size: nothing lost, nothing doubled, little overhead.

Run `python benchmarks/bench.py [faults] [kills] [overhead] [throughput] [same]`; without words, all of it, in about
a quarter of an hour on two processors. `faults`: 1,000 runs with planted segfaults, hangs, memory hogs and errors.
`kills`: a batch of real runs, killed at 20 random moments and resumed (more kills: batch_kills.py). `overhead`: time
per run beyond its phases. `throughput`: two jobs against one. `same`: the same costs and arcs on one job, two jobs
and Dask.
"""

from __future__ import annotations

import argparse
import json
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
from typing import Any

HERE = Path(__file__).resolve().parent
PLANTED = HERE.parent / "tests" / "bench"
sys.path.insert(0, str(PLANTED))
os.environ["PYTHONPATH"] = os.pathsep.join([str(PLANTED), os.environ.get("PYTHONPATH", "")])

import planted_runs  # noqa: E402

from pushplan.bench.batch import Engine, run_suite  # noqa: E402
from pushplan.bench.processes.cluster import cluster_outcomes  # noqa: E402
from pushplan.bench.processes.fork_server import supervisor  # noqa: E402
from pushplan.bench.processes.local import local_outcomes  # noqa: E402
from pushplan.bench.processes.machine import Machine  # noqa: E402
from pushplan.bench.storage.folder import ResultsFolder  # noqa: E402
from pushplan.bench.suites.file import suite_from_text  # noqa: E402

REAL = """\
format: pushplan-suite/1
problems: [one-box, two-crates, narrow-gap, {name: random, generate: {objects: [1, 3], obstacles: [0, 10]}, count: 5}]
planners: [{name: auto, first: true}, {name: auto, label: auto-polished}]
seeds: 5
limits: {time: 60 s, iterations: 20000}
"""


def rows(folder: Path) -> list[tuple[Any, ...]]:
    with closing(sqlite3.connect(folder / "results.db")) as database:
        query = (
            "SELECT p.seed, o.outcome, r.solution_length, o.arcs, p.key, r.total_time, r.overhead_time FROM "
            "pushplan_plan p JOIN pushplan_runs o ON o.key = p.key JOIN runs r ON r.id = o.runid ORDER BY p.number"
        )
        return database.execute(query).fetchall()


def run(text: str, folder: Path, engine: Engine, version: str | None = None) -> float:
    results = ResultsFolder(folder)
    began = time.perf_counter()
    with results.locked():
        run_suite(suite_from_text(text), results, engine, version=version)
    return time.perf_counter() - began


def check_planted(found: list[tuple[Any, ...]], count: int) -> Counter[tuple[str, str]]:
    assert [row[0] for row in found] == list(range(count)), "runs are lost or doubled"
    ends = Counter((planted_runs.fate_of(seed), outcome) for seed, outcome, *_ in found)
    wrong = {pair: n for pair, n in ends.items() if planted_runs.STATUS[pair[0]] != pair[1]}
    assert not wrong, f"wrong outcomes: {wrong}"
    return ends


def faults(folder: Path, count: int = 1000) -> None:
    spent = run(
        planted_runs.suite_text(count),
        folder,
        lambda t: local_outcomes(t, 2, None, planted_runs.work),
        "test",
    )
    ends = check_planted(rows(folder), count)
    counts = Counter()
    for (_, outcome), n in ends.items():
        counts[outcome] += n
    print(f"faults: {count} runs, {count} rows in {spent:.0f} s, each with the right outcome: {dict(counts)}")


def kills(folder: Path, times: int = 20) -> None:
    (folder / "real.yaml").write_text(REAL)
    found = killed_and_resumed(folder / "real.yaml", folder / "killed", times)
    run(REAL, folder / "whole", lambda tasks: local_outcomes(tasks, 2), "test")
    expected = [row[:5] for row in rows(folder / "whole")]
    assert [row[:5] for row in found] == expected, (
        "outcomes, costs or arcs differ from those of a batch left alone"
    )
    print(f"kills: the {len(expected)} real runs have the same outcomes, costs and arcs as when left alone")


def killed_and_resumed(suite: Path, folder: Path, times: int, spread: float = 0.5) -> list[tuple[Any, ...]]:
    command = [sys.executable, str(PLANTED / "planted_runs.py"), str(folder), str(suite), "real"]
    rng, at = random.Random(1), []
    for _ in range(times):
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
            assert program.stdout is not None
            program.stdout.readline()
            time.sleep(rng.uniform(0.0, spread))
            program.send_signal(signal.SIGKILL)
        at.append(len(rows(folder)))
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    found = rows(folder)
    print(f"kills: real runs killed with {at} of {len(found)} rows, each there once in the end")
    return found


def overhead(folder: Path, count: int = 100) -> None:
    text = f"format: pushplan-suite/1\nproblems: [one-box]\nplanners: [{{name: auto, first: true}}]\nseeds: {count}\n"
    supervisor().prepare()
    spent = run(text, folder, lambda tasks: local_outcomes(tasks, 1))
    found = rows(folder)
    phases = sum(row[5] - row[6] for row in found)
    worst = max(row[6] for row in found)
    print(
        f"overhead: {1e3 * (spent - phases) / count:.1f} ms a run beyond its phases (batch {spent:.2f} s, phases "
        f"{phases:.2f} s, {count} runs); process alone {1e3 * sum(row[6] for row in found) / count:.1f} ms, at most "
        f"{1e3 * worst:.1f} ms"
    )


def throughput(folder: Path, count: int = 20, rounds: int = 4) -> None:
    text = (
        "format: pushplan-suite/1\nproblems: [three-boxes-clutter]\nplanners: [auto]\n"
        f"seeds: {count}\nlimits: {{time: 60 s, iterations: 40000}}\n"
    )
    supervisor().prepare()
    spent: dict[int, list[float]] = {1: [], 2: []}
    for i in range(rounds):
        for jobs, times in spent.items():
            where = folder / f"{i}-{jobs}"
            times.append(run(text, where, lambda tasks, jobs=jobs: local_outcomes(tasks, jobs)))
    one, two = (min(times) for times in spent.values())
    print(
        f"throughput: {count} runs in {one:.1f} s on one job, {two:.1f} s on two, best of {rounds}: "
        f"x {one / two:.2f}; this machine does two loops of Python at once x {scaling(rounds):.2f} as fast"
    )


def scaling(rounds: int) -> float:
    """Return what two processors are worth here when nothing is shared."""
    loop = [sys.executable, "-c", "x = 0\nfor i in range(15_000_000): x += i * i"]
    spent: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(rounds):
        for jobs, times in spent.items():
            began = time.perf_counter()
            programs = [subprocess.Popen(loop) for _ in range(jobs)]
            for program in programs:
                program.wait()
            times.append(time.perf_counter() - began)
    return 2.0 * min(spent[1]) / min(spent[2])


def same(folder: Path) -> None:
    for jobs in (1, 2):
        run(REAL, folder / str(jobs), lambda tasks, jobs=jobs: local_outcomes(tasks, jobs))
    with dask(folder) as cluster:
        run(REAL, folder / "dask", lambda tasks: cluster_outcomes(tasks, cluster.address))
    found = [[row[1:5] for row in rows(folder / name)] for name in ("1", "2", "dask")]
    assert found[0] == found[1] == found[2], "costs or arcs differ"
    counts = Counter(row[0] for row in found[0])
    print(
        f"same: {len(found[0])} runs have the same costs and arcs on one job, two jobs and Dask: {dict(counts)}"
    )


class dask:  # noqa: N801
    """A scheduler and two workers for the time of a block.

    Attributes:
        workers: Numbers of the workers' processes.
    """

    def __init__(self, folder: Path) -> None:
        self._file, self._folder = folder / "scheduler.json", folder
        self._scheduler = self._start("scheduler", "--port=0", f"--scheduler-file={self._file}")
        self._workers = [self._worker() for _ in range(2)]

    def _worker(self) -> subprocess.Popen[bytes]:
        where = (f"--scheduler-file={self._file}", f"--local-directory={self._folder}")
        return self._start("worker", *where, "--nthreads=1", "--no-nanny")

    def _start(self, word: str, *more: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{word}", "--no-dashboard", *more],
            env={**os.environ, "TMPDIR": str(self._folder)},
            stderr=subprocess.DEVNULL,
        )

    @property
    def address(self) -> str:
        """Of the scheduler."""
        while not self._file.exists():
            time.sleep(0.1)
        return str(json.loads(self._file.read_text())["address"])

    @property
    def workers(self) -> list[int]:
        return [worker.pid for worker in self._workers]

    def replace_worker(self, i: int) -> None:
        """Kill a worker and start another one."""
        self._workers[i].kill()
        self._workers[i].wait()
        self._workers[i] = self._worker()

    def __enter__(self) -> dask:
        return self

    def __exit__(self, *error: object) -> None:
        for program in (self._scheduler, *self._workers):
            program.kill()
            program.wait()


MEASUREMENTS = {
    "faults": faults,
    "kills": kills,
    "overhead": overhead,
    "throughput": throughput,
    "same": same,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("what", nargs="*", choices=[*MEASUREMENTS, []], help="measurements; all by default")
    chosen = parser.parse_args().what or MEASUREMENTS
    print(Machine.this().words)
    for name in chosen:
        with tempfile.TemporaryDirectory() as folder:
            MEASUREMENTS[name](Path(folder))


if __name__ == "__main__":
    main()
