"""Gain by each part of `auto`: the same searches without it, on four families of scenes, by CPU time.

    python benchmarks/ablation.py [--families series ...] [--scenes 30] [--seeds 6] [--seconds 1]

Every scene is planned with `auto` as it is, again with other seeds (what differs there is chance), and with one part
after the other left out (`PARTS`). Plans are ranked by the default objective, their duration. Prints for each family
and part the share of runs that find a plan, the shares within 1 % of the shortest duration that any run here found,
with 0.1, 0.3 and 1 of the time, the mean excess over that duration, and first paths. Families: packaged scenarios
(everyday), `dense_scenes.py`, rooms in series and narrow gaps of `series.py`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import Any
from unittest import mock

import dense_scenes
import numpy as np
import series
from script import options

from pushplan.planner import Planner
from pushplan.planners.search import planners
from pushplan.planners.search.session import Session
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

MARKS = (0.1, 0.3, 1.0)
"""Shares of the time that plans are made with."""
NEAR = 1.01
FAMILIES = ("everyday", "dense", "series", "gaps")


def scenes(family: str, count: int) -> Iterator[Scenario]:
    match family:
        case "everyday":
            yield from (load_scenario(name) for name in example_names())
        case "dense":
            yield from dense_scenes.scenes(dense_scenes.NUMBERS[:count])
        case _:
            yield from (room for room in series.scenes() if ("mm" in room.name) == (family == "gaps"))


def _nothing(*_: Any, **__: Any) -> None:
    return None


AGAIN = "nothing, other seeds"
PARTS: dict[str, Callable[[], Any]] = {
    "nothing": nullcontext,
    AGAIN: nullcontext,
    "lattice": lambda: mock.patch.object(planners.LatticeRounds, "run", _nothing),
    "OMPL's trees": lambda: mock.patch.object(planners.MeetingTrees, "grow", _nothing),
    "bottlenecks": lambda: mock.patch.object(planners.Ways, "run", _nothing),
    "refining": lambda: mock.patch.object(Session, "refine", _nothing),
}
"""What is left out, and how."""


def run(scenario: Scenario, seed: int, seconds: float) -> list[float]:
    """Return the durations (s) of the plans with each share of the time, and CPU ms to the first path."""
    planner = Planner(scenario, planner="auto")
    plans = [planner.plan(first=False, seed=seed, time_limit=m * seconds, explain=False) for m in MARKS]
    first = plans[-1].first_solution_s
    durations = [math.inf if plan.duration is None else plan.duration for plan in plans]
    return [*durations, math.inf if first is None else 1e3 * first]


def measure(scenario: Scenario, seeds: int, seconds: float) -> dict[str, FloatArray]:
    """Return the rows of `run` by part, with durations over the shortest one; nothing if no run found a plan."""
    found = {}
    for part, left_out in PARTS.items():
        begin = 1001 if part == AGAIN else 1
        with left_out():
            found[part] = np.array([run(scenario, seed, seconds) for seed in range(begin, begin + seeds)])
    best = min(rows[:, -2].min() for rows in found.values())
    return {part: rows / [*[best] * len(MARKS), 1.0] for part, rows in found.items() if math.isfinite(best)}


def tenth(values: FloatArray) -> float:
    """Return the 90th percentile of some values."""
    return float(np.quantile(values, 0.9, method="higher"))


def main() -> None:
    asked = options(__doc__, families=FAMILIES, scenes=30, seeds=6, seconds=1.0)
    for family in asked.families:
        every: dict[str, list[FloatArray]] = {part: [] for part in PARTS}
        for scenario in scenes(family, asked.scenes):
            for part, rows in measure(scenario, asked.seeds, asked.seconds).items():
                every[part].append(rows)
            print(f"{scenario.name} done", file=sys.stderr, flush=True)
        print(f"\n{family + ', without':28} solved  within 1 % after 0.1, 0.3, 1   excess, first ms, 90 %")
        for part, found in every.items():
            *durations, first = np.concatenate(found).T
            end = durations[-1][np.isfinite(durations[-1])]
            near = "".join(f"{100 * (one <= NEAR).mean():8.1f}" for one in durations)
            print(
                f"{part:28}{100 * len(end) / len(first):7.1f}  {near}     {100 * (end.mean() - 1.0):7.2f} "
                f"{np.median(first):8.2f} {tenth(first):8.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
