"""Optimality gaps of plans: `python benchmarks/gaps.py`.

Packaged scenarios, ranked by travel and by time, and goals beside, behind and turned on the spot in an empty room.
The searches end by iterations, so that every machine prints the same numbers but for the last column.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from script import options

import pushplan
from pushplan.geometry import se2
from pushplan.scenario.model import Scenario

ITERATIONS = 20_000
NEAR = {"20 mm aside": (0.0, 0.02, 0.0), "0.2 m behind": (-0.2, 0.0, 0.0), "0.3 rad on the spot": (0.0, 0.0, 0.3)}


def cases() -> Iterator[tuple[str, str, Scenario]]:
    """Yield family, name and scenario."""
    for name in pushplan.example_names():
        scenario = pushplan.load_scenario(name)
        yield "packaged", name, scenario
        for what, away in NEAR.items():
            goal = replace(scenario.goal, pose_chain=se2.compose(scenario.start, np.array(away)))
            yield "near goals", f"{name}, {what}", replace(scenario.with_goal(goal), obstacles=(), workspace=None)


def main() -> None:
    options(__doc__)
    found: dict[tuple[str, str], list[float]] = {}
    print(f"{'scenario':42}{'by':8}{'gap, %':>10}{'bound, ms of a processor':>28}")
    for (family, name, scenario), by in product(cases(), ("travel", "time")):
        asked = scenario.with_planner(cost=by, arc_price=0.0)  # then the ranked cost is the one of the bound
        plan = pushplan.plan(asked, seed=1, iterations=ITERATIONS, time_limit=600.0)
        began = time.process_time()
        gap = plan.gap  # its bound is computed on demand
        spent = 1e3 * (time.process_time() - began)
        if gap is None:
            print(f"{name:42}{by:8}{'none: ' + plan.reason}")
            continue
        found.setdefault((family, by), []).append(100.0 * gap)
        print(f"{name:42}{by:8}{100.0 * gap:10.2f}{spent:28.0f}", flush=True)
    for (family, by), gaps in found.items():
        print(f"{family}, by {by}: median {np.median(gaps):.2f} %, largest {max(gaps):.2f} %, of {len(gaps)}")


if __name__ == "__main__":
    main()
