"""Whole rooms: is a plan for many objects ever worse than a greedy loop?

    python benchmarks/rooms.py [--objects 10] [--rooms 18] [--seed 7000] [--limit 10] [--greedy-limit 40]
        [--backwards] [--door]

Rooms of three kinds (goals on a grid, on shelves along the walls, anywhere) and three drives, drawn by seed. With
`--backwards` an arc leads each object from its start to its goal, past all others as they stand then, in some order.
With `--door` a wall with a door of 0.9 m divides rooms with goals anywhere, and every fourth object has no goal.
The greedy loop plans each object by itself with the others as obstacles, delivers the nearest one that can be
delivered, and goes on until none can. It uses the public `pushplan.plan` only.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from script import options

import pushplan
from pushplan.geometry import se2
from pushplan.plans.plan import Plan
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.goals import Poses
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.util.arrays import FloatArray

DRIVES: tuple[tuple[str, Any], ...] = (
    ("omnidirectional", "omnidirectional"),
    ("differential", {"differential": {"axle": [-0.2, 0.0, 0.0]}}),
    ("car", {"car": {"axle": [-0.3, 0.0, 0.0], "min_radius": 0.6}}),
)
KINDS = ("grid", "shelves", "random")
BOX = [0.2, 0.2]


def room(number: int, count: int, seed: int, door: bool) -> dict[str, Any]:
    """Return a scenario file's document: all kinds with all drives, gaps between goals from 0.3 to 0.6 m."""
    kind, (drive, section) = "random" if door else KINDS[number % 3], DRIVES[(number // 3) % 3]
    pitch, side = BOX[0] + (0.3, 0.45, 0.6)[(number // 9) % 3], max(4.0, 1.6 * math.sqrt(count) + 2.0)
    random = np.random.default_rng([seed + number, count, KINDS.index(kind)])
    if kind == "grid":
        columns = math.ceil(math.sqrt(count / 2))
        origin = 0.5 * side - 0.5 * pitch * np.array([columns - 1, math.ceil(count / columns) - 1])
        goals = [[*(origin + pitch * np.array(divmod(k, columns)[::-1])).tolist(), 0.0] for k in range(count)]
    elif kind == "shelves":
        goals = [_on_shelf(*divmod(k, max(1, int((side - 1.2) / pitch))), pitch, side) for k in range(count)]
    else:
        places = _apart(random, count, side, pitch, [], door)
        goals = [[*place, 0.5 * math.pi * random.integers(4)] for place in places]
    starts = _apart(random, count, side, BOX[0] + 0.4, [goal[:2] for goal in goals], door)
    poses = [[*place, random.uniform(-math.pi, math.pi)] for place in starts]
    return {
        "format": "pushplan/1",
        "name": f"{'door' if door else kind}-{drive}-{count}-{seed + number}",
        "floor": {"friction": 0.3},
        "objects": [{"name": f"box{k}", "shape": {"box": BOX}, "mass": 2.0, "pose": p} for k, p in enumerate(poses)],
        "pusher": {"width": 0.24, "friction": 0.5},
        "robot": {
            "footprint": {"box": [0.35, 0.24], "pose": [-0.175, 0.0, 0.0]},
            "drive": section,
            "start": [0.6, 0.6, 0.7],
        },
        "goals": {f"box{k}": {"pose": goal, "symmetry": 4} for k, goal in enumerate(goals) if not door or k % 4},
        "workspace": {"x": [0.0, side], "y": [0.0, side]},
        "obstacles": _wall(0.5 * side, random.uniform(1.0, side - 1.0), side) if door else [],
    }


def _wall(x: float, y: float, side: float) -> list[dict[str, Any]]:
    """Return a wall across the room at x with a door at y."""
    parts = ((0.0, y - 0.45), (y + 0.45, side))
    return [{"polygon": [[x - 0.05, a], [x + 0.05, a], [x + 0.05, b], [x - 0.05, b]]} for a, b in parts]


def _on_shelf(shelf: int, at: int, pitch: float, side: float) -> list[float]:
    """Return a goal on a shelf at the lower, the upper or the left wall, and then in front of them."""
    wall, row = shelf % 3, shelf // 3
    deep, along = (side - 0.45 - 0.5 * row if wall == 1 else 0.45 + 0.5 * row), 0.8 + pitch * at
    return [deep, along, 0.0] if wall == 2 else [along, deep, 0.0]


def led_backwards(document: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return a room whose objects, taken off their goals one after another, stand where one push brings them back.

    Each stands at the beginning of an arc that is free of all other objects as they stand at that moment, together
    with the robot behind the object and 0.7 m behind the robot at the beginning, from where it comes. How it gets
    there is not looked at.
    """
    draws = (_starts(document, np.random.default_rng([seed, attempt])) for attempt in itertools.count())
    poses = next(found for found in draws if found)
    objects = [entry | {"pose": poses[entry["name"]].tolist()} for entry in document["objects"]]
    return document | {"name": f"{document['name']}-backwards", "objects": objects}


def _starts(document: dict[str, Any], random: np.random.Generator) -> dict[str, FloatArray]:
    """Return the start (3,) of each object; empty if 200 tries for each were not enough."""
    floor = shapely.box(*(document["workspace"][axis][end] for end in (0, 1) for axis in "xy")).buffer(-0.02)
    robot = shapely.Point(document["robot"]["start"][:2]).buffer(0.4)
    box = np.array(shapely.box(-0.12, -0.12, 0.12, 0.12).exterior.coords)
    pushed, behind = (np.array(shapely.box(x, -0.14, 0.1, 0.14).exterior.coords) for x in (-0.5, -1.2))
    poses = {name: np.array(goal["pose"]) for name, goal in document["goals"].items()}
    left = list(poses)
    for _ in range(200 * len(left)):
        name = left[random.integers(len(left))]
        turn, length = random.choice([0.0, random.uniform(-0.8, 0.8)]), random.uniform(0.4, 3.0)
        face = np.array([0.0, 0.0, 0.5 * math.pi * random.integers(4)])
        back = np.linspace(0.0, -length, 2 + int(length / 0.1))
        along = se2.compose(se2.compose(poses[name], face), se2.exp(np.outer(back, [1.0, 0.0, turn])))
        swept = shapely.union_all([*_placed(pushed, along), *_placed(behind, along[-1:])])
        others = _placed(box, np.array([poses[other] for other in poses if other != name]))
        met = shapely.intersects(swept, others).any() or _placed(box, along[-1:])[0].intersects(robot)
        if floor.contains(swept) and not met:
            poses[name] = se2.compose(along[-1], -face)
            left.remove(name)
            if not left:
                return poses
    return {}


def _placed(corners: FloatArray, poses: FloatArray) -> Any:
    """Return a polygon with corners (k, 2) at each of poses (n, 3)."""
    return shapely.polygons([se2.transform_points(pose, corners) for pose in poses])


def _apart(
    random: np.random.Generator, count: int, side: float, least: float, others: Sequence[Any], door: bool
) -> list[list[float]]:
    """Return places with a smallest distance from one another, from other places, the robot's start and a wall."""
    found: list[list[float]] = []
    while len(found) < count:
        place = random.uniform(0.5, side - 0.5, 2).tolist()
        near = any(math.dist(place, other) < least for other in (*found, *others, [0.25, 0.25], [0.6, 0.6]))
        if not (near or (door and abs(place[0] - 0.5 * side) < 0.5)):
            found.append(place)
    return found


def greedy(scenario: Scenario, limit: float) -> tuple[int, float]:
    """Return the number of objects that a greedy loop delivers within a CPU time (s), and the CPU time, s."""
    began, plate = time.process_time(), scenario.transport.robot_start
    starts = {load.name: load.start for load in scenario.loads}
    left, found = list(scenario.goals), True
    while left and found:
        found = False
        for name in sorted(left, key=lambda name: float(np.hypot(*(starts[name] - plate)[:2]))):
            if time.process_time() - began > limit:
                break
            plan = _deliver(scenario, name, starts, plate)
            if plan is not None and plan.solved:
                last = plan.segments[-1]
                starts[name] = scenario.task.by_name[name].start_for(last.after[name])
                plate, found = last.path.end, True
                left.remove(name)
                break
    return len(scenario.goals) - len(left), time.process_time() - began


def _deliver(scenario: Scenario, name: str, starts: dict[str, Any], plate: Any) -> Plan | None:
    own = scenario.alone(name)
    others = tuple(
        PolygonObstacle(se2.transform_points(starts[load.name], obj.outline_chain))
        for load in scenario.loads
        for obj in load.chain.objects
        if load.name != name
    )
    load = replace(own.load, start=starts[name])
    posed = own.with_task(loads=(load,), goals=(Poses(name, own.goals[name]),), robot_start=plate)
    posed = replace(posed, obstacles=(*own.obstacles, *others))
    try:
        return pushplan.plan(posed, first=True, time_limit=1.0, iterations=8)
    except pushplan.PlanningError:
        return None


def main() -> None:
    asked = options(
        __doc__, objects=10, rooms=18, seed=7000, limit=10.0, greedy_limit=40.0, backwards=False, door=False
    )
    solved = by_greedy = lost = fewer = 0
    firsts = []
    for number in range(asked.rooms):
        document = room(number, asked.objects, asked.seed, asked.door)
        document = led_backwards(document, asked.seed + number) if asked.backwards else document
        scenario = scenario_from_document(document)
        done, spent = greedy(scenario, asked.greedy_limit)
        began = time.process_time()
        plan = pushplan.plan(scenario, seed=1, first=True, time_limit=asked.limit)
        own = time.process_time() - began
        brought = len(scenario.goals) - len(getattr(plan, "undelivered", ()) if plan.segments else scenario.goals)
        whole = done == len(scenario.goals)
        solved, by_greedy = solved + plan.solved, by_greedy + whole
        lost, fewer = lost + (whole and not plan.solved), fewer + (brought < done)
        firsts += [own] if plan.solved else []
        print(f"{scenario.name:32} greedy {done:3} in {spent:6.2f} s   plan {brought:3} in {own:6.2f} s", flush=True)
    print(f"solved {solved}, by greedy {by_greedy}, only by greedy {lost}, fewer delivered than greedy {fewer}")
    print(f"first plan, CPU: median {np.median(firsts):.2f} s, largest {max(firsts):.2f} s")


if __name__ == "__main__":
    main()
