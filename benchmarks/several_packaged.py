"""The packaged scenarios with the goal behind the start and the robot a metre away: are all of them solved in 2 s?

    python benchmarks/several_packaged.py [--seconds 2] [--only NAME]

Each keeps its objects, frictions, obstacles and workspace. Its goal is moved to the first free place behind the
start, its robot to the first free place a metre from it. Printed: whether there is a plan within the limit (wall
clock), the CPU time of the whole call, the time to the first plan, pushes, and the reason where there is none.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import yaml

from pushplan.errors import PushplanError, ScenarioError
from pushplan.geometry import se2
from pushplan.plan import plan
from pushplan.scenario.file import example_names, example_text, load_scenario, scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.several.warm import warm_up_several

BEHIND = (0.5, 0.8, 1.2, 0.3, 0.2, 0.1)
AWAY = 1.0


def main() -> None:
    """Print a line for each scenario."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    names = [name for name in example_names() if args.only in name]
    for intervals in {load_scenario(name).interval is not None for name in names}:
        warm_up_several(print, "ecof", intervals)
    solved = 0
    for name in names:
        try:
            scenario = behind(name)
            began = time.process_time()
            found = plan(scenario, time_limit=args.seconds)
        except PushplanError as error:
            print(f"{name}: cannot be asked: {error}", flush=True)
            continue
        spent = time.process_time() - began
        solved += found.solved
        pushes = sum(segment.pushes for segment in found.segments)
        told = (
            f"{pushes} pushes, first after {found.first_solution_s:.2f} s" if found.solved else found.reason
        )
        print(f"{name}: {told}; {spent:.1f} s of CPU time", flush=True)
    print(f"{solved} of {len(names)} solved (wanted: all)")


def behind(name: str) -> Scenario:
    """Return a packaged scenario as one of several pushes.

    Raises:
        ScenarioError: When no place is free; what was wrong with the last one.
    """
    stated, start = yaml.safe_load(example_text(name)), load_scenario(name).start
    for key in ("goal", "planner", "trajectory"):
        stated.pop(key, None)
    error: ScenarioError | None = None
    for place in _places(start, stated.get("robot", {})):
        try:
            return scenario_from_document({**stated, **place}, path=f"{name}.yaml")
        except ScenarioError as found:
            error = found
    assert error is not None
    raise error


def _places(start: Any, robot: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield goals behind a start (3,), and places of the robot around it."""
    for away in BEHIND:
        goal = se2.compose(start, [-away, 0.0, 0.0])
        for k in range(12):
            way = start[2] + math.pi + k * math.pi / 6.0
            for heading in (start[2], start[2] + 0.5 * math.pi, start[2] - 0.5 * math.pi, start[2] + math.pi):
                plate = [start[0] + AWAY * math.cos(way), start[1] + AWAY * math.sin(way), float(heading)]
                yield {"goal": {"pose": np.array(goal).tolist()}, "robot": {**robot, "start": plate}}


if __name__ == "__main__":
    main()
