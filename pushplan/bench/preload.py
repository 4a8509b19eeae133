"""Loads all imports and kernels of runs into the fork server, so that the processes of runs start with them.

An error here is ignored: it occurs again in each run, which reports it.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import signal
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a run has one processor, and forking needs a single thread
os.environ.setdefault("OMP_NUM_THREADS", "1")

os.environ.pop("PYTHONSAFEPATH", None)  # only for this process; a run can start another program

signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started the benchmark
os.dup2(2, 1)  # standard output is reserved for results
atexit.register(os._exit, 0)  # skips the clean-up in which OMPL's bindings print warnings about leaks


def load() -> None:
    """Execute a small run, and compute a margin in every stable set."""
    from pushplan.bench.outcome import perform
    from pushplan.bench.suite import suite_from_text
    from pushplan.util.names import STABLE_SETS

    suite = suite_from_text(
        "format: pushplan-suite/1\nproblems: [two-crates]\nplanners: [{name: auto, first: true}]\nseeds: 1\n"
    )
    scenario = suite.problems[0].scenario()
    for name in STABLE_SETS:
        with contextlib.suppress(Exception):
            scenario.stable_set(name).margin([[1.0, 0.0, 0.0]])
    with tempfile.TemporaryDirectory() as folder:
        perform(next(suite.runs("")), Path(folder))


with contextlib.suppress(Exception):
    load()
gc.collect()
gc.freeze()  # otherwise the first garbage collection of each process would copy all shared pages
