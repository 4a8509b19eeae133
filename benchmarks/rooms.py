"""Whole rooms: is a plan for many objects ever worse than a greedy loop? `python benchmarks/rooms.py`.

Rooms of three kinds (goals on a grid, on shelves along the walls, anywhere) and three drives, drawn by seed. The
greedy loop is the yardstick: it plans each object by itself with the others as obstacles, delivers the nearest one
that can be delivered, and goes on until none can. It uses the public `pushplan.plan` only.
"""

from __future__ import annotations

import argparse
import math
import resource
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

import pushplan
from pushplan.geometry import se2
from pushplan.plans.plan import Plan
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.goals import Poses
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle

DRIVES: dict[str, Any] = {
    "omnidirectional": "omnidirectional",
    "differential": {"differential": {"axle": [-0.2, 0.0, 0.0]}},
    "car": {"car": {"axle": [-0.3, 0.0, 0.0], "min_radius": 0.6}},
}
KINDS = ("grid", "shelves", "random")
BOX = (0.2, 0.2)


def room(kind: str, drive: str, count: int, seed: int, gap: float = 0.3) -> dict[str, Any]:
    """Return a scenario file's document.

    Args:
        kind: One of `KINDS`.
        drive: One of `DRIVES`.
        count: Objects.
        seed: Of the starts, and of goals that are anywhere.
        gap: Between neighbouring goals, m.
    """
    random = np.random.default_rng([seed, count, KINDS.index(kind)])
    side = max(4.0, 1.6 * math.sqrt(count) + 2.0)
    pitch = BOX[0] + gap
    middle = 0.5 * side
    if kind == "grid":
        columns = math.ceil(math.sqrt(count / 2))
        rows = math.ceil(count / columns)
        places = [(middle + pitch * (c - 0.5 * (columns - 1)), middle + pitch * (r - 0.5 * (rows - 1)))
                  for r in range(rows) for c in range(columns)][:count]  # fmt: skip
        goals = [[*place, 0.0] for place in places]
    elif kind == "shelves":
        per = max(1, int((side - 1.2) / pitch))
        lines = [(0.45, 0.5 * math.pi), (side - 0.45, 0.5 * math.pi), (0.45, 0.0)]
        goals = []
        for k in range(count):
            shelf, at = divmod(k, per)
            deep, along = lines[shelf % 3][0] + 0.5 * (shelf // 3) * (1 if shelf % 3 != 1 else -1), 0.8 + pitch * at
            goals.append([along, deep, 0.0] if shelf % 3 < 2 else [deep, along, 0.0])
    else:
        goals = [[*place, 0.5 * math.pi * random.integers(4)] for place in _apart(random, count, side, pitch, [])]
    starts = _apart(random, count, side, BOX[0] + 0.4, [goal[:2] for goal in goals])
    names = [f"box{k}" for k in range(count)]
    return {
        "format": "pushplan/1",
        "name": f"{kind}-{drive}-{count}-{seed}",
        "floor": {"friction": 0.3},
        "objects": [
            {
                "name": name,
                "shape": {"box": list(BOX)},
                "mass": 2.0,
                "pose": [*place, random.uniform(-math.pi, math.pi)],
            }
            for name, place in zip(names, starts, strict=True)
        ],
        "pusher": {"width": 0.24, "friction": 0.5},
        "robot": {
            "footprint": {"box": [0.35, 0.24], "pose": [-0.175, 0.0, 0.0]},
            "drive": DRIVES[drive],
            "start": [0.6, 0.6, 0.7],
        },
        "goals": {name: {"pose": goal, "symmetry": 4} for name, goal in zip(names, goals, strict=True)},
        "workspace": {"x": [0.0, side], "y": [0.0, side]},
    }


def _apart(
    random: np.random.Generator, count: int, side: float, least: float, others: list[list[float]]
) -> list[list[float]]:
    """Return places with a smallest distance from one another, from other places and from the robot's start."""
    found: list[list[float]] = []
    while len(found) < count:
        place = random.uniform(0.5, side - 0.5, 2).tolist()
        if all(math.dist(place, other) >= least for other in (*found, *others, [0.25, 0.25], [0.6, 0.6])):
            found.append(place)
    return found


def greedy(scenario: Scenario, limit: float, each: float = 1.0) -> tuple[list[str], float]:
    """Return the objects that a greedy loop delivers, and the CPU time that it takes, s.

    Args:
        scenario: With a goal for each object.
        limit: CPU time, s.
        each: Time limit of a plan for one object, s.
    """
    began, plate = time.process_time(), scenario.transport.robot_start
    starts = {load.name: load.start for load in scenario.loads}
    left, done = list(scenario.goals), list[str]()
    while left:
        left.sort(key=lambda name: float(np.hypot(*(starts[name] - plate)[:2])))
        for name in left:
            if time.process_time() - began > limit:
                return done, time.process_time() - began
            plan = _deliver(scenario, name, starts, plate, each)
            if plan is not None and plan.solved:
                last = plan.segments[-1]
                load = scenario.task.by_name[name]
                starts[name], plate = load.start_for(last.after[name]), last.path.end
                left.remove(name)
                done.append(name)
                break
        else:
            break
    return done, time.process_time() - began


def _deliver(scenario: Scenario, name: str, starts: dict[str, Any], plate: Any, limit: float) -> Plan | None:
    own = scenario.alone(name)
    others = tuple(
        PolygonObstacle(se2.transform_points(starts[load.name], obj.outline_chain))
        for load in scenario.loads
        for obj in load.chain.objects
        if load.name != name
    )
    load = replace(own.load, start=starts[name])
    posed = own.with_task(loads=(load,), goals=(Poses(name, own.goals[name]),), robot_start=plate)
    try:
        return pushplan.plan(
            replace(posed, obstacles=(*own.obstacles, *others)), first=True, time_limit=limit, iterations=8
        )
    except pushplan.PlanningError:
        return None


def rooms(count: int, number: int, seed: int) -> Iterator[dict[str, Any]]:
    """Yield documents of rooms: all kinds with all drives, gaps between goals from 0.3 to 0.6 m."""
    for k in range(number):
        kind, drive = KINDS[k % 3], list(DRIVES)[(k // 3) % 3]
        yield room(kind, drive, count, seed + k, (0.3, 0.45, 0.6)[(k // 9) % 3])


def main() -> None:
    """Print a line for each room, and the number of the greedy loop's rooms that were solved."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", type=int, default=10)
    parser.add_argument("--rooms", type=int, default=18)
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--limit", type=float, default=10.0, help="time limit of a plan, s")
    parser.add_argument("--greedy-limit", type=float, default=40.0, help="CPU time of the greedy loop, s")
    asked = parser.parse_args()
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    solved = by_greedy = lost = fewer = 0
    firsts = []
    for document in rooms(asked.objects, asked.rooms, asked.seed):
        scenario = scenario_from_document(document)
        done, spent = greedy(scenario, asked.greedy_limit)
        began = time.process_time()
        plan = pushplan.plan(scenario, seed=1, first=True, time_limit=asked.limit)
        own = time.process_time() - began
        brought = len(scenario.goals) - len(getattr(plan, "undelivered", ()) if plan.segments else scenario.goals)
        whole = len(done) == len(scenario.goals)
        solved, by_greedy = solved + plan.solved, by_greedy + whole
        lost, fewer = lost + (whole and not plan.solved), fewer + (brought < len(done))
        firsts += [own] if plan.solved else []
        print(
            f"{document['name']:32} greedy {len(done):3} in {spent:6.2f} s   plan {brought:3} in {own:6.2f} s",
            flush=True,
        )
    print(f"solved {solved}, by greedy {by_greedy}, only by greedy {lost}, fewer delivered than greedy {fewer}")
    if firsts:
        print(f"first plan, CPU: median {np.median(firsts):.2f} s, largest {max(firsts):.2f} s")
    print(f"memory at most {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB, greedy included")


if __name__ == "__main__":
    main()
