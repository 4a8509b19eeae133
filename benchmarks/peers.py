"""The package's planner against others on the same problems, by CPU time: one command, one table.

    python benchmarks/peers.py [--families everyday dense series gaps many] [--planners ...] [--seconds 1] [--seeds 2]

Every problem is searched by travel with all of the time: by `auto`; by OMPL's control planners that the package
offers; by OMPL's geometric planners over Dubins' car, which the chain is for turns about two of its own points
(`dubins_planners.py`); and, where there is a C++ compiler and OMPL's headers are installed (`extensions_cpp.py`), by
OMPL's control planners in C++ (`cpp-...`) and by hybrid A* (`hybrid_astar.cpp`). All see the same stable set, checks
of collision that prove the same clearance, and the same goal, which all reach exactly by the same words. Those in C++
have the largest margin that `auto` tries, begin when the problem is read, and do not shorten their paths. Families
are those of `ablation.py`, and chains of 8, 20 and 50 boxes in a room with pillars.

Printed for each planner and family: the runs with a path, CPU time to the first one (median and nine tenths, of the
runs that have one), the share within 1 % of the cheapest path that any run found, and the mean excess over it.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import extensions_cpp
import numpy as np
from ablation import FAMILIES, scenes

from pushplan.bench.store import Machine
from pushplan.errors import PushplanError
from pushplan.planner import Planner
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.model import Scenario

PLANNERS = (
    "auto",
    "rrt",
    "est",
    "kpiece",
    "dubins_planners:RRTOverDubins",
    "dubins_planners:BITStarOverDubins",
    "cpp-rrt",
    "cpp-sst",
    "cpp-est",
    "cpp-kpiece",
    "hybrid-astar",
)
CPP = ("cpp-", "hybrid-")
"""How the names of the planners in C++ begin."""

BOXES = (8, 20, 50)
"""How many boxes the chains of the family `many` have."""

NEAR = 1.01


@dataclass(frozen=True)
class Run:
    """Cost (m) in the end, and CPU seconds to the first path; infinite if there is none."""

    cost: float
    first: float


def many() -> Iterator[Scenario]:
    """Yield chains of boxes in a room with pillars."""
    for count in BOXES:
        side = 0.06 * count + 4.0
        yield scenario_from_document(
            {
                "format": "pushplan/1",
                "name": f"{count}-boxes",
                "floor": {"friction": 0.3},
                "objects": [{"name": f"b{i}", "shape": {"box": [0.06, 0.12]}, "mass": 0.5} for i in range(count)],
                "contacts": {"friction": 0.5},
                "pusher": {"width": 0.12, "friction": 0.5},
                "start": [0.5, 0.5, 0.0],
                "goal": {"pose": [side - 0.5 - 0.06 * count, side - 0.5, 0.0], "of": "b0"},
                "workspace": {"x": [0.0, side], "y": [0.0, side]},
                "obstacles": [
                    {"circle": 0.1, "center": [0.5 * side + dx, 0.5 * side + dy]}
                    for dx in (-0.8, 0.8)
                    for dy in (-0.6, 0.6)
                ],
            }
        )


def problems(family: str, count: int) -> Iterator[Scenario]:
    """Yield the problems of a family."""
    yield from many() if family == "many" else scenes(family, count)


def run_cpp(scenario: Scenario, planner: str, seed: int, seconds: float, programs: Path) -> Run:
    """Search for the whole time with a planner in C++."""
    chosen, problem = extensions_cpp.posed(scenario)
    name = "hybrid_astar" if planner == "hybrid-astar" else "extensions"
    found = extensions_cpp.improvements(programs / name, problem, chosen, planner.removeprefix("cpp-"), seed, seconds)
    return Run(found[-1][1], found[0][0]) if found else Run(math.inf, math.inf)


def run(scenario: Scenario, planner: str, seed: int, seconds: float) -> Run:
    """Search for the whole time."""
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
    families = (*FAMILIES, "many")
    parser.add_argument("--families", nargs="+", choices=families, default=families)
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
    missing = extensions_cpp.why_not() if any(name.startswith(CPP) for name in given.planners) else None
    if missing is not None:
        print(f"planners in C++ skipped: {missing}", file=sys.stderr)
        given.planners = [name for name in given.planners if not name.startswith(CPP)]
    elif any(name.startswith(CPP) for name in given.planners):
        for program in ("extensions", "hybrid_astar"):
            extensions_cpp.build(programs, program)
    cells: dict[str, list[str]] = {planner: [] for planner in given.planners}
    for family in given.families:
        every: dict[str, list[Run]] = {planner: [] for planner in given.planners}
        for scenario in problems(family, given.scenes):
            asked = scenario.with_planner(cost="travel", arc_price=0.0)
            runs = {
                planner: [
                    run_cpp(asked, planner, seed, given.seconds, programs)
                    if planner.startswith(CPP)
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
