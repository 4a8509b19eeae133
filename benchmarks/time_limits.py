"""By how much planning exceeds its time limit: in rooms of thousands of obstacles, and in noisy maps.

Run `python benchmarks/time_limits.py [--maps 200]`. Rooms have 1,000 and 3,000 obstacles, maps are polygons of up to
20,000 vertices; every other goal is behind a wall, so that proofs run instead of polishing. Told is what
`planning_s`, from the call on, is above the limit, at most, by the wall clock: run it on an idle machine.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from pushplan.bench.processes.machine import Machine

from pushplan.plan import plan
from pushplan.planners.collision.scene import convex_pieces
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.model import PolygonObstacle, Scenario
from pushplan.util.arrays import FloatArray

LIMITS = (0.1, 0.5, 1.0, 2.0)
SIDE = 6.0


def wall() -> FloatArray:
    """A wall across the room."""
    return np.array([[0.0, 5.0], [SIDE, 5.0], [SIDE, 5.1], [0.0, 5.1]])


def scenario_with(outlines: list[FloatArray], walled: bool) -> Scenario:
    room = build_scenario(
        "limits",
        [box("box", 0.1, 0.1, 1.0)],
        plate(0.12, 0.5),
        (5.5, 5.6, 0.0),
        floor_friction=0.3,
        start=(0.3, 0.3, 0.8),
        workspace={"x": [0.0, SIDE], "y": [0.0, SIDE]},
    )
    return replace(room, obstacles=tuple(map(PolygonObstacle, [*outlines, *([wall()] if walled else [])])))


def crowd(rng: np.random.Generator, count: int) -> list[FloatArray]:
    """Small boxes, none of them near the start."""
    square = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    places = rng.uniform([0.8, 0.8], [SIDE, 4.8], (count, 2))
    return [rng.uniform(0.01, 0.05) * square + place for place in places]


def noisy_map(rng: np.random.Generator, vertices: int) -> list[FloatArray]:
    """Blobs with ragged outlines, as mapped ones have, of so many vertices together."""
    outlines, side = [], 8
    for cell, count in enumerate(np.diff(np.linspace(0, vertices, side * side + 1).astype(int))):
        angles = 2.0 * np.pi * (np.arange(count) + 0.5 * rng.uniform(size=count)) / count
        radii = rng.uniform(0.1, 0.2) * (1.0 + 0.2 * rng.uniform(size=count))
        center = np.array([1.1 + 0.6 * (cell % side), 0.9 + 0.5 * (cell // side)])
        outlines.append(center + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    return outlines


def overrun(scenario: Scenario, limit: float) -> float:
    """Seconds beyond the limit; negative where planning ended before it."""
    result = plan(scenario, time_limit=limit)
    return result.planning_s - limit


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--maps", type=int, default=200)
    arguments = parser.parse_args()
    print(Machine.this().words)
    rng = np.random.default_rng(1)
    overrun(scenario_with(crowd(rng, 10) + noisy_map(rng, 1000), walled=True), 0.5)
    worst = 0.0
    for count in (1000, 3000):
        outlines = crowd(rng, count)
        found = [
            max(overrun(scenario_with(outlines, walled), limit) for walled in (True, False))
            for limit in LIMITS
        ]
        worst = max(worst, *found)
        told = ", ".join(f"{limit:g} s: {1e3 * more:+.0f}" for limit, more in zip(LIMITS, found, strict=True))
        print(f"{count} obstacles, ms beyond the limit of {told}", flush=True)
    beyond = []
    for number in range(arguments.maps):
        vertices = int(np.exp(rng.uniform(np.log(1000.0), np.log(20_000.0))))
        scenario = scenario_with(noisy_map(rng, vertices), walled=number % 8 < 4)
        beyond.append((overrun(scenario, LIMITS[number % len(LIMITS)]), vertices))
    if beyond:
        most, vertices = max(beyond)
        print(f"{len(beyond)} maps: at most {1e3 * most:+.0f} ms, with {vertices} vertices")
        worst = max(worst, most)
    outlines = noisy_map(rng, 22_000)
    began = time.process_time()
    pieces = len(list(convex_pieces(outlines)))
    print(f"22,000 vertices are {pieces} convex pieces after {time.process_time() - began:.2f} s of CPU time")
    print(f"largest overrun: {1e3 * worst:+.0f} ms")


if __name__ == "__main__":
    main()
