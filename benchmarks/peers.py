"""The planner of pushplan and others on the same problems, by CPU time.

    python benchmarks/peers.py [--families everyday dense series gaps] [--planners ...] [--seconds 1] [--seeds 2]
        [--scenes 10]

Every problem is searched by travel with all of the time: by `auto`; by OMPL's control planners that pushplan offers;
by OMPL's geometric planners over Dubins' car (`dubins_planners.py`); and by hybrid A* in C++ (`hybrid_astar.cpp`,
needs g++). All have the same stable set, collision checks that prove the same clearance, and the same goal, which
all reach exactly by the same arcs. Hybrid A* has the largest margin that `auto` tries, starts after the problem is
read, and does not shorten its paths. Families are those of `ablation.py`.

Prints for each planner and family: the runs with a path, CPU time to the first one (median and 90 % of the runs that
have one), the share within 1 % of the cheapest path that any run found, and the mean excess over it.
"""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from ablation import FAMILIES, NEAR, scenes, tenth
from script import options

from pushplan.errors import PushplanError
from pushplan.planner import Planner
from pushplan.planners.controls import margins_to_try
from pushplan.planners.problem import build_problem, sampling_box
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

DUBINS = ("dubins_planners:RRTOverDubins", "dubins_planners:BITStarOverDubins")
PLANNERS = ("auto", "rrt", "est", "kpiece", *DUBINS, "hybrid-astar")
NONE = (math.inf, math.inf)


def write(scenario: Scenario, path: Path) -> None:
    """Write a problem with the largest margin that `auto` tries for the program in C++."""
    stable = scenario.stable_set()
    problem = build_problem(scenario.with_margin(margins_to_try(scenario, stable)[0]), stable)
    scene = problem.scene
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
        "numbers": np.array([[scene.clearance, scene.kept, problem.longest, scenario.chain.reach]]),
    }
    with path.open("w") as file:
        for name, array in arrays.items():
            file.write(f"{name} {array.shape[0]} {array.shape[1]}\n")
            file.write(" ".join(repr(float(value)) for value in array.ravel()) + "\n")


def hybrid_astar(scenario: Scenario, seconds: float, folder: Path) -> tuple[float, float]:
    """Return cost (m) and CPU seconds to the first path of hybrid A*, which is compiled into a folder."""
    program, data = folder / "hybrid_astar", folder / "problem.txt"
    if not program.exists():
        source = Path(__file__).with_name("hybrid_astar.cpp")
        subprocess.run(["g++", "-std=c++17", "-O3", "-march=native", source, "-o", program], check=True)
    write(scenario, data)
    told = subprocess.run([program, data, str(seconds)], check=True, capture_output=True, text=True).stdout
    found = [[float(word) for word in line.split()] for line in told.splitlines()]
    return (found[-1][1], found[0][0]) if found else NONE


def run(scenario: Scenario, planner: str, seed: int, seconds: float, folder: Path) -> tuple[float, float]:
    """Return the cost (m) of a path in the end, and CPU seconds to the first path; infinite if there is none."""
    if planner == "hybrid-astar":
        return hybrid_astar(scenario, seconds, folder)
    try:
        found = Planner(scenario, planner=planner).plan(
            first=False, timed=False, explain=False, seed=seed, time_limit=seconds, gap=0.0
        )
    except PushplanError as error:
        print(f"{scenario.name}, {planner}: {error}", file=sys.stderr)
        return NONE
    if not found.solved or found.cost is None or found.first_solution_s is None:
        return NONE
    return found.cost, found.first_solution_s


def cell(costs: FloatArray, firsts: FloatArray) -> str:
    """Return the text of a planner's results on a family; costs are relative to the best ones."""
    solved = np.isfinite(costs)
    if not solved.any():
        return f"0 of {len(costs)}"
    times = 1e3 * firsts[solved]
    return (
        f"{solved.sum()} of {len(costs)}; {np.median(times):.3g}, {tenth(times):.3g} ms; "
        f"{100 * (costs <= NEAR).mean():.0f} %, {100 * (costs[solved].mean() - 1.0):.1f} %"
    )


def main() -> None:
    asked = options(__doc__, families=FAMILIES, planners=PLANNERS, seconds=1.0, seeds=2, scenes=10)
    cells: dict[str, list[str]] = {planner: [] for planner in asked.planners}
    with TemporaryDirectory() as folder:
        for family in asked.families:
            tables = []
            for stated in scenes(family, asked.scenes):
                scenario, seeds = stated.with_planner(cost="travel", arc_price=0.0), range(1, asked.seeds + 1)
                table = np.array(
                    [
                        [run(scenario, planner, seed, asked.seconds, Path(folder)) for seed in seeds]
                        for planner in cells
                    ]
                )
                best = table[..., 0].min()
                table[..., 0] = table[..., 0] / best if math.isfinite(best) else math.inf
                tables.append(table)
            for row, planner in zip(np.concatenate(tables, axis=1), cells, strict=True):
                cells[planner].append(cell(*row.T))
                print(f"{family}, {planner}: {cells[planner][-1]}", file=sys.stderr, flush=True)
    print(f"| planner | {' | '.join(asked.families)} |\n|---|{'---|' * len(asked.families)}")
    for planner, of_families in cells.items():
        print(f"| {planner.rsplit(':', maxsplit=1)[-1]} | {' | '.join(of_families)} |")


if __name__ == "__main__":
    main()
