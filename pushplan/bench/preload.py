"""Imported by the fork server once: loads all that runs need, so that their processes start with it.

Whatever fails here fails again in each run that needs it, and is reported there.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import signal
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a run has one processor; and forks want no other threads
os.environ.setdefault("OMP_NUM_THREADS", "1")

os.environ.pop("PYTHONSAFEPATH", None)  # of this process alone; a run may start another program

signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that wants the runs
os.dup2(2, 1)  # standard output is for results
atexit.register(os._exit, 0)  # without the clean-up in which OMPL's bindings list what they call leaks


def load() -> None:
    """Do a small run, and ask every stable set."""
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
gc.freeze()  # or each process would copy all that is loaded as soon as it collects garbage
