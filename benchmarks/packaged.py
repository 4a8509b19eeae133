"""Plan and execute every packaged scenario with many seeds and check each result independently.

Run `python benchmarks/packaged.py [--seeds 20] [--time-limit 2]`: prints a Markdown table of what plans with all
defaults come to, and their arcs and durations together; exits 1 if a run fails a check.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from pushplan.bench.processes.machine import Machine
from pushplan.bench.processes.validation import exactly, flaw, with_kept_margin
from pushplan.kernels import warm_up
from pushplan.plan import plan
from pushplan.plans.judge import execute
from pushplan.plans.result import PlanResult
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.model import Scenario


def failure(scenario: Scenario, result: PlanResult) -> str:
    execution = execute(scenario, result)
    return (
        result.reason if execution is None else flaw(with_kept_margin(exactly(scenario), result), execution)
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--time-limit", type=float)
    parser.add_argument("--planner")
    arguments = parser.parse_args()
    print(f"{Machine.this().words}, seeds 1-{arguments.seeds}; medians, margins: the smallest of all seeds")
    heads = (
        "solved | first path, ms | slowest | plan, s CPU | way, m | arcs | time, s | margin | with inertia"
    )
    print(f"| scenario | {heads} |")
    print("|" + "---|" * 10)
    bad, arcs, duration = 0, 0.0, 0.0
    for name in example_names():
        scenario = load_scenario(name)
        warm_up(arguments.planner or scenario.planner.name)
        spent, faults, kept = [], [], []
        for seed in range(1, arguments.seeds + 1):
            began = time.process_time()
            result = plan(scenario, seed=seed, time_limit=arguments.time_limit, planner=arguments.planner)
            spent.append(time.process_time() - began)
            fault = failure(scenario, result)
            faults += [f"{name} seed {seed}: {fault}"] * bool(fault)
            kept += [] if fault else [figures(result)]
        bad += len(faults)
        print("\n".join(faults), end="\n" if faults else "")
        if kept:
            table = np.array(kept)
            first, slowest, (_, way, some, took, _, _) = (
                table[:, 0],
                table[:, 0].max(),
                np.median(table, axis=0),
            )
            arcs, duration = arcs + some, duration + took
            margins = " | ".join(f"{least:.3f}" for least in table[:, 4:].min(axis=0))
            print(
                f"| {name} | {len(kept)} of {arguments.seeds} | {np.median(first):.2f} | {slowest:.2f} | "
                f"{np.median(spent):.2f} | {way:.3f} | {some:g} | {took:.2f} | {margins} |",
                flush=True,
            )
    print(f"all together: {arcs:g} arcs, {duration:.1f} s")
    return 1 if bad else 0


def figures(result: PlanResult) -> tuple[float, ...]:
    """First path (ms), way, arcs, duration, smallest margin and the one with inertia of a plan that is solved."""
    assert result.path is not None
    assert result.trajectory is not None
    assert result.execution is not None
    margins = (result.execution.min_margin, result.execution.min_dynamic_margin or 0.0)
    first = 1e3 * (result.first_solution_s or 0.0)
    return (first, result.path.cost, float(len(result.path.lengths)), result.trajectory.duration, *margins)


if __name__ == "__main__":
    sys.exit(main())
