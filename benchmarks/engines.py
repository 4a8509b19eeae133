"""Comparison of two checkouts in turn, by CPU time.

    python benchmarks/engines.py OTHER_CHECKOUT [--families everyday dense series gaps] [--seeds 20]
        [--scenes 22] [--best-seeds 6]

Both checkouts search every scene of `ablation.py` with every seed, each in a process of its own with its own `.venv`:
until the first plan, and with `--best-seeds` of them for a second. Prints for each family first paths and who found
them, first plans, and the duration of the plan after a second (the default objective).
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

if "--serve" in sys.argv:
    sys.path[0] = str(Path.cwd() / "benchmarks")  # scenes of the checkout that answers

from ablation import FAMILIES, scenes

import pushplan
from pushplan.planners.search import planners
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

HERE = Path(__file__).resolve()
LIMIT = 10.0
"""CPU seconds of a search for a first path, at most."""
FREE = 0.7e-3
"""A search that takes no longer (s) found a free steering path."""
Answers = tuple[FloatArray, FloatArray]


def first_plan(scenario: Scenario, seed: int) -> list[Any]:
    """Return CPU times (s) to the first path and of the whole plan, and whether OMPL's trees found the path."""
    trees: Any = getattr(planners, "MeetingTrees", None)  # older versions have none
    by_ompl, grow = list[bool](), trees and trees.grow

    def watched(self: Any, extensions: int) -> None:
        grow(self, extensions)
        by_ompl.append(self._session.solved)

    with mock.patch.object(trees, "grow", watched) if trees else nullcontext():
        began = time.process_time()
        plan = pushplan.plan(scenario, seed=seed, first=True, time_limit=LIMIT)
        whole = time.process_time() - began
    first = plan.first_solution_s
    return [math.inf if first is None else first, whole, any(by_ompl)]


def serve(family: str, count: int) -> None:
    """Print the names of the scenes, and answer requests, one line of JSON each: scene, seed, and whether `first`."""
    time.perf_counter = time.process_time
    rooms = [*scenes(family, count)]
    print(json.dumps([room.name for room in rooms]), flush=True)
    for line in sys.stdin:
        number, seed, first = json.loads(line)
        if first:
            answer = first_plan(rooms[number], seed)
        else:
            duration = pushplan.plan(rooms[number], seed=seed, time_limit=1.0).duration
            answer = [math.inf if duration is None else duration]
        print(json.dumps(answer), flush=True)


class Checkout:
    """A process that answers for a checkout."""

    def __init__(self, folder: Path, family: str, count: int) -> None:
        words = [str(folder / ".venv/bin/python"), str(HERE), "--serve", family, str(count)]
        self._process = subprocess.Popen(words, cwd=folder, stdin=-1, stdout=-1, text=True)
        self.scenes: list[str] = self._read()

    def _read(self) -> Any:
        assert self._process.stdout is not None
        return json.loads(self._process.stdout.readline())

    def ask(self, *question: Any) -> Any:
        """Return the answer to a request."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(question) + "\n")
        self._process.stdin.flush()
        return self._read()


def ask_all(here: Checkout, there: Checkout, seeds: int, first: bool) -> Answers:
    """Return the answers (scenes, seeds, quantities) of both checkouts, which answer each request in turn."""
    found: list[list[list[list[float]]]] = [[], []]
    for number, name in enumerate(here.scenes):
        rows: list[list[list[float]]] = [[], []]
        for seed in range(1 + seeds):
            for row, side in zip(rows, (here, there), strict=True):
                row.append(side.ask(number, seed, first))
        for all_, row in zip(found, rows, strict=True):
            all_.append(row[1:])  # the first one warms up
        print(f"{name} done", file=sys.stderr, flush=True)
    return np.array(found[0]), np.array(found[1])


def report(family: str, firsts: Answers, bests: Answers) -> None:
    """Print the figures of a family, those of the other checkout in brackets."""
    from ablation import tenth  # the other checkout may have none

    (first, whole, by), (before, whole_before, _) = (np.moveaxis(one, 2, 0) for one in firsts)
    searched = by.any(axis=1) | (np.median(first, axis=1) > FREE)
    print(f"\n{family}: {len(first)} scenes, {first.shape[1]} seeds; CPU time, in brackets of the other checkout")
    for what, figure in (
        ("solved, %", lambda one: 100 * np.isfinite(one).mean()),
        ("first path, ms", lambda one: 1e3 * np.median(one)),
        ("90 %, ms", lambda one: 1e3 * tenth(one)),
    ):
        print(f"{what}: {figure(first):.2f} ({figure(before):.2f})")
    print(f"first paths found by OMPL: {100 * by[searched].mean():.1f} % in {searched.sum()} scenes with a search")
    print(f"CPU time of a first plan, ratio: {np.median(whole) / np.median(whole_before):.3f}")
    change = 100.0 * (bests[0] / bests[1] - 1.0)
    change = change[np.isfinite(change)]
    half = 1.96 * change.std() / math.sqrt(change.size)
    print(f"duration after 1 s: {change.mean():+.3f} +- {half:.3f} % (95 %, {change.size} differences)", flush=True)


def main() -> None:
    from script import options  # the other checkout may have none

    asked = options(__doc__, "other", families=FAMILIES, seeds=20, best_seeds=6, scenes=22)
    for family in asked.families:
        here, there = (Checkout(folder, family, asked.scenes) for folder in (HERE.parents[1], asked.other.resolve()))
        firsts = ask_all(here, there, asked.seeds, True)
        report(family, firsts, ask_all(here, there, asked.best_seeds, False))


if __name__ == "__main__":
    if "--serve" in sys.argv:
        serve(sys.argv[2], int(sys.argv[3]))
    else:
        main()
