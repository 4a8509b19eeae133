"""How soon paths are near the best known: costs over time, many seeds, several planners side by side.

Run `python benchmarks/convergence.py [--scenes packaged shared dense] [--dense 44] [--planners auto rrt] [--seeds 6]
[--seconds 1] [--longer 10] [--known known.json] [--stall]`. Scenes are the packaged ones, the three of `passages/`,
or generated ones (`dense_scenes.py`). The best known path is the cheapest that any run found: every planner of
`FOREIGN` runs once for the longer time, too, and what is known is kept in a file, for the next time. `rrt`, `est` and
`kpiece` are OMPL's, with an exact connection to the goal; `cpp-rrt` and `cpp-sst` are OMPL's in C++, with the same
connection in the callback, pruned by the best cost, never shortened (they need g++ and OMPL's headers, Debian:
libompl-dev). Paths are ranked by travel alone, without a price of arcs.
Times are CPU times of the process. Prints for each planner the share of runs within 1 % of the best known, the worst
run, and first paths. Runs do not end by stalling but with `--stall`.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from dense_scenes import NUMBERS
from dense_scenes import scenes as dense_scenes
from extensions_cpp import build, improvements, why_not
from pushplan.bench.processes.machine import Machine

from pushplan.kernels import warm_up
from pushplan.planned import STALL
from pushplan.planners.improve.session import Budget, Session
from pushplan.planners.ompl.factories import planner_named
from pushplan.planners.ompl.search import search
from pushplan.planners.problem.controls import margins_to_try
from pushplan.planners.problem.problem import Problem, body_reach, build_problem, sampling_box
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.model import Scenario

MARKS = (0.1, 0.3, 1.0)
"""Shares of the time at which costs are looked at."""

CPP = "cpp-"
FOREIGN = ("auto", "rrt", "est", "kpiece", "sst")
NEAR, FAR = 1.01, 1.2
NEVER = 10**12
SHARED = Path(__file__).parent / "passages"


@dataclass(frozen=True)
class Run:
    """Costs (m) at the marks and in the end; CPU seconds to the first path and of all; times as infinite if none."""

    costs: tuple[float, ...]
    cost: float
    first: float
    seconds: float
    extensions: int


def scenes(arguments: argparse.Namespace) -> Iterator[Scenario]:
    if "packaged" in arguments.scenes:
        yield from (load_scenario(name) for name in example_names())
    if "shared" in arguments.scenes:
        yield from (load_scenario(path) for path in sorted(SHARED.glob("*.yaml")))
    if "dense" in arguments.scenes:
        yield from dense_scenes(NUMBERS[: arguments.dense])


def run_cpp(scenario: Scenario, problem: Problem, planner: str, seed: int, seconds: float) -> Run:
    """Search with OMPL's C++ planner, in a process of its own."""
    found = improvements(cpp_program(), problem, scenario, planner.removeprefix(CPP), seed, seconds)
    costs = tuple(min((cost for at, cost in found if at <= m * seconds), default=math.inf) for m in MARKS)
    return Run(
        costs,
        min((cost for _, cost in found), default=math.inf),
        found[0][0] if found else math.inf,
        seconds,
        0,
    )


@cache
def cpp_program() -> Path:
    """Build the C++ baselines.

    Raises:
        SystemExit: When they cannot be had.
    """
    missing = why_not()
    if missing is not None:
        raise SystemExit(f"no C++ baselines: {missing}")
    return build(Path(mkdtemp()))


def run(scenario: Scenario, problem: Problem, planner: str, seed: int, seconds: float, stall: int) -> Run:
    """Search with all of the time, unless it stalls."""
    if planner.startswith(CPP):
        return run_cpp(scenario, problem, planner, seed, seconds)
    session = Session(problem, scenario.start, Budget(seconds, stall=stall), seed)
    search(session, planner_named(planner)[1], sampling_box(scenario), body_reach(scenario))
    found = session.progress
    return Run(
        tuple(min((p.cost for p in found if p.seconds <= m * seconds), default=math.inf) for m in MARKS),
        session.best.cost,
        found[0].seconds if found else math.inf,
        session.elapsed,
        session.extensions,
    )


def best_known(name: str, scenario: Scenario, problem: Problem, arguments: argparse.Namespace) -> float:
    """Return the cost of the cheapest path known before and, unless there is one, of long runs of all planners."""
    known = json.loads(arguments.known.read_text()) if arguments.known.exists() else {}
    if name not in known:
        known[name] = min(
            run(scenario, problem, planner, 1000, arguments.longer, NEVER).cost for planner in FOREIGN
        )
        arguments.known.write_text(json.dumps(known, indent=1))
    return float(known[name])


def keep(name: str, cost: float, path: Path) -> None:
    known = json.loads(path.read_text())
    if cost < known[name] - 1e-9:
        path.write_text(json.dumps({**known, name: cost}, indent=1))


def measure(scenario: Scenario, arguments: argparse.Namespace) -> dict[str, list[Run]]:
    """Return the runs of each planner on a scene, costs over the best known; print a line for each."""
    stable = scenario.stable_set()
    scenario = replace(scenario, planner=replace(scenario.planner, cost="travel", arc_price=0.0))
    posed = scenario.with_margin(margins_to_try(scenario, stable)[0])
    problem = build_problem(posed, stable)
    best = best_known(scenario.name, posed, problem, arguments)
    stall = int(STALL * math.sqrt(arguments.seconds)) if arguments.stall else NEVER
    runs = {
        planner: [run(posed, problem, planner, seed, arguments.seconds, stall) for seed in arguments.seed]
        for planner in arguments.planners
    }
    best = min(best, *(r.cost for found in runs.values() for r in found))
    keep(scenario.name, best, arguments.known)
    over = {
        planner: [
            Run(tuple(c / best for c in r.costs), r.cost / best, r.first, r.seconds, r.extensions)
            for r in found
        ]
        for planner, found in runs.items()
    }
    for planner, found in over.items():
        medians = " ".join(f"{ratio:7.3f}" for ratio in np.median([r.costs for r in found], axis=0))
        worst = max(r.cost for r in found)
        first = 1e3 * float(np.median([r.first for r in found]))
        per_second = sum(r.extensions for r in found) / sum(r.seconds for r in found)
        told = f"{scenario.name:20} {planner:8} {best:8.4f} {first:8.2f}  {medians} {worst:7.3f}"
        print(f"{told} {1e-3 * per_second:6.0f}", flush=True)
    return over


def summary(planner: str, runs: list[Run], seconds: float) -> str:
    costs = np.array([r.costs for r in runs])
    firsts = 1e3 * np.array([r.first for r in runs])
    near = (costs <= NEAR).mean(axis=0)
    shares = ", ".join(
        f"{share:.1%} after {mark * seconds:g} s" for mark, share in zip(MARKS, near, strict=True)
    )
    end = np.array([r.cost for r in runs])
    return (
        f"{planner}: {np.isfinite(end).mean():.1%} of {len(runs)} runs solved; within 1 % {shares}, "
        f"{(end <= NEAR).mean():.1%} in the end; {(end > FAR).mean():.1%} more than 20 % off, "
        f"the worst {end.max():.3f}; "
        f"first path {np.median(firsts):.2f} ms, 90 % {np.quantile(firsts, 0.9):.2f} ms; "
        f"{np.mean([r.seconds for r in runs]):.2f} s each"
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", choices=("packaged", "shared", "dense"), default=["packaged"])
    parser.add_argument("--dense", type=int, default=len(NUMBERS), help="number of generated scenes")
    parser.add_argument("--planners", nargs="+", default=["auto"])
    parser.add_argument("--seeds", dest="seed", type=lambda n: range(1, int(n) + 1), default=range(1, 7))
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--longer", type=float, default=10.0, help="for every planner once, s")
    parser.add_argument(
        "--known", type=Path, default=Path("known.json"), help="best costs, read and bettered"
    )
    parser.add_argument("--stall", action="store_true", help="runs may end by stalling, as by default")
    arguments = parser.parse_args()
    for planner in {*arguments.planners, *FOREIGN}:
        if not planner.startswith(CPP):
            warm_up(planner)
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    print(f"{Machine.this().words}, {len(arguments.seed)} seeds, {arguments.seconds:g} s of CPU each")
    at = " ".join(f"{f'{mark * arguments.seconds:g} s':>7}" for mark in MARKS)
    print(f"{'scene':20} {'planner':8} {'best m':>8} {'first ms':>8}  {at} {'worst':>7} {'k ext/s':>7}")
    every: dict[str, list[Run]] = {planner: [] for planner in arguments.planners}
    for scenario in scenes(arguments):
        for planner, runs in measure(scenario, arguments).items():
            every[planner] += runs
    for planner, runs in every.items():
        print(summary(planner, runs, arguments.seconds))
    return 0


if __name__ == "__main__":
    sys.exit(main())
