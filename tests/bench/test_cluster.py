"""The same rows from a Dask cluster, also when a worker is killed."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from bench.conftest import environment, rows

from pushplan.bench.batch import Tally, run_suite
from pushplan.bench.executor import cluster_engine, local_engine
from pushplan.bench.store import ResultsFolder
from pushplan.bench.suite import suite_from_text

PATIENCE = 120.0
"""Time limit for the start of a cluster, s."""

REAL = """\
format: pushplan-suite/1
problems: [one-box, two-crates]
planners: [{name: auto, first: true}]
seeds: 1
limits: {time: 20 s, iterations: 2000}
"""


class Cluster:
    """A scheduler and workers as programs of their own."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._programs = folder, list[subprocess.Popen[bytes]]()
        self._file = folder / "scheduler.json"
        self._start("scheduler", "--port=0")
        self.workers = [self.add_worker("--no-nanny") for _ in range(2)]

    def add_worker(self, nanny: str) -> subprocess.Popen[bytes]:
        """Start another worker."""
        return self._start("worker", f"--local-directory={self._folder}", "--nthreads=1", nanny)

    def _start(self, kind: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", f"--scheduler-file={self._file}", *words]
        found = {**environment(), "DASK_DISTRIBUTED__WORKER__DAEMON": "False"}
        with (self._folder / "output.txt").open("a") as output:
            program = subprocess.Popen([*command, "--no-dashboard"], stdout=output, stderr=output, env=found)
        self._programs.append(program)
        return program

    @property
    def address(self) -> str:
        dask: Any = import_module("distributed")
        with dask.Client(scheduler_file=str(self._file), timeout=PATIENCE, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
            return str(client.scheduler.address)

    def close(self) -> None:
        for program in reversed(self._programs):
            program.send_signal(signal.SIGKILL)
            program.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    pytest.importorskip("distributed")
    made = Cluster(tmp_path_factory.mktemp("cluster"))
    yield made
    made.close()


def _run(text: str, path: Path, engine: Any, **more: Any) -> Tally:
    folder = ResultsFolder(path)
    with folder.locked():
        return run_suite(suite_from_text(text), folder, engine, **more)


def test_a_cluster_gives_the_same_rows_also_when_a_worker_is_killed(
    cluster: Cluster, planted: Any, tmp_path: Path
) -> None:
    with local_engine(2) as local:
        _run(REAL, tmp_path / "local", local)
    with cluster_engine(cluster.address) as dask:
        _run(REAL, tmp_path / "dask", dask)
    one, two = (rows(tmp_path / name) for name in ("local", "dask"))
    for name in ("key", "outcome", "solution_length", "arcs", "log"):
        assert [row[name] for row in one] == [row[name] for row in two]
    assert all((tmp_path / "dask" / row["log"]).stat().st_size > 10_000 for row in two)

    def kill_one(tally: Tally) -> None:
        if tally.done == 2:
            cluster.workers[0].send_signal(signal.SIGKILL)
        if tally.done == 4:
            cluster.add_worker("--nanny")

    seeds = range(5)
    text = planted.suite_text(seeds, 60)
    with cluster_engine(cluster.address, planted.work) as dask:
        _run(text, tmp_path / "planted", dask, observer=kill_one)
    assert [(row["seed"], row["outcome"]) for row in rows(tmp_path / "planted")] == [
        (seed, planted.STATUS[planted.fate_of(seed)]) for seed in seeds
    ]
