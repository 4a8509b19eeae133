"""Batches under attack: kills and stops of runs, workers, fork servers and the runner itself; no row lost or wrong.

Run `python benchmarks/batch_kills.py [local] [cluster] [--attacks N] [--seed N]`; without words both, in about ten
minutes on one processor. A batch is 300 planted runs (segfaults, hangs, memory hogs, ...:
tests/bench/planted_runs.py) on two jobs here, or on two workers of a Dask cluster. At random moments a random process
is killed (SIGKILL) or stopped (SIGSTOP); a runner that was killed is started again, which goes on as `--resume` does,
and so is a worker. In the end there is one row for each run. It says what was planted; only a run that was itself
killed may be a crash, one that was stopped a timeout, and one whose servers or workers were lost again and again, so
that it may be what ends them, a crash that says so.
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
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import bench
from bench import PLANTED, planted_runs, rows

from pushplan.bench.processes.child import OUTPUT
from pushplan.bench.processes.machine import Machine

COUNT = 300

SIGNS = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP}

ATTACKS = [
    ("run", "killed", 4),
    ("run", "stopped", 2),
    ("server", "killed", 4),
    ("server", "stopped", 2),
    ("worker", "killed", 1),
    ("runner", "killed", 2),
]
"""What is attacked, how, and how often in proportion."""

LOST = ("the process from which runs are forked was lost 3 times", "every worker that did this run was lost")
"""How the messages of runs begin that were given up because of what they run in."""


class Batch:
    """A batch that is started again whenever it is killed."""

    def __init__(self, folder: Path, address: str | None) -> None:
        self.folder = folder
        suite = folder / "suite.yaml"
        suite.write_text(planted_runs.suite_text(COUNT))
        script = str(PLANTED / "planted_batch.py")
        self._command = [sys.executable, script, str(folder / "results"), str(suite), "planted"]
        self._command += [address] if address else []
        self.runner = self._started()

    def _started(self) -> subprocess.Popen[bytes]:
        environment = {**os.environ, "TMPDIR": str(self.folder)}
        return subprocess.Popen(self._command, stdout=subprocess.DEVNULL, env=environment)

    def kill(self) -> None:
        """Kill the runner and start it again."""
        self.runner.kill()
        self.runner.wait()
        self.runner = self._started()

    def runs(self) -> Iterator[tuple[int, str]]:
        """Yield the processes of runs with their keys, with which the folders' names begin that they write to."""
        for number in numbers():
            with suppress(OSError):
                output = Path(os.readlink(f"/proc/{number}/fd/1"))
                if output.name == OUTPUT and output.is_relative_to(self.folder):
                    yield number, output.parent.name.partition("-")[0]


def numbers() -> list[int]:
    return [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]


def servers(parents: set[int]) -> list[int]:
    """Return the fork servers that processes have started."""
    found = []
    for number in numbers():
        with suppress(OSError):
            parent = int(Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[1])
            if parent in parents and b"fork_loop" in Path(f"/proc/{number}/cmdline").read_bytes():
                found.append(number)
    return found


def attack(batch: Batch, cluster: bench.dask | None, rng: random.Random) -> tuple[str, str, str] | None:
    """Attack something; return what, how, and the key of a run; None when nothing of the kind is there."""
    what, how, _ = rng.choices(ATTACKS, [weight for *_, weight in ATTACKS])[0]
    if what == "runner":
        batch.kill()
        return what, how, ""
    if what == "worker":
        if cluster is None:
            return None
        cluster.replace_worker(rng.randrange(2))
        return what, how, ""
    parents = {batch.runner.pid, *(cluster.workers if cluster else ())}
    targets = [*batch.runs()] if what == "run" else [(number, "") for number in servers(parents)]
    if not targets:
        return None
    number, key = rng.choice(targets)
    try:
        os.kill(number, SIGNS[how])
    except ProcessLookupError:
        return None
    return what, how, key


def messages(results: Path) -> dict[str, str]:
    """Return what the rows say about their ends, by key."""
    with closing(sqlite3.connect(results / "results.db")) as database:
        return dict(database.execute("SELECT key, message FROM pushplan_runs"))


def under_attack(folder: Path, cluster: bench.dask | None, attacks: int, seed: int) -> None:
    batch = Batch(folder, cluster.address if cluster else None)
    rng, began = random.Random(seed), time.perf_counter()
    done: Counter[str] = Counter()
    hurt: dict[str, set[str]] = {}
    while done.total() < attacks and batch.runner.poll() is None:
        time.sleep(rng.uniform(0.1, 2.0))
        struck = attack(batch, cluster, rng)
        if struck is not None:
            what, how, key = struck
            done[f"{what} {how}"] += 1
            hurt.setdefault(key, set()).add("crash" if how == "killed" else "timeout")
    hurt.pop("", None)
    if batch.runner.wait():
        raise SystemExit(f"the batch ended with exit code {batch.runner.returncode}")
    found = rows(folder / "results")
    assert [row[0] for row in found] == list(range(COUNT)), "runs are lost or doubled"
    ends: Counter[str] = Counter()
    said = messages(folder / "results")
    for seed_of_run, outcome, _, _, key, *_ in found:
        planted = planted_runs.STATUS[planted_runs.fate_of(seed_of_run)]
        if outcome == planted:
            ends["as planted"] += 1
        elif outcome in hurt.get(key, ()):
            ends[f"{outcome}, as attacked"] += 1
        else:
            assert said[key].startswith(LOST), (seed_of_run, planted, outcome, said[key])
            ends[f"{outcome}, as its servers were lost"] += 1
    spent = time.perf_counter() - began
    print(
        f"{len(found)} rows of {COUNT} runs in {spent:.0f} s: {dict(ends)}; attacks: {dict(sorted(done.items()))}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("where", nargs="*", choices=["local", "cluster", []], help="both by default")
    parser.add_argument("--attacks", type=int, default=120, help="on each batch (default 120)")
    parser.add_argument("--seed", type=int, default=1)
    words = parser.parse_args()
    print(Machine.this().words)
    for where in words.where or ("local", "cluster"):
        with tempfile.TemporaryDirectory() as folder:
            print(f"{where}: ", end="", flush=True)
            if where == "local":
                under_attack(Path(folder), None, words.attacks, words.seed)
            else:
                with bench.dask(Path(folder)) as cluster:
                    under_attack(Path(folder), cluster, words.attacks, words.seed)


if __name__ == "__main__":
    main()
