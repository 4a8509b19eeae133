"""Rows of objects: pushed together against one by one, in rooms of one robot and several kinds of objects.

    python benchmarks/gathering.py [--rooms 20] [--seed 1] [--families omni-4-3 car-6-3 ...] [--seconds 2]
        [--slip 0] [--physics 0] [--closed 0] [--checks 0]

Each family has a drive, the side of a room (m) and a number of cubes. In each room a row at a wall is asked for.
Compares the travel of the plate for three planners: `gather: auto`, `gather: never`, and the search for an order of
objects with own goals (places 5 mm apart, assigned so that the sum of straight paths is least; any of four
orientations). `row_checks` checks every plan, and `--checks` first plans. The other options execute plans in worlds
with pose errors of 3 mm and 2 deg and frictions off by 20 %: `--slip` in the slip simulator, `--physics` in MuJoCo,
`--closed` in closed loop (30 measurements a second, noise of 1 mm and 0.3 deg, 0.1 s late).
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from copy import deepcopy
from typing import Any

import numpy as np
import shapely
from row_checks import apart, box, pose_of, put, violations
from scipy.optimize import linear_sum_assignment
from scipy.stats import bootstrap
from script import options

from pushplan.closed_loop import run_closed_loop
from pushplan.errors import PlanningError
from pushplan.planner import plan
from pushplan.plans.plan import Plan
from pushplan.scenario.file import scenario_from_document
from pushplan.sim.control.rest import travel_of
from pushplan.sim.physics.simulate import simulate_in_physics
from pushplan.sim.slip import slip
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

Document = dict[str, Any]

ROBOT = {"box": [0.42, 0.285], "pose": [-0.24, 0.0, 0.0]}
CAR = {"car": {"axle": [-0.30, 0.0, 0.0], "min_radius": 1.0}}
ROOMS = 2982917237528477029
"""With this number rooms are those of the tables."""
SIDE, BETWEEN = 0.15, 5e-3
"""Side of a cube, and gap between two goals in the search for an order, m."""
FAR, BEHIND = 0.35, 0.6
"""Distances of objects, row and robot from one another, and from the walls, m: with room behind each face."""
OFF, WITHIN = np.array([3e-3, 3e-3, np.radians(2.0)]), (12e-3, np.radians(1.0))
"""Largest pose errors of the objects, and largest errors in the row at the end, m and rad."""
FAMILIES = (*(f"omni-4-{n}" for n in (2, 3, 4)), "omni-6-5", "omni-6-6", "car-6-2", "car-6-3")


def room(family: str, seed: int) -> Document:
    """Return the document of a room with a row at a wall; `omni-4-3` has 4 x 4 m and three cubes."""
    random = np.random.default_rng([seed, ROOMS])
    drive, side, count = family.split("-")
    while (found := _drawn(random, drive == "car", float(side), int(count))) is None:
        pass
    return found


def _drawn(random: np.random.Generator, car: bool, side: float, count: int) -> Document | None:
    """Return a room of a side (m) if all has place."""
    length = SIDE * count
    rear = [side - length - 0.02, float(random.uniform(0.6, side - 0.6)), 0.0]
    taken, objects = [put(shapely.box(-0.6, -0.2, length, 0.2), pose_of(rear))], list[Document]()
    for i in range(count):
        pose = [*random.uniform(BEHIND, side - BEHIND, 2).tolist(), random.uniform(-np.pi, np.pi)]
        shape = put(box(SIDE, SIDE), pose_of(pose))
        if any(shape.distance(other) < FAR for other in taken):
            return None
        taken.append(shape)
        objects.append({"name": f"o{i}", "shape": {"box": [SIDE, SIDE]}, "mass": 0.5, "pose": pose})
    start = [*random.uniform(0.5, side - 0.5, 2).tolist(), random.uniform(-np.pi, np.pi)]
    if any(put(shapely.box(-0.5, -0.2, 0.1, 0.2), pose_of(start)).distance(other) < 0.05 for other in taken):
        return None
    return {
        "format": "pushplan/1",
        "name": "room",
        "floor": {"friction": 0.3},
        "objects": objects,
        "goals": {"row": {"of": [one["name"] for one in objects], "pose": rear}},
        "contacts": {"friction": 0.5},
        "pusher": {"width": 0.285, "friction": 0.5},
        "robot": {"footprint": ROBOT, "start": start, **({"drive": CAR} if car else {})},
        "workspace": {"x": [0.0, side], "y": [0.0, side]},
        "clearance": 0.004,
    }


def in_order(document: Document) -> Document:
    """Return the same with a goal for each object: the places of the row, 5 mm apart, assigned by straight ways."""
    found = deepcopy(document)
    row, found["pushes"] = found.pop("goals")["row"], {"transit_weight": 1.0}
    x, y, _ = row["pose"]
    at = {obj["name"]: obj["pose"][:2] for obj in found["objects"]}
    # The last place ends where the row does.
    first = x + 0.5 * SIDE - BETWEEN * (len(row["of"]) - 1)
    places = [[first + k * (SIDE + BETWEEN), y, 0.0] for k in range(len(row["of"]))]
    away = [[np.hypot(*np.subtract(at[name], place[:2])) for place in places] for name in row["of"]]
    _, chosen = linear_sum_assignment(away)
    found["goals"] = {name: {"pose": places[k], "symmetry": 4} for name, k in zip(row["of"], chosen, strict=True)}
    return found


def planned(document: Document, seconds: float, first: bool = False) -> Plan | None:
    """Return a plan; None without one."""
    try:
        found = plan(scenario_from_document(document), seed=1, time_limit=seconds, first=first)
    except PlanningError:
        return None
    return found if found.solved else None


def wrong_in(document: Document, found: Plan) -> list[str]:
    """Return what the independent check finds."""
    return list(violations(document, json.loads(json.dumps(found.to_dict(), default=float))))


def compared(family: str, asked: Namespace) -> int:
    """Print a line of the table with the results of three planners; return the number of wrong plans."""
    travel: dict[str, list[float]] = {"auto": [], "never": [], "order": []}
    firsts, wrong = list[float](), 0
    for k in range(asked.rooms):
        document = room(family, 1000 * asked.seed + k)
        for which, travels in travel.items():
            stated = in_order(document) if which == "order" else {**document, "gather": which}
            found = planned(stated, max(asked.seconds, 5.0) if which == "order" else asked.seconds)
            travels.append(np.nan if found is None else travel_of(found.segments))
            if found is not None and which != "order":
                wrong += bool(wrong_in(stated, found))
                firsts += [found.first_solution_s or 0.0] * (which == "auto")
    counts = ", ".join(str(np.isfinite(one).sum()) for one in travel.values())
    over = " | ".join(ratios(np.divide(travel["auto"], travel[other])) for other in ("order", "never"))
    times = f"{np.median(firsts):.2f}, {max(firsts):.2f}" if firsts else "-"
    print(f"| {family} | {counts} of {asked.rooms} | {over} | {times} | {wrong} |", flush=True)
    return wrong


def checked(asked: Namespace) -> int:
    """Check first plans of rows of all families, of `auto` and `never` in turn; return the number of wrong ones."""
    plans, wrong = 0, 0
    for k in range(2 * asked.checks):
        family, way = asked.families[k % len(asked.families)], ("auto", "never")[(k // len(asked.families)) % 2]
        document = {**room(family, 1000 * asked.seed + k), "gather": way}
        found = planned(document, 5.0, first=True)
        if found is not None:
            plans += 1
            told = wrong_in(document, found)
            wrong += bool(told)
            for text in told:
                print(f"{family}, room {1000 * asked.seed + k}, {way}: {text}")
        if plans == asked.checks:
            break
    print(f"checked: {plans} first plans, {wrong} of them wrong")
    return wrong


def off(world: World, random: np.random.Generator) -> World:
    """Return a world with pose errors and other frictions."""
    poses = np.array(world.object_poses)
    poses += random.uniform(-1.0, 1.0, poses.shape) * OFF
    world = world.with_object_poses(poses)
    return world.with_contact_friction(random.uniform(0.8, 1.2)).with_floor_friction(random.uniform(0.8, 1.2))


def executed(found: Plan, seed: int, how: str) -> tuple[float, float, bool]:
    """Return the largest final errors of objects in the row, m and rad, and whether one was lost or it jammed."""
    world = off(World.from_scenario(found.scenario), np.random.default_rng(seed))
    if how == "closed":
        run = run_closed_loop(found.scenario, world, plan=found, seed=seed)
        position, angle = run.goal_errors
        return position, angle, run.outcome != "arrived"
    report = simulate_in_physics(found, world) if how == "physics" else slip(found, world)
    errors = [apart(pose_of(a), pose_of(b)) for a, b in zip(report.objects[-1], report.wanted, strict=True)]
    position, angle = (float(value) for value in report.object_errors.max(axis=0))
    return position, angle, bool(report.jammed_at) or max(errors) > 0.5


def ratios(values: FloatArray) -> str:
    """Return the median ratio with its interval, and the worst ratio; NaN without a plan."""
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return "-"
    low, high = bootstrap((values,), np.median, method="percentile", random_state=1).confidence_interval
    return f"{np.median(values):.2f} ({low:.2f}-{high:.2f}), worst {values.max():.2f}"


def with_errors(asked: Namespace, how: str, count: int) -> int:
    """Execute plans in worlds with errors; return the number of plans that lost an object."""
    ends = list[tuple[float, float, bool]]()
    for k in range(20 * count):
        family = asked.families[k % len(asked.families)]
        found = planned(room(family, 5000 * asked.seed + k), asked.seconds, first=True)
        if found is not None:
            ends.append(executed(found, k + 1, how))
        if len(ends) == count:
            break
    positions, _, lost = np.array(ends).T
    inside = sum(position <= WITHIN[0] and angle <= WITHIN[1] and not gone for position, angle, gone in ends)
    print(
        f"{how}: errors of 3 mm / 2 deg, frictions +-20 %: {inside} of {len(ends)} rows within 12 mm / 1 deg, "
        f"{lost.sum():.0f} lost; worst {1e3 * positions.max():.1f} mm, median {1e3 * np.median(positions):.1f} mm"
    )
    return int(lost.sum())


def main() -> int:
    counts = {"slip": 0, "physics": 0, "closed": 0}
    asked = options(__doc__, rooms=20, seed=1, families=FAMILIES, seconds=2.0, checks=0, **counts)
    wrong = 0
    if asked.rooms:
        print(
            "| family | auto, never, order solved | auto / order | auto / never | first plan, s: median, most | bad |"
        )
        print("|---|---|---|---|---|---|")
        wrong += sum(compared(family, asked) for family in asked.families)
    if asked.checks:
        wrong += checked(asked)
    for how in counts:
        if count := getattr(asked, how):
            wrong += with_errors(asked, how, count)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
