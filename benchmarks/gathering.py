"""Rows of objects: pushed together against one by one, in rooms of one robot and several kinds of objects.

    python benchmarks/gathering.py [--rooms 20] [--seed 1] [--families omni-4-3 car-6-3 ...] [--seconds 2]
        [--slip 0] [--physics 0] [--closed 0] [--checks 0]

Each family has a drive, the side of a room (m) and a number of cubes. In each room a row at a wall is asked for.
Three planners are compared by the way of the plate in all: `gather: auto`, `gather: never`, and the search for an
order of objects with own goals (places 5 mm apart, each assigned so that the objects' straight ways are shortest in
sum; any of four orientations). Every plan is checked by `row_checks`, and so are `--checks` first plans. Plans are
executed in worlds whose objects stand 3 mm and 2 deg off and whose frictions are 20 % off: with `--slip` in the slip
simulator, with `--physics` in MuJoCo, with `--closed` in closed loop (30 measurements a second, noise of 1 mm and
0.3 deg, 0.1 s late).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from row_checks import apart, box, put, violations
from scipy.optimize import linear_sum_assignment
from scipy.stats import bootstrap

from pushplan.closed_loop import run_closed_loop
from pushplan.errors import PlanningError
from pushplan.planner import plan
from pushplan.plans.plan import Plan
from pushplan.scenario.file import scenario_from_document
from pushplan.sim.control.rest import travel_of
from pushplan.sim.physics.simulate import simulate_in_physics
from pushplan.sim.slip import slip
from pushplan.slip.world import World

Document = dict[str, Any]

ROBOT = {"box": [0.42, 0.285], "pose": [-0.24, 0.0, 0.0]}
CAR = {"car": {"axle": [-0.30, 0.0, 0.0], "min_radius": 1.0}}
SIDE = 0.15
"""Of a cube, m."""

ROOMS = 2982917237528477029
"""With this number rooms are those of the tables."""

BETWEEN = 5e-3
"""What the search for an order leaves between two places, m."""

FAR = 0.35
"""Objects, the row and the robot are so far apart at first, m."""

BEHIND = 0.6
"""Objects are so far from the walls, m: the robot has room behind each of their faces."""

POSITION, ANGLE = 3e-3, np.radians(2.0)
"""How far objects stand off where the plan has them, m and rad."""

WITHIN = (12e-3, np.radians(1.0))
"""How far from its place an object of the row may end, m and rad."""


@dataclass(frozen=True)
class Family:
    """Rooms of one kind: `omni-4-3` is 4 x 4 m with three cubes and a robot that moves to all sides."""

    drive: str
    side: float
    count: int

    @classmethod
    def named(cls, name: str) -> Family:
        """Return the family of a name."""
        drive, side, count = name.split("-")
        return cls(drive, float(side), int(count))

    def room(self, seed: int) -> Document:
        """Return the document of a room with a row at a wall."""
        random = np.random.default_rng([seed, ROOMS])
        while (found := self._drawn(random)) is None:
            pass
        return found

    def _drawn(self, random: np.random.Generator) -> Document | None:
        side, length = self.side, SIDE * self.count
        rear = [side - length - 0.02, float(random.uniform(0.6, side - 0.6)), 0.0]
        taken = [put(shapely.box(-0.6, -0.2, length, 0.2), rear)]
        poses = []
        for _ in range(self.count):
            pose = [*random.uniform(BEHIND, side - BEHIND, 2), random.uniform(-np.pi, np.pi)]
            shape = put(box(SIDE, SIDE), pose)
            if any(shape.distance(other) < FAR for other in taken):
                return None
            taken.append(shape)
            poses.append([float(value) for value in pose])
        start = [*random.uniform(0.5, side - 0.5, 2), random.uniform(-np.pi, np.pi)]
        if any(put(shapely.box(-0.5, -0.2, 0.1, 0.2), start).distance(other) < 0.05 for other in taken):
            return None
        return {
            "format": "pushplan/1",
            "name": "room",
            "floor": {"friction": 0.3},
            "objects": [
                {"name": f"o{i}", "shape": {"box": [SIDE, SIDE]}, "mass": 0.5, "pose": pose}
                for i, pose in enumerate(poses)
            ],
            "goals": {"row": {"of": [f"o{i}" for i in range(self.count)], "pose": rear}},
            "contacts": {"friction": 0.5},
            "pusher": {"width": 0.285, "friction": 0.5},
            "robot": {
                "footprint": ROBOT,
                "start": [float(value) for value in start],
                **({"drive": CAR} if self.drive == "car" else {}),
            },
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


def planned(document: Document, seconds: float, first: bool = False) -> tuple[Plan | None, float]:
    """Return a plan, None without one, and its CPU seconds."""
    began = time.process_time()
    try:
        found = plan(scenario_from_document(document), seed=1, time_limit=seconds, first=first)
    except PlanningError:
        return None, time.process_time() - began
    return (found if found.solved else None), time.process_time() - began


def compared(document: Document, seconds: float) -> Document:
    """Return the results of three planners in a room."""
    result: Document = {}
    for gather in ("auto", "never"):
        found, _ = planned({**document, "gather": gather}, seconds)
        result[gather] = None
        if found is not None:
            result[gather] = travel_of(found.segments)
            told = json.loads(json.dumps(found.to_dict(), default=float))
            result[f"{gather}_wrong"] = list(violations(document, told))
            result[f"{gather}_first"] = found.first_solution_s
    ordered, _ = planned(in_order(document), max(seconds, 5.0))
    result["order"] = None if ordered is None else travel_of(ordered.segments)
    return result


def checked(count: int, families: Sequence[str], seed: int, seconds: float) -> int:
    """Check first plans of rows of all families, of `auto` and `never` in turn; return the number of wrong ones."""
    plans, wrong = 0, 0
    for k in range(2 * count):
        name, gather = families[k % len(families)], ("auto", "never")[(k // len(families)) % 2]
        document = {**Family.named(name).room(1000 * seed + k), "gather": gather}
        found, _ = planned(document, seconds, first=True)
        if found is not None:
            plans += 1
            told = list(violations(document, json.loads(json.dumps(found.to_dict(), default=float))))
            wrong += bool(told)
            for text in told:
                print(f"{name}, room {1000 * seed + k}, {gather}: {text}")
        if plans == count:
            break
    print(f"checked: {plans} first plans, {wrong} of them wrong")
    return wrong


def off(world: World, random: np.random.Generator) -> World:
    """Return a world with pose errors and other frictions."""
    poses = np.array(world.object_poses)
    poses += random.uniform(-1.0, 1.0, poses.shape) * [POSITION, POSITION, ANGLE]
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
    errors = [apart(tuple(a), tuple(b)) for a, b in zip(report.objects[-1], report.wanted, strict=True)]
    position, angle = (float(value) for value in report.object_errors.max(axis=0))
    return position, angle, bool(report.jammed_at) or max(errors) > 0.5


def ratios(rows: Sequence[Mapping[str, Any]], over: str) -> str:
    """Return the median ratio with its interval, and the worst ratio."""
    pairs = [(row["auto"], row[over]) for row in rows if row.get("auto") and row.get(over)]
    if len(pairs) < 2:
        return "-"
    values = np.array([a / b for a, b in pairs])
    low, high = bootstrap((values,), np.median, method="percentile", random_state=1).confidence_interval
    return f"{np.median(values):.2f} ({low:.2f}-{high:.2f}), worst {values.max():.2f}"


FAMILIES = (*(f"omni-4-{n}" for n in (2, 3, 4)), "omni-6-5", "omni-6-6", "car-6-2", "car-6-3")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--families", nargs="+", default=FAMILIES)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--slip", type=int, default=0, help="plans that are executed with errors, in all")
    parser.add_argument("--physics", type=int, default=0, help="the same in MuJoCo")
    parser.add_argument("--closed", type=int, default=0, help="the same in closed loop")
    parser.add_argument("--checks", type=int, default=0, help="first plans that are checked, in all")
    given = parser.parse_args()
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    wrong = 0
    print(
        "| family | auto, never, order solved | auto / order | auto / never | first plan, s: median, most | wrong |"
    )
    print("|---|---|---|---|---|---|")
    for name in given.families if given.rooms else ():
        family, rows = Family.named(name), []
        for k in range(given.rooms):
            document = family.room(1000 * given.seed + k)
            rows.append(compared(document, given.seconds))
        counts = [sum(row.get(which) is not None for row in rows) for which in ("auto", "never", "order")]
        firsts = [row["auto_first"] for row in rows if "auto_first" in row]
        bad = sum(len(row.get(f"{g}_wrong", ())) > 0 for row in rows for g in ("auto", "never"))
        wrong += bad
        print(
            f"| {name} | {', '.join(map(str, counts))} of {len(rows)} | {ratios(rows, 'order')} | "
            f"{ratios(rows, 'never')} | {np.median(firsts):.2f}, {max(firsts):.2f} | {bad} |"
            if firsts
            else f"| {name} | {', '.join(map(str, counts))} of {len(rows)} | - | - | - | {bad} |",
            flush=True,
        )
    if given.checks:
        wrong += checked(given.checks, given.families, given.seed, 5.0)
    for how in ("slip", "physics", "closed"):
        count = getattr(given, how)
        wrong += _with_errors(given.families, count, given, how) if count else 0
    sys.exit(1 if wrong else 0)


def _with_errors(families: Sequence[str], count: int, given: argparse.Namespace, how: str) -> int:
    """Execute plans in worlds with errors; return the number of plans that lost an object."""
    ends, k = [], 0
    while len(ends) < count and k < 20 * count:
        family = Family.named(families[k % len(families)])
        found, _ = planned(family.room(5000 * given.seed + k), given.seconds, first=True)
        k += 1
        if found is not None:
            ends.append(executed(found, k, how))
            position, angle, wrong = ends[-1]
            told = f"{len(ends)}: {1e3 * position:.1f} mm, {np.degrees(angle):.2f} deg"
            print(told + (", lost" if wrong else ""), end="  \r", file=sys.stderr, flush=True)
    inside = sum(p <= WITHIN[0] and t <= WITHIN[1] and not lost for p, t, lost in ends)
    lost = sum(jammed for _, _, jammed in ends)
    worst = max(ends)
    print(
        f"\n{how}: errors of 3 mm / 2 deg, frictions +-20 %: {inside} of "
        f"{len(ends)} rows within 12 mm / 1 deg, {lost} lost; worst {1e3 * worst[0]:.1f} mm, median "
        f"{1e3 * float(np.median([p for p, _, _ in ends])):.1f} mm"
    )
    return lost


if __name__ == "__main__":
    main()
