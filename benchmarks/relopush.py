"""Problems of ReloPush (fluentrobotics/ReloPush, BSD-3-Clause): each block alone, and whole instances.

    python benchmarks/relopush.py FOLDER [--instances 100] [--seconds 10]
        [--files 2o1r 3o_2 4o 5o 6o2 8o boss12 boss13] [--scenarios DIR]

FOLDER is its `testdata`: data_2o1r.txt and so on, an instance a line with poses of blocks and goals, which block goes
where, and the pose of the axle. The blocks are cubes of 0.15 m that may end in any of four orientations. The car
has a footprint of 0.42 x 0.285 m, its rear axle 0.30 m behind its front plate, and a least turning radius of 1.008 m.
Masses and frictions are not stated there; those here are common ones. The walls are 0.5 m outside of the room of
4.0 x 5.4 m: the planner of ReloPush lets its robot leave the room.

boss12 and boss13 are made of boss12_nominal.json, the layout of ReloPush-BOSS's twelve blocks: its instances have
blocks, goals and robot up to 0.05 m and 0.1 rad off, and so have these, drawn with the number of the instance as
seed; boss13 has one block more, with its goal, wherever there is room. Only whole instances of them are planned.

With `--scenarios` nothing is measured: each block whose goal is free becomes a scenario file in DIR, for suites.

Printed for each block alone, the others in the way: how many with a free goal get a plan, and the CPU time to the
first one (the load prepared, the room built anew). For whole instances: how many get a plan within `--seconds`, the
CPU time to it, how often a block is put out of the way, and the way of the plate. All limits are of CPU time.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from pushplan.bench.random_problems import scenario_yaml
from pushplan.errors import PlanningError, ScenarioError
from pushplan.geometry import se2
from pushplan.planner import Planner
from pushplan.planners.multi.multi_push import MultiPushSearch, free_goals
from pushplan.planners.multi.room import Query
from pushplan.planners.multi.search import Limits, search
from pushplan.plans.settings import PlanSettings
from pushplan.scenario.file import scenario_from_document
from pushplan.scenario.goals import Goal, Poses
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import PolygonObstacle
from pushplan.sim.control.rest import travel_of
from pushplan.util.arrays import FloatArray

SIDE, AXLE, RADIUS = 0.15, 0.30, 1.008
"""Side of a block, how far the axle is behind the plate, and the least turning radius, m."""

ROOM = (4.0, 5.4)
LOWER = 5.2
"""Size of the room, m; the corner at its lower left is the origin. That of the layouts is so high."""

WALLS = 0.5
"""How far outside of the room the walls are, m."""

FIRST_LIMIT = 4.0
FILES = ("2o1r", "3o_2", "4o", "5o", "6o2", "8o")
LAYOUTS = {"boss12": 0, "boss13": 1}
"""What is made of a nominal layout, and how many blocks more than there it has."""

NOISE = np.array([0.05, 0.05, 0.1])
"""How far poses are off the layout's at most: m, m, rad."""

APART = 0.45
"""Distance of a further block, and of its goal, from all others, m."""

SQUARE = 0.5 * SIDE * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class Instance:
    """Blocks, their goals, and the initial pose of the car's axle: poses (3,) in the room, m and rad."""

    blocks: dict[str, FloatArray]
    goals: dict[str, FloatArray]
    assignment: dict[str, str]
    robot: FloatArray

    @property
    def plate(self) -> FloatArray:
        """Initial pose of the car's plate, (3,)."""
        return se2.compose(self.robot, [AXLE, 0.0, 0.0])

    def target(self, block: str) -> FloatArray:
        """Return the goal (3,) of a block."""
        return self.goals[self.assignment[block]]

    def others(self, block: str) -> list[FloatArray]:
        """Return the poses (3,) of the other blocks."""
        return [pose for name, pose in self.blocks.items() if name != block]


def read_instances(path: Path) -> tuple[Instance, ...]:
    """Return the instances of a file: a line each, `mo:NAME,X,Y,THETA,SIDES;...!robot:...!goal:...!assign:...`."""

    def poses(stated: str) -> dict[str, FloatArray]:
        rows = [one.split(",") for one in stated.split(";")]
        return {name: np.array(pose[:3], dtype=float) for name, *pose in rows}

    def instance(line: str) -> Instance:
        parts = dict(part.split(":") for part in line.split("!"))
        assignment = dict(pair.split(",") for pair in parts["assign"].split(";"))
        robot = np.array(parts["robot"].split(","), dtype=float)
        return Instance(poses(parts["mo"]), poses(parts["goal"]), assignment, robot)

    return tuple(instance(line) for line in path.read_text("utf-8").splitlines() if line)


def drawn_instances(path: Path, count: int, more: int) -> tuple[Instance, ...]:
    """Return instances of a nominal layout with pose errors, and some further blocks."""
    stated = json.loads(path.read_text("utf-8"))

    def off(random: np.random.Generator, pose: list[float]) -> FloatArray:
        return np.asarray(pose, dtype=float) + random.uniform(-1.0, 1.0, 3) * NOISE

    def instance(seed: int) -> Instance:
        random = np.random.default_rng(seed)
        blocks, goals = ({n: off(random, p) for n, p in stated[what].items()} for what in ("blocks", "goals"))
        robot, assignment = off(random, stated["robot"]), dict(stated["assignment"])
        for k in range(more):
            for name, poses in ((f"more-{k}", blocks), (f"goal-{k}", goals)):
                pose = random.uniform([0.4, 0.4, -np.pi], [ROOM[0] - 0.4, LOWER - 0.4, np.pi])
                taken = np.array([*blocks.values(), *goals.values(), robot])
                while np.hypot(*(taken - pose)[:, :2].T).min() < APART:
                    pose = random.uniform([0.4, 0.4, -np.pi], [ROOM[0] - 0.4, LOWER - 0.4, np.pi])
                poses[name] = pose
            assignment[f"more-{k}"] = f"goal-{k}"
        return Instance(blocks, goals, assignment, robot)

    return tuple(instance(seed) for seed in range(count))


def template(height: float = ROOM[1]) -> dict[str, Any]:
    """Return what all instances have in common, as a scenario file states it; places in it stand for any."""
    return {
        "format": "pushplan/1",
        "name": "relopush",
        "floor": {"friction": 0.3},
        "objects": [{"name": "block", "shape": {"box": [SIDE, SIDE]}, "mass": 1.0}],
        "pusher": {"width": 0.285, "friction": 0.5, "thickness": 0.02},
        "robot": {
            "footprint": {"box": [0.42, 0.285], "pose": [-0.21, 0.0, 0.0]},
            "drive": {"car": {"axle": [-AXLE, 0.0, 0.0], "min_radius": RADIUS}},
            "start": [1.0, 1.0, 0.0],
        },
        "start": [1.5, 2.0, 0.0],
        "goal": {"pose": [2.0, 2.0, 0.0], "of": "block", "symmetry": 4},
        "workspace": {"x": [-WALLS, ROOM[0] + WALLS], "y": [-WALLS, height + WALLS]},
    }


def write_scenarios(instance: Instance, name: str, folder: Path) -> None:
    """Write a scenario file for each block of an instance whose goal is free, the others in its way."""
    folder.mkdir(parents=True, exist_ok=True)
    stated = template()
    for block in instance.assignment:
        start = se2.compose(instance.blocks[block], [-0.5 * SIDE, 0.0, 0.0])
        document = {
            **stated,
            "name": f"{name}-{block}",
            "robot": {**stated["robot"], "start": instance.plate.tolist()},
            "start": start.tolist(),
            "goal": {"pose": instance.target(block).tolist(), "of": "block", "symmetry": 4},
            "obstacles": [{"box": [SIDE, SIDE], "pose": pose.tolist()} for pose in instance.others(block)],
        }
        try:
            scenario_from_document(document)
        except ScenarioError as error:
            if not all(finding.where.startswith("goal") for finding in error.findings):
                raise
            continue  # another block stands there
        text = scenario_yaml({key: value for key, value in document.items() if key != "format"})
        (folder / f"{name}-{block}.yaml").write_text(text, "utf-8")


@dataclass(frozen=True)
class Whole:
    """What became of an instance: CPU time to the first plan (s), blocks put out of the way, way of the plate (m)."""

    solved: bool
    seconds: float
    relocations: int = 0
    travel: float = np.nan


def main() -> None:
    """Print the figures of each file."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--instances", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=10.0, help="for each of these, at most")
    parser.add_argument("--files", nargs="+", default=(*FILES, *LAYOUTS), choices=(*FILES, *LAYOUTS))
    parser.add_argument("--scenarios", type=Path, help="write the blocks as scenario files here, and end")
    args = parser.parse_args()
    if args.instances < 1:
        parser.error(f"--instances is {args.instances}; allowed: 1 or more")
    if args.scenarios is not None:
        for name in args.files:
            instances = _instances(args.folder, name, args.instances)
            for k, instance in enumerate(instances, start=1):
                write_scenarios(instance, f"{name}-{k}", args.scenarios)
        return
    time.perf_counter = time.process_time  # searches then count CPU time, whatever else the machine does
    scenario = scenario_from_document(template())
    prepared = MultiPushSearch.of(scenario, PlanSettings().completed(scenario))
    prepared.room(0)
    for name in args.files:
        instances = _instances(args.folder, name, args.instances)
        if name in FILES:
            _report(name, [row for one in instances for row in _blocks(prepared, one)])
        else:
            print(f"{name}:")
        height = LOWER if name in LAYOUTS else ROOM[1]
        _report_whole([row for one in instances if (row := _whole(one, height, args.seconds)) is not None])


def _instances(folder: Path, name: str, count: int) -> tuple[Instance, ...]:
    if name in LAYOUTS:
        return drawn_instances(folder / "boss12_nominal.json", count, LAYOUTS[name])
    return read_instances(folder / f"data_{name}.txt")[:count]


def _whole(instance: Instance, height: float, seconds: float) -> Whole | None:
    """Plan a whole instance; None where a goal is in a wall."""
    stated = template(height)
    block = stated["objects"][0]
    document = {key: value for key, value in stated.items() if key not in ("start", "goal")} | {
        "objects": [{**block, "name": name, "pose": pose.tolist()} for name, pose in instance.blocks.items()],
        "goals": {name: {"pose": instance.target(name).tolist(), "symmetry": 4} for name in instance.assignment},
        "robot": {**stated["robot"], "start": instance.plate.tolist()},
    }
    try:
        planner = Planner(scenario_from_document(document))
    except ScenarioError:
        return None
    began = time.process_time()
    found = planner.plan(time_limit=seconds, seed=1, timed=False, explain=False, first=True)
    spent = time.process_time() - began
    if not found.solved:
        return Whole(False, spent)
    moved = [push.load.names[0] for push in found.pushes if push.load is not None]
    transfers = [name for name, _ in groupby(moved)]
    return Whole(True, spent, len(transfers) - len(set(transfers)), travel_of(found.segments))


def _blocks(prepared: MultiPushSearch, instance: Instance) -> Iterator[tuple[bool, float]]:
    """Yield for each block whose goal is free whether there is a plan, and the CPU time to it, s."""
    for name in instance.assignment:
        began = time.process_time()
        scenario = _scenario(prepared.scenario, instance, name, instance.others(name))
        try:
            goals = free_goals(scenario)
        except PlanningError:
            continue
        room = prepared.with_obstacles(scenario).room(0)
        question = Query(scenario.robot_start, scenario.start, goals)
        limits = Limits(time.perf_counter() + FIRST_LIMIT, first=True)
        found = search(room, question, limits, seed=1).best
        yield found is not None, time.process_time() - began


def _scenario(stated: Scenario, instance: Instance, name: str, others: list[FloatArray]) -> Scenario:
    inner = se2.inverse(stated.chain.objects[0].pose_chain)
    x, y, theta = instance.target(name)
    turned = [np.array([x, y, theta + 0.5 * k * np.pi]) for k in range(4)]
    goals = tuple(Goal(pose, "block", se2.compose(pose, inner), 0.002, 0.0035) for pose in turned)
    load = replace(stated.load, start=se2.compose(np.array(instance.blocks[name]), inner))
    posed = stated.with_task(loads=(load,), goals=(Poses(load.name, goals),), robot_start=instance.plate)
    standing = tuple(PolygonObstacle(se2.transform_points(other, SQUARE)) for other in others)
    return replace(posed, obstacles=standing)


def _report(name: str, rows: list[tuple[bool, float]]) -> None:
    print(f"{name}: {sum(solved for solved, _ in rows)} of {len(rows)} blocks with a free goal solved")
    p50, p90, most = 1e3 * np.percentile([seconds for _, seconds in rows], [50, 90, 100])
    print(f"  first plan, CPU ms: p50 {p50:.1f}, p90 {p90:.1f}, most {most:.0f}")


def _report_whole(rows: list[Whole]) -> None:
    solved = [row for row in rows if row.solved]
    print(f"  whole: {len(solved)} of {len(rows)} instances without a goal in a wall solved")
    if solved:
        p50, p90, most = np.percentile([row.seconds for row in rows], [50, 90, 100])
        print(f"  first plan, or none, CPU s: median {p50:.3f}, p90 {p90:.3f}, most {most:.2f}")
        print(f"  {np.mean([row.relocations for row in solved]):.2f} blocks put out of the way in the mean")
        print(f"  way of the plate in the first plan: median {np.median([row.travel for row in solved]):.1f} m")


if __name__ == "__main__":
    main()
