"""Imported by the fork server once: loads and compiles all that runs need, so that their processes start with it.

Whatever fails here fails again in each run that needs it, and is told there.
"""

from __future__ import annotations

import contextlib
import gc
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a run has one processor; and forks want no other threads
os.environ.setdefault("OMP_NUM_THREADS", "1")


def load() -> None:
    """Do a small run with every planner, and ask every stable set."""
    import tempfile
    from pathlib import Path

    from pushplan.bench.processes.outcome import Task
    from pushplan.bench.processes.work import perform
    from pushplan.kernels import warm_up
    from pushplan.scenario.file import load_scenario
    from pushplan.util.names import PLANNERS, STABLE_SETS

    scenario = load_scenario("two-crates")
    for name in PLANNERS:
        with contextlib.suppress(Exception):
            warm_up(name)
    for name in STABLE_SETS:
        with contextlib.suppress(Exception):
            scenario.stable_set(name).margin([[1.0, 0.0, 0.0]])
            warm_up("auto", stable=name, intervals=True)
    task = Task(
        key="",
        name=scenario.name,
        source=scenario.source,
        attachments={},
        planner="auto",
        first=True,
        time_limit=1.0,
        iterations=None,
        cost=None,
        gap=None,
        stable_set=scenario.stability.set,
        seed=1,
        seconds=1.0,
        megabytes=1.0,
        version="",
    )
    with tempfile.TemporaryDirectory() as folder:
        perform(task, Path(folder))


with contextlib.suppress(Exception):
    load()
gc.collect()
gc.freeze()  # or each process would copy all that is loaded as soon as it collects garbage
