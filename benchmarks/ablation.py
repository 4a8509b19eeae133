"""Gain by each part of `auto`: the same searches without it, on four families of scenes, by CPU time.

Run `python benchmarks/ablation.py [--families series ...] [--parts lattice ...] [--seeds 6] [--seconds 1]`.
Every scene is planned with `auto` as it is, again with other seeds (what differs there is chance), and with one
part after the other left out (`PARTS`). Plans are ranked by the default objective, their duration. Prints for each
family and part the share of runs that find a plan, the shares within 1 % of the shortest duration that any run here
found, with 0.1, 0.3 and 1 of the time, the mean excess over that duration, and first paths. Families: packaged
scenarios (everyday), `dense_scenes.py`, rooms in series and narrow gaps of `series.py`.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

import dense_scenes
import numpy as np
import series

from pushplan.bench.store import Machine
from pushplan.planner import Planner
from pushplan.planners.search import planners
from pushplan.planners.search.session import Session
from pushplan.scenario.file import example_names, load_scenario
from pushplan.scenario.model import Scenario

MARKS = (0.1, 0.3, 1.0)
"""Shares of the time that plans are made with."""

NEAR = 1.01
FAMILIES = ("everyday", "dense", "series", "gaps")


@dataclass(frozen=True)
class Run:
    """Durations (s) of the plans for each share of the time, and CPU seconds to the first path; infinite if none."""

    durations: tuple[float, ...]
    first: float


def run(scenario: Scenario, seed: int, seconds: float) -> Run:
    """Plan with each share of the time."""
    planner = Planner(scenario, planner="auto")
    plans = [planner.plan(first=False, seed=seed, time_limit=m * seconds, explain=False) for m in MARKS]
    first = plans[-1].first_solution_s
    return Run(
        tuple(math.inf if plan.duration is None else plan.duration for plan in plans),
        math.inf if first is None else first,
    )


def _nothing(*_: Any, **__: Any) -> None:
    return None


def _forward(self: Any, arcs: float) -> None:
    """Run the rounds of `LatticeRounds.run` from the start only."""
    session, pathless = self._session, not self._session.solved
    while sum(self._tried) < arcs and not session.finished:
        self._search(0)
        if pathless and session.solved:
            return


AGAIN = "nothing, other seeds"

PARTS: dict[str, Callable[[], Any]] = {
    "nothing": nullcontext,
    AGAIN: nullcontext,
    "lattice": lambda: mock.patch.object(planners.LatticeRounds, "run", _nothing),
    "lattice back from the goal": lambda: mock.patch.object(planners.LatticeRounds, "run", _forward),
    "OMPL's trees": lambda: mock.patch.object(planners.MeetingTrees, "grow", _nothing),
    "bottlenecks": lambda: mock.patch.object(planners.Ways, "run", _nothing),
    "refining": lambda: mock.patch.object(Session, "refine", _nothing),
}
"""What is left out, and how."""


def scenes(family: str, count: int) -> Iterator[Scenario]:
    match family:
        case "everyday":
            yield from (load_scenario(name) for name in example_names())
        case "dense":
            yield from dense_scenes.scenes(dense_scenes.NUMBERS[:count])
        case "series":
            yield from (room for room in series.scenes(quick=True) if "mm" not in room.name)
        case "gaps":
            yield from (room for room in series.scenes(quick=True) if "mm" in room.name)


def measure(scenario: Scenario, arguments: argparse.Namespace) -> dict[str, list[Run]]:
    found: dict[str, list[Run]] = {}
    for part in arguments.parts:
        with PARTS[part]():
            begin = 1001 if part == AGAIN else 1
            found[part] = [run(scenario, seed, arguments.seconds) for seed in range(begin, begin + arguments.seeds)]
    best = min(r.durations[-1] for runs in found.values() for r in runs)
    return {
        part: [replace(r, durations=tuple(duration / best for duration in r.durations)) for r in runs]
        for part, runs in found.items()
        if math.isfinite(best)
    }


def report(family: str, every: dict[str, list[Run]]) -> None:
    """Print a line for each part; the mean excess is of the runs that found a plan."""
    print(
        f"\n{family + ', without':28} {'solved':>7}  {'within 1 % after 0.1, 0.3, 1':28} {'excess':>7} first ms, 90 %"
    )
    for part, runs in every.items():
        durations, firsts = np.array([r.durations for r in runs]), 1e3 * np.array([r.first for r in runs])
        end, near = durations[:, -1], (durations <= NEAR).mean(axis=0)
        excess = end[np.isfinite(end)].mean() - 1.0
        print(
            f"{part:28} {100 * np.isfinite(end).mean():7.1f}  "
            f"{' '.join(f'{100 * share:7.1f}' for share in near):28} {100 * excess:7.2f} "
            f"{np.median(firsts):8.2f} {np.quantile(firsts, 0.9, method='higher'):8.2f}",
            flush=True,
        )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument("--scenes", type=int, default=30, help="number of dense scenes")
    arguments = parser.parse_args()
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    print(f"{Machine.this().words}, {arguments.seeds} seeds, {arguments.seconds:g} s of CPU each")
    for family in arguments.families:
        every: dict[str, list[Run]] = {part: [] for part in arguments.parts}
        for scenario in scenes(family, arguments.scenes):
            for part, runs in measure(scenario, arguments).items():
                every[part] += runs
            print(f"{scenario.name} done", file=sys.stderr, flush=True)
        report(family, every)
    return 0


if __name__ == "__main__":
    sys.exit(main())
