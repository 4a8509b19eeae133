"""Every planner against plain OMPL on the same problems: success, first paths, cost over time, speed, memory.

Run `python benchmarks/planning.py [--seeds 5] [--seconds 2] [--planners auto rrt ...] [--scenarios two-crates ...]`.
Each run is a process of its own, so that its memory is its own; runs of different planners take turns. Costs are
given as ratios to the best path that any run found. A solution is valid when code that no planner uses finds
no collision (shapely), margins above the minimum, and an end at the goal. `plain-*` are OMPL's planners as its
documentation shows them (`plain_ompl.py`): they stop at their first path, which ends 2 cm from the goal at most.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import statistics
import subprocess
import sys
from dataclasses import asdict, dataclass
from typing import Any

import plain_ompl

from pushplan.bench.processes.machine import Machine
from pushplan.bench.processes.validation import exactly, plan_flaw
from pushplan.kernels import warm_up
from pushplan.plan import plan
from pushplan.scenario.file import load_scenario
from pushplan.util.names import PLANNERS

SCENARIOS = ("free-space", "narrow-gap", "three-boxes-clutter", "two-crates", "five-objects", "carts")
MARKS = (0.03, 0.1, 0.3, 1.0)
"""Shares of the time limit at which costs are compared."""


@dataclass(frozen=True)
class Outcome:
    """One run: what it found when, how fast it searched, and its peak memory."""

    solved: bool
    valid: bool
    first: float
    costs: list[float]
    rate: float
    megabytes: float


def ours(scenario_name: str, planner: str, seed: int, seconds: float) -> Outcome:
    """Run one of our planners for the whole time limit."""
    scenario = load_scenario(scenario_name)
    warm_up(planner)
    result = plan(scenario, planner=planner, seed=seed, time_limit=seconds)
    costs = [
        min((p.cost for p in result.progress if p.seconds <= mark * seconds), default=math.inf)
        for mark in MARKS
    ]
    valid = result.solved and not plan_flaw(exactly(scenario), result)
    first = math.inf if result.first_solution_s is None else result.first_solution_s
    return Outcome(result.solved, valid, first, costs, result.extensions / result.planning_s, _megabytes())


def plain(scenario_name: str, planner: str, seed: int, seconds: float) -> Outcome:
    """Run one of OMPL's planners until its first path, or for the whole time limit."""
    done = plain_ompl.solve(load_scenario(scenario_name), planner, seconds, seed)
    costs = [done.cost if done.seconds <= mark * seconds else math.inf for mark in MARKS]
    first = done.seconds if done.solved else math.inf
    return Outcome(done.solved, done.solved, first, costs, done.steps / done.seconds, _megabytes())


def _megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def in_own_process(*words: object) -> Outcome:
    """Run this script for one run."""
    command = [sys.executable, __file__, "--one", *map(str, words)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=True)
    fields: dict[str, Any] = json.loads(done.stdout.splitlines()[0])
    return Outcome(**fields)


def table(scenario: str, planners: list[str], seeds: int, seconds: float) -> None:
    """Print one scenario's rows."""
    outcomes: dict[str, list[Outcome]] = {planner: [] for planner in planners}
    for seed in range(1, seeds + 1):
        for planner in planners:
            outcomes[planner].append(in_own_process(scenario, planner, seed, seconds))
    exact = [o.costs[-1] for name, found in outcomes.items() if name in PLANNERS for o in found]
    best = min(exact, default=math.inf)
    print(f"\n{scenario}: best cost {best:.4f} m")
    at = " ".join(f"{f'{mark * seconds:g} s':>7}" for mark in MARKS)
    print(f"{'planner':15} {'solved':>7} {'valid':>6} {'first ms':>9} {at} {'extensions/s':>13} {'MB':>5}")
    for planner, found in outcomes.items():
        costs = " ".join(
            f"{statistics.median(o.costs[i] for o in found) / best:7.3f}" for i in range(len(MARKS))
        )
        print(
            f"{planner:15} {sum(o.solved for o in found):3}/{len(found):<3} {sum(o.valid for o in found):6} "
            f"{1e3 * statistics.median(o.first for o in found):9.2f} {costs} "
            f"{statistics.median(o.rate for o in found):13,.0f} {max(o.megabytes for o in found):5.0f}",
            flush=True,
        )


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        scenario, planner, seed, seconds = sys.argv[2:6]
        run = ours if planner in PLANNERS else plain
        print(json.dumps(asdict(run(scenario, planner, int(seed), float(seconds)))), flush=True)
        return
    everyone = [*PLANNERS, *plain_ompl.PLANNERS]
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--planners", nargs="+", choices=everyone, default=everyone)
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    arguments = parser.parse_args()
    print(f"{Machine.this().words}, seeds 1-{arguments.seeds}")
    for scenario in arguments.scenarios:
        table(scenario, arguments.planners, arguments.seeds, arguments.seconds)


if __name__ == "__main__":
    main()
