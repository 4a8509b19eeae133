"""Gain of `auto` by OMPL's trees, and comparison of two checkouts in turn, by CPU time.

    python benchmarks/engines.py [OTHER_CHECKOUT] [--families everyday dense series gaps] [--seeds 20]
        [--scenes 22] [--best-seeds 6]

Every scene of `ablation.py` is searched with every seed: until the first path, by this checkout, by this checkout
without OMPL's trees, and by the other one, each in a process of its own with its own `.venv`; and with
`--best-seeds` of them for a second. Printed for each family: first paths and who found them, whole first plans, and
the duration of the plan after a second (the default objective), as ratios of this checkout to the other one; for each
scene with a search, the time to the first path with and without OMPL's trees.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent.parent
FAMILIES = ("everyday", "dense", "series", "gaps")
LIMIT = 10.0
"""CPU seconds of a search for a first path, at most."""

FREE = 0.7
"""A search that takes no more ms than this found a free steering path."""


def serve(checkout: str, count: int) -> None:
    """Answer requests, one line of JSON each: family, number of the scene, seed, and the quantity."""
    sys.path[0] = str(Path(checkout) / "benchmarks")
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    import ablation

    import pushplan
    from pushplan.planners.controls import margins_to_try
    from pushplan.planners.problem import build_problem, sampling_box
    from pushplan.planners.search import planners, session
    from pushplan.planners.search.search import Search

    rule: Any = getattr(session, "StopRule", None) or session.Budget  # type: ignore[attr-defined]
    trees: Any = getattr(planners, "MeetingTrees", None)
    found_by: list[str] = []
    grow: Any = trees and trees.grow

    def watched(self: Any, extensions: int) -> None:
        grow(self, extensions)
        if self._session.solved:
            found_by.append("ompl")

    kept = {family: list(ablation.scenes(family, count)) for family in FAMILIES}
    posed: dict[tuple[str, int], Any] = {}

    def problem_of(family: str, number: int) -> Any:
        if (family, number) not in posed:
            scenario = kept[family][number].with_planner(cost="travel", arc_price=0.0)
            stable = scenario.stable_set()
            scenario = scenario.with_margin(margins_to_try(scenario, stable)[0])
            posed[family, number] = scenario, build_problem(scenario, stable)
        return posed[family, number]

    def searched(family: str, number: int, seed: int) -> float:
        scenario, problem = problem_of(family, number)
        firsts: list[float] = []
        one = session.Session(
            problem, scenario.start, rule(LIMIT, first=True), seed, lambda _, __, ___, spent: firsts.append(spent)
        )
        Search(one, planners.planner_named("auto")[1], sampling_box(scenario), scenario.chain.reach).run()
        return firsts[0] if firsts else math.inf

    def best(family: str, number: int, seed: int) -> float:
        duration: float | None = pushplan.plan(kept[family][number], seed=seed, time_limit=1.0).duration
        return math.inf if duration is None else duration

    def whole(family: str, number: int, seed: int) -> float:
        began = time.process_time()
        pushplan.plan(kept[family][number], seed=seed, first=True, time_limit=LIMIT)
        return time.process_time() - began

    for family, rooms in kept.items():
        print(json.dumps([family, [room.name for room in rooms]]), flush=True)
    for line in sys.stdin:
        family, number, seed, asked = json.loads(line)
        answer: Any = None
        if trees is not None:
            trees.grow = (lambda *_: None) if asked == "without" else watched
        found_by.clear()
        if asked in ("first", "without"):
            answer = searched(family, number, seed)
        elif asked == "best":
            answer = best(family, number, seed)
        elif asked == "whole":
            answer = whole(family, number, seed)
        print(json.dumps([answer, *found_by[:1]]), flush=True)


class Checkout:
    """A process that answers for a checkout."""

    def __init__(self, folder: Path, count: int) -> None:
        self._process = subprocess.Popen(
            [str(folder / ".venv/bin/python"), __file__, "--serve", str(folder), "--scenes", str(count)],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.scenes: dict[str, list[str]] = dict(self._read() for _ in FAMILIES)

    def _read(self) -> Any:
        assert self._process.stdout is not None
        return json.loads(self._process.stdout.readline())

    def ask(self, *question: Any) -> Any:
        """Return the answer to a request."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(question) + "\n")
        self._process.stdin.flush()
        return self._read()


Times = np.ndarray[Any, Any]


def ask_all(family: str, here: Checkout, there: Checkout | None, seeds: int, best_seeds: int) -> dict[str, Times]:
    """Return the answers (scenes, seeds) by quantity; both checkouts answer each request in turn."""
    answers: dict[str, list[list[Any]]] = {}
    for number, name in enumerate(here.scenes[family]):
        row: dict[str, list[Any]] = {}
        for seed in range(1 + seeds):  # the first one warms up
            for side, asked in (
                (here, "first"),
                (there, "first"),
                (here, "without"),
                (here, "whole"),
                (there, "whole"),
            ):
                if side is None or (asked == "whole" and there is None):
                    continue
                value, *found_by = side.ask(family, number, seed, asked)
                row.setdefault(asked if side is here else f"{asked} before", []).append(value)
                if side is here and asked == "first":
                    row.setdefault("by OMPL", []).append(bool(found_by))
        row = {key: values[1:] for key, values in row.items()}
        for seed in range(1, 1 + best_seeds):
            for key, side in (("best", here), ("best before", there)):
                if side is not None:
                    row.setdefault(key, []).append(side.ask(family, number, seed, "best")[0])
        for key, values in row.items():
            answers.setdefault(key, []).append(values)
        print(f"{name} done", file=sys.stderr, flush=True)
    return {key: np.array(values) for key, values in answers.items()}


def report(family: str, names: list[str], found: dict[str, Times]) -> None:
    """Print a line for each scene, and a summary."""
    first, without, by = 1e3 * found["first"], 1e3 * found["without"], found["by OMPL"]
    before = 1e3 * found.get("first before", np.full(first.shape, np.nan))
    print(f"\n{family}: {len(names)} scenes, {first.shape[1]} seeds; ms of CPU to a first path")
    print(f"{'scene':24} {'median':>8} {'90 %':>8} {'by OMPL':>8} {'without':>8} {'before':>8} {'90 %':>8}")
    for k, name in enumerate(names):
        print(
            f"{name:24} {np.median(first[k]):8.2f} {tenth(first[k]):8.2f} {100 * by[k].mean():7.0f}% "
            f"{np.median(without[k]):8.2f} {np.median(before[k]):8.2f} {tenth(before[k]):8.2f}"
        )
    searched = by.any(axis=1) | (np.median(first, axis=1) > FREE)
    matter = np.median(without, axis=1)[searched] >= 1.5 * np.median(first, axis=1)[searched]
    print(f"solved {100 * np.isfinite(first).mean():.1f} %; pooled {np.median(first):.2f}, 90 % {tenth(first):.2f}")
    print(
        f"scenes with a search {searched.sum()}: {100 * by[searched].mean():.1f} % of first paths by OMPL; without "
        f"its trees lost or 1.5 times later in {matter.sum()}"
    )
    if "first before" not in found:
        return
    print(f"before: solved {100 * np.isfinite(before).mean():.1f} %; {np.median(before):.2f}, {tenth(before):.2f}")
    print(f"ratios: median {np.median(first) / np.median(before):.2f}, 90 % {tenth(first) / tenth(before):.2f}")
    within = np.median(first, axis=1) <= 1.5 * np.median(before, axis=1) + 2.0
    print(f"scene medians within 1.5 times + 2 ms: {within.sum()} of {len(names)}")
    whole, earlier = found["whole"], found["whole before"]
    print(f"whole first plans: {1e3 * np.median(whole):.1f} ms, {np.median(whole) / np.median(earlier):.3f} times")
    if "best" in found:
        best, old = found["best"], found["best before"]
        change = 100.0 * (best / old - 1.0)[np.isfinite(best) & np.isfinite(old)]
        half = 1.96 * change.std() / math.sqrt(change.size)
        print(
            f"duration of the plan after 1 s: {change.mean():+.3f} +- {half:.3f} % (95 %, {change.size} differences)"
        )


def tenth(values: Times) -> float:
    """Return the 90th percentile of some values."""
    return float(np.quantile(values, 0.9, method="higher"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", nargs="?", type=Path)
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--best-seeds", type=int, default=6)
    parser.add_argument("--scenes", type=int, default=22, help="number of dense scenes")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.serve:
        serve(arguments.serve, arguments.scenes)
        return 0
    here = Checkout(HERE, arguments.scenes)
    there = Checkout(arguments.other.resolve(), arguments.scenes) if arguments.other else None
    for family in arguments.families:
        found = ask_all(family, here, there, arguments.seeds, arguments.best_seeds)
        report(family, here.scenes[family], found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
