"""How soon paths are near the best known: every packaged scenario, many seeds, costs over time.

Run `python benchmarks/convergence.py [--planner auto] [--seeds 10] [--seconds 1] [--longer 10]`.
The best known path is the cheapest that any run here found; before, every planner runs once for the longer time to
find one. Prints the share of runs within 1 % of it, the worst run, and first paths. Runs do not end by stalling.
"""

from __future__ import annotations

import argparse
import math
import statistics

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.bench.machine import Machine
from pushplan.examples import example_names
from pushplan.kernels import warm_up
from pushplan.planners.improve.budget import Budget
from pushplan.planners.improve.session import Session
from pushplan.planners.ompl.factories import PLANNERS, planner_named
from pushplan.planners.ompl.search import search
from pushplan.planners.problem.posing import body_reach, build_problem, sampling_box
from pushplan.planners.problem.problem import Problem
from pushplan.reading.scenario_file import load_scenario
from pushplan.scenario import Scenario

MARKS = (0.03, 0.1, 0.3, 1.0)
"""Shares of the time at which costs are looked at."""

NEVER = 10**12


def run(scenario: Scenario, problem: Problem, planner: str, seed: int, seconds: float) -> Session:
    """Return the session of a search that takes all of its time."""
    session = Session(problem, scenario.start, Budget(seconds, stall=NEVER), seed)
    search(session, planner_named(planner)[1], sampling_box(scenario), body_reach(scenario))
    return session


def costs_of(session: Session, seconds: float) -> list[float]:
    """Return the cost of the best path at each of the marks, m."""
    times = [mark * seconds for mark in MARKS]
    return [min((p.cost for p in session.progress if p.seconds <= t), default=math.inf) for t in times]


def measure(name: str, arguments: argparse.Namespace) -> FloatArray:
    """Print a scenario's row; return costs over the best known, by run and mark."""
    scenario = load_scenario(name)
    problem = build_problem(scenario, scenario.stable_set())
    known = [
        run(scenario, problem, planner, 1000, arguments.longer).best_cost
        for planner in (PLANNERS if arguments.longer > 0.0 else ())
    ]
    sessions = [
        run(scenario, problem, arguments.planner, seed, arguments.seconds)
        for seed in range(1, arguments.seeds + 1)
    ]
    costs = np.array([costs_of(session, arguments.seconds) for session in sessions])
    best = min([*known, float(costs.min())])
    firsts = [1e3 * s.progress[0].seconds if s.progress else math.inf for s in sessions]
    medians = " ".join(f"{ratio:8.4f}" for ratio in np.median(costs, axis=0) / best)
    print(
        f"{name:22} {best:8.4f} {statistics.median(firsts):8.2f} {max(firsts):8.2f}  {medians} "
        f"{costs[:, -1].max() / best:8.4f}",
        flush=True,
    )
    return np.asarray(costs / best)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--planner", choices=list(PLANNERS), default="auto")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--longer", type=float, default=10.0, help="for every planner once, s; 0 for none")
    parser.add_argument("--scenarios", nargs="+", default=list(example_names()))
    arguments = parser.parse_args()
    for planner in {arguments.planner, *(PLANNERS if arguments.longer > 0.0 else ())}:
        warm_up(planner)
    print(f"{Machine.this().words}, {arguments.planner}, {arguments.seeds} seeds")
    at = " ".join(f"{f'{mark * arguments.seconds:g} s':>8}" for mark in MARKS)
    print(f"{'scenario':22} {'best m':>8} {'first ms':>8} {'slowest':>8}  {at} {'worst':>8}")
    ratios = np.concatenate([measure(name, arguments) for name in arguments.scenarios])
    for mark, column in zip(MARKS, ratios.T, strict=True):
        print(
            f"after {mark * arguments.seconds:g} s: {np.mean(column <= 1.01):.1%} of {len(column)} runs within 1 % "
            f"of the best known, the worst {column.max() - 1.0:.1%} above it"
        )


if __name__ == "__main__":
    main()
