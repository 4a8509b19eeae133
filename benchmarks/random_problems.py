"""Random problems: what share of those that any planner solves does `auto` solve in two seconds?

Run `python benchmarks/random_problems.py [--count 200] [--longer 10]`. Every problem goes to `auto` first. Those that
it leaves open go to every planner, `auto` among them, with the longer limit, until one solves it, but for those that
are proven to have no path (see `pushplan.planners.infeasible`). Every path found is checked by code that no
planner uses: collisions by shapely, margins from the stable set, the goal from the path's end. Prints a line for each
problem that stays open, and the shares. Exits 1 when a path fails a check.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field

import numpy as np

from pushplan.bench.processes.machine import Machine
from pushplan.bench.processes.validation import exactly, plan_flaw
from pushplan.bench.random_problems.generator import generate
from pushplan.bench.random_problems.parameters import DRIVES, GeneratorError, ProblemParameters
from pushplan.errors import PushplanError
from pushplan.kernels import warm_up
from pushplan.plan import plan
from pushplan.plans.result import PlanResult
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.util.names import PLANNERS

PARAMETERS = ProblemParameters(objects=(1, 5), obstacles=(0, 30), drives=DRIVES)


@dataclass
class Tally:
    posed: int = 0
    solved: int = 0
    solvable: int = 0
    hopeless: int = 0
    firsts: list[float] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


def attempt(scenario: Scenario, planner: str, seconds: float, tally: Tally, seed: int) -> PlanResult:
    result = plan(scenario, planner=planner, seed=1, time_limit=seconds)
    if result.solved and (fault := plan_flaw(exactly(scenario), result)):
        tally.failures.append(f"problem {seed}, {planner}: {fault}")
    return result


def others(scenario: Scenario, seconds: float, tally: Tally, seed: int) -> str | None:
    """Name of the first planner that solves a problem within the longer limit."""
    for name in PLANNERS:
        try:
            if attempt(scenario, name, seconds, tally, seed).solved:
                return name
        except PushplanError as error:
            print(f"  problem {seed}: {name} refuses: {error}")
    return None


def one_problem(seed: int, arguments: argparse.Namespace, tally: Tally) -> None:
    try:
        text = generate(PARAMETERS, seed)
        scenario = scenario_from_text(text, f"random {seed}")
    except GeneratorError as error:
        print(f"  problem {seed} cannot be made: {error}")
        return
    tally.posed += 1
    result = attempt(scenario, "auto", arguments.limit, tally, seed)
    if result.solved:
        tally.solved += 1
        tally.solvable += 1
        tally.firsts.append(result.first_solution_s or 0.0)
        return
    if any(item.proven for item in result.diagnosis):
        tally.hopeless += 1
        return
    found = others(scenario, arguments.longer, tally, seed)
    tally.solvable += found is not None
    told = f"solved by {found} in {arguments.longer:g} s" if found else "solved by no planner"
    print(f"  problem {seed} ({text.splitlines()[0][2:]}): not by auto ({result.reason}); {told}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=2.0, help="of auto, s")
    parser.add_argument(
        "--longer", type=float, default=10.0, help="of every planner on what auto left open, s"
    )
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.count)
    print(f"{Machine.this().words}, seeds {seeds[0]}-{seeds[-1]}, {PARAMETERS}")
    for name in PLANNERS:
        warm_up(name)
    tally = Tally()
    for seed in seeds:
        one_problem(seed, arguments, tally)
    print(
        f"{tally.posed} problems, {tally.hopeless} proven to have no path, {tally.solvable} solved by any planner, "
        f"{tally.solved} by auto in {arguments.limit:g} s"
    )
    print(f"share of the solvable that auto solves: {tally.solved / max(tally.solvable, 1):.1%}")
    if tally.firsts:
        quantiles = 1e3 * np.quantile(tally.firsts, [0.5, 0.9, 1.0])
        print("first solution of auto, ms: median {:.1f}, 90 % {:.1f}, most {:.1f}".format(*quantiles))
    for failure in tally.failures:
        print(f"  INVALID {failure}")
    return 1 if tally.failures else 0


if __name__ == "__main__":
    sys.exit(main())
