"""The package's planner against others on the same problems, by CPU time: one command, one table.

    python benchmarks/peers.py [--families everyday dense series gaps] [--planners ...] [--seconds 1] [--seeds 2]

Every problem is searched by travel with all of the time: by `auto`; by OMPL's control planners that the package
offers; by OMPL's geometric planners over Dubins' car, which the chain is for turns about two of its own points
(`dubins_planners.py`); and by hybrid A* in C++ (`hybrid_astar.cpp`, needs g++). All see the same stable set, checks
of collision that prove the same clearance, and the same goal, which all reach exactly by the same words. Hybrid A*
has the largest margin that `auto` tries, begins when the problem is read, and does not shorten its paths. Families
are those of `ablation.py`.

Printed for each planner and family: the runs with a path, CPU time to the first one (median and nine tenths, of the
runs that have one), the share within 1 % of the cheapest path that any run found, and the mean excess over it.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from ablation import FAMILIES, scenes

from pushplan.bench.store import Machine
from pushplan.core.problem import Problem
from pushplan.errors import PushplanError
from pushplan.planner import Planner
from pushplan.planners.controls import margins_to_try
from pushplan.planners.problem import build_problem, sampling_box
from pushplan.scenario.model import Scenario

PLANNERS = (
    "auto",
    "rrt",
    "est",
    "kpiece",
    "dubins_planners:RRTOverDubins",
    "dubins_planners:BITStarOverDubins",
    "hybrid-astar",
)
NEAR = 1.01


@dataclass(frozen=True)
class Run:
    """Cost (m) in the end, and CPU seconds to the first path; infinite if there is none."""

    cost: float
    first: float


def write(problem: Problem, scenario: Scenario, path: Path) -> None:
    """Write a problem for the program in C++."""
    scene = problem.scene
    numbers = [scene.clearance, scene.kept, problem.longest, scenario.chain.reach]
    arrays = {
        "body_corners": scene.body.corners,
        "body_starts": scene.body.starts[:, None],
        "body_bounds": scene.body.bounds,
        "body_bound": scene.body_bound[None],
        "obstacles_corners": scene.obstacles.corners,
        "obstacles_starts": scene.obstacles.starts[:, None],
        "obstacles_bounds": scene.obstacles.bounds,
        "circles": scene.circles,
        "walls": scene.walls[None],
        "segments": problem.segments,
        "families": problem.families.reshape(-1, 3),
        "goal": problem.goal[None],
        "start": np.asarray(scenario.start)[None],
        "box": np.array([sampling_box(scenario)]),
        "numbers": np.array([numbers]),
    }
    with path.open("w") as file:
        for name, array in arrays.items():
            file.write(f"{name} {array.shape[0]} {array.shape[1]}\n")
            file.write(" ".join(repr(float(value)) for value in array.ravel()) + "\n")


def hybrid_astar(scenario: Scenario, seconds: float, folder: Path) -> Run:
    """Search with all of the time by hybrid A*, with the largest margin that `auto` tries."""
    stable, program, data = scenario.stable_set(), folder / "hybrid_astar", folder / "problem.txt"
    if not program.exists():
        source = Path(__file__).with_name("hybrid_astar.cpp")
        subprocess.run(["g++", "-std=c++17", "-O3", "-march=native", source, "-o", program], check=True)
    chosen = scenario.with_margin(margins_to_try(scenario, stable)[0])
    write(build_problem(chosen, stable), chosen, data)
    told = subprocess.run([program, data, str(seconds)], check=True, capture_output=True, text=True).stdout
    found = [[float(word) for word in line.split()] for line in told.splitlines()]
    return Run(found[-1][1], found[0][0]) if found else Run(math.inf, math.inf)


def run(scenario: Scenario, planner: str, seed: int, seconds: float) -> Run:
    """Search with all of the time by a planner of the package, or one named by its module."""
    try:
        found = Planner(scenario, planner=planner).plan(
            first=False, timed=False, explain=False, seed=seed, time_limit=seconds, gap=0.0
        )
    except PushplanError as error:
        print(f"{scenario.name}, {planner}: {error}", file=sys.stderr)
        return Run(math.inf, math.inf)
    if not found.solved or found.cost is None or found.first_solution_s is None:
        return Run(math.inf, math.inf)
    return Run(found.cost, found.first_solution_s)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=FAMILIES)
    parser.add_argument("--planners", nargs="+", default=PLANNERS, help="names, or module:attribute")
    parser.add_argument("--seconds", type=float, default=1.0, help="CPU time of each search")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--scenes", type=int, default=10, help="number of dense scenes")
    given = parser.parse_args()
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    print(f"{Machine.this().words}, {given.seeds} seeds, {given.seconds:g} s of CPU each\n")
    with TemporaryDirectory() as folder:
        cells = compare(given, Path(folder))
    print(f"| planner | {' | '.join(given.families)} |\n|---|{'---|' * len(given.families)}")
    for planner, of_families in cells.items():
        print(f"| {planner.rsplit(':', maxsplit=1)[-1]} | {' | '.join(of_families)} |")
    return 0


def compare(given: argparse.Namespace, programs: Path) -> dict[str, list[str]]:
    """Return the cells of each planner, one for each family."""
    cells: dict[str, list[str]] = {planner: [] for planner in given.planners}
    for family in given.families:
        every: dict[str, list[Run]] = {planner: [] for planner in given.planners}
        for scenario in scenes(family, given.scenes):
            asked = scenario.with_planner(cost="travel", arc_price=0.0)
            runs = {
                planner: [
                    hybrid_astar(asked, given.seconds, programs)
                    if planner == "hybrid-astar"
                    else run(asked, planner, seed, given.seconds)
                    for seed in range(1, given.seeds + 1)
                ]
                for planner in given.planners
            }
            best = min(one.cost for found in runs.values() for one in found)
            for planner, found in runs.items():
                every[planner] += [
                    replace(one, cost=one.cost / best if best < math.inf else math.inf) for one in found
                ]
        for planner, found in every.items():
            cells[planner].append(cell(found))
            print(f"{family}, {planner}: {cells[planner][-1]}", file=sys.stderr, flush=True)
    return cells


def cell(runs: list[Run]) -> str:
    """Return the text of a planner's results on a family."""
    costs = np.array([one.cost for one in runs])
    solved = np.isfinite(costs)
    if not solved.any():
        return f"0 of {len(runs)}"
    firsts = 1e3 * np.array([one.first for one in runs])[solved]
    return (
        f"{solved.sum()} of {len(runs)}; {np.median(firsts):.3g}, "
        f"{np.quantile(firsts, 0.9, method='higher'):.3g} ms; {100 * (costs <= NEAR).mean():.0f} %, "
        f"{100 * (costs[solved].mean() - 1.0):.1f} %"
    )


if __name__ == "__main__":
    sys.exit(main())
