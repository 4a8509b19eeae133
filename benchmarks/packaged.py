"""Plan and execute every packaged scenario with many seeds and check each result independently.

Run `python benchmarks/packaged.py [--seeds 20] [--time-limit 2]`: prints a table, exits 1 if a run fails a check.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from pushplan.bench.machine import Machine
from pushplan.bench.validation import exactly, flaw, with_kept_margin
from pushplan.examples import example_names
from pushplan.kernels import warm_up
from pushplan.plan import plan
from pushplan.reading.scenario_file import load_scenario
from pushplan.result import PlanResult
from pushplan.run import execute
from pushplan.scenario import Scenario


def failure(scenario: Scenario, result: PlanResult) -> str:
    execution = execute(scenario, result)
    return (
        result.reason if execution is None else flaw(with_kept_margin(exactly(scenario), result), execution)
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--time-limit", type=float, default=2.0)
    parser.add_argument("--planner")
    arguments = parser.parse_args()
    print(f"{Machine.this().words}, seeds 1-{arguments.seeds}")
    print(
        f"{'scenario':22} {'solved':>7} {'first ms (median, max)':>24} {'plan s (max)':>12} {'cost (median)':>13}"
    )
    bad = 0
    for name in example_names():
        scenario = load_scenario(name)
        warm_up(arguments.planner or scenario.planner.name)
        firsts, seconds, costs, solved = [], [], [], 0
        for seed in range(1, arguments.seeds + 1):
            began = time.perf_counter()
            result = plan(scenario, seed=seed, time_limit=arguments.time_limit, planner=arguments.planner)
            seconds.append(time.perf_counter() - began)
            fault = failure(scenario, result)
            if fault:
                print(f"  {name} seed {seed}: {fault}")
            solved += not fault
            if result.path is not None:
                firsts.append(1e3 * (result.first_solution_s or 0.0))
                costs.append(result.path.cost)
        bad += arguments.seeds - solved
        shown = (np.median(firsts), max(firsts), max(seconds), np.median(costs)) if costs else [np.nan] * 4
        share = f"{solved:3}/{arguments.seeds:3}"
        print(
            f"{name:22} {share} {shown[0]:14.2f} {shown[1]:9.2f} {shown[2]:12.2f} {shown[3]:13.3f}",
            flush=True,
        )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
