"""Peak memory of whole `pushplan plan` processes on the packaged scenarios, and of a search of a minute.

Run `python benchmarks/memory.py [--seconds 60] [--scenario three-boxes-clutter]`. The long search never ends by
stalling; its memory is told every quarter of the time, to show that polishing takes none.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from pushplan.bench.processes.machine import Machine

from pushplan.kernels import warm_up
from pushplan.planners.improve.session import Budget, Session
from pushplan.planners.ompl.auto import Auto
from pushplan.planners.ompl.search import search
from pushplan.planners.problem.controls import margins_to_try
from pushplan.planners.problem.problem import body_reach, build_problem, sampling_box
from pushplan.scenario.file import example_names, load_scenario

NEVER = 10**12


def peak_of(command: list[str]) -> float:
    """Run a command; return its peak resident memory, MB."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) != 0:
        raise SystemExit(f"failed: {' '.join(command)}")
    return usage.ru_maxrss / 1024.0


def long_search(name: str, seconds: float) -> None:
    """Search for a while in this process, telling its peak memory (MB) at every quarter."""
    scenario = load_scenario(name)
    warm_up("auto")
    stable = scenario.stable_set()
    scenario = scenario.with_margin(margins_to_try(scenario, stable)[0])
    problem = build_problem(scenario, stable)
    session = Session(problem, scenario.start, Budget(0.25 * seconds, stall=NEVER), seed=1)
    for quarter in range(1, 5):
        session.budget = Budget(0.25 * quarter * seconds, stall=NEVER)
        search(session, Auto, sampling_box(scenario), body_reach(scenario))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        print(
            f"{name}, {session.elapsed:5.1f} s: {peak:4.0f} MB, {session.extensions} extensions, "
            f"{session.best.cost:.4f} m",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--scenario", default="three-boxes-clutter")
    arguments = parser.parse_args()
    print(Machine.this().words)
    warm_up("auto")
    with tempfile.TemporaryDirectory() as folder:
        for name in example_names():
            log = str(Path(folder) / f"{name}.mcap")
            peak = peak_of([sys.executable, "-m", "pushplan", "plan", name, "-o", log])
            print(f"pushplan plan {name:22} {peak:4.0f} MB", flush=True)
    long_search(arguments.scenario, arguments.seconds)


if __name__ == "__main__":
    main()
