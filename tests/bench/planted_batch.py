"""A batch of planted or real runs as a program of its own, to be killed and begun again."""

from __future__ import annotations

import sys
from pathlib import Path

from planted_runs import work  # type: ignore[import-not-found]  # beside this program

from pushplan.bench.batch import Choice, run_suite
from pushplan.bench.processes import fork_server
from pushplan.bench.processes.cluster import cluster_outcomes
from pushplan.bench.processes.local import local_outcomes
from pushplan.bench.processes.machine import package_version
from pushplan.bench.processes.work import perform
from pushplan.bench.storage.folder import ResultsFolder
from pushplan.bench.suites.file import load_suite


def main(folder: str, suite: str, kind: str, address: str = "") -> None:
    """Do the runs of a suite file, planted or real, here or on a cluster, or go on with them; say so run by run."""
    if kind == "planted":
        fork_server.PRELOAD = "planted_runs"  # no planner is needed here
    results = ResultsFolder(Path(folder))
    does = work if kind == "planted" else perform
    with results.locked():
        run_suite(
            load_suite(Path(suite)),
            results,
            lambda tasks: (
                cluster_outcomes(tasks, address, does)
                if address
                else local_outcomes(tasks, 2, results.scratch, does)
            ),
            Choice(resume=True),
            tell=lambda tally: print(tally.done, flush=True),
            version=package_version() if address else "test",  # workers look at it
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
