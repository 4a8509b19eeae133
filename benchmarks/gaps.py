"""How far the stated bound lies below the best paths known: packaged scenes, free ones, and dense ones.

Run `python benchmarks/gaps.py [--seconds 2] [--seeds 2] [--dense 44]`. Paths are ranked by travel alone, without a
price of arcs; the best of all seeds stands for the optimum (docs/benchmarks.md tells how near such paths are to the
best of all planners). Free scenes are the packaged ones without their obstacles and walls; on these and the packaged
ones the optimum is known within 0.5 % (`convergence.py`), and they are told together, too. Searches count CPU time.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from dense_scenes import NUMBERS
from dense_scenes import scenes as dense_scenes

from pushplan.bench.processes.machine import Machine
from pushplan.plan import plan
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.model import Scenario

KNOWN = ("free", "packaged")
"""Groups whose optimum is known."""

PASSAGES = Path(__file__).parent / "passages"


def groups(dense: int) -> Iterator[tuple[str, list[Scenario]]]:
    packaged = [load_scenario(name) for name in example_names()]
    yield "free", [replace(scenario, obstacles=(), workspace=None) for scenario in packaged]
    yield "packaged", packaged
    yield "shared", [load_scenario(path) for path in sorted(PASSAGES.glob("*.yaml"))]
    yield "dense", list(dense_scenes(NUMBERS[:dense]))


def measure(scenario: Scenario, seconds: float, seeds: int) -> tuple[float, float, float] | None:
    """Best cost and bound (m), and the CPU time of the bound, s; None where no path is found."""
    by_travel = replace(scenario, planner=replace(scenario.planner, cost="travel", arc_price=0.0))
    found = [plan(by_travel, seed=seed, time_limit=seconds) for seed in range(1, seeds + 1)]
    solved = [result for result in found if result.path is not None]
    if not solved:
        return None
    best = min(solved, key=lambda result: result.path.cost if result.path else np.inf)
    began = time.process_time()
    bound = best.lower_bound
    assert best.path is not None
    assert bound is not None
    return best.path.cost, bound, time.process_time() - began


def told(name: str, gaps: list[float]) -> str:
    """One line about the gaps of a group."""
    return f"{name}: median gap {np.median(gaps):.2%}, largest {max(gaps):.2%}, {len(gaps)} scenes"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--dense", type=int, default=len(NUMBERS))
    arguments = parser.parse_args()
    print(Machine.this().words)
    plan(load_scenario("one-box"), first=True)
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    known = []
    for name, scenarios in groups(arguments.dense):
        gaps = []
        for scenario in scenarios:
            measured = measure(scenario, arguments.seconds, arguments.seeds)
            if measured is None:
                print(f"  {name:8} {scenario.name:22} no path")
                continue
            cost, bound, taken = measured
            gaps.append(cost / bound - 1.0)
            print(
                f"  {name:8} {scenario.name:22} {cost:8.4f} m, bound {bound:8.4f} m in {1e3 * taken:5.1f} ms, "
                f"gap {gaps[-1]:7.2%}",
                flush=True,
            )
        print(told(name, gaps), flush=True)
        known += gaps if name in KNOWN else []
    print(told(" and ".join(KNOWN), known))


if __name__ == "__main__":
    main()
