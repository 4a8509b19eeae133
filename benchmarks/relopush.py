"""Problems of ReloPush (fluentrobotics/ReloPush, BSD-3-Clause): each block alone, and whole instances.

    python benchmarks/relopush.py FOLDER [--instances 100] [--seconds 10] [--files 2o1r 3o_2 4o 5o 6o2 8o boss12]
        [--scenarios DIR]

FOLDER is its `testdata`: data_2o1r.txt and so on, an instance a line with poses of blocks and goals, which block goes
where, and the pose of the axle. The blocks are cubes of 0.15 m that may end in any of four orientations. The car
has a footprint of 0.42 x 0.285 m, its rear axle 0.30 m behind its front plate, and a least turning radius of 1.008 m.
Masses and frictions are not stated there; those here are common ones. The walls are 0.5 m outside of the room of
4.0 x 5.4 m, because the planner of ReloPush lets its robot leave the room.

boss12 is made of boss12_nominal.json, the layout of ReloPush-BOSS's twelve blocks: blocks, goals and robot are up to
0.05 m and 0.1 rad off, with the number of the instance as seed. Only whole instances of it are planned.

With `--scenarios` nothing is measured: each block whose goal is free becomes a scenario file in DIR, for suites.

Prints for each block alone, with the others as obstacles: how many with a free goal get a plan, and the CPU time to
the first one (the load prepared, the room built anew). For whole instances: how many get a plan within `--seconds`,
the CPU time to it, how often a block is put out of the way, and the travel of the plate.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from script import options

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
from pushplan.scenario.parts import PolygonObstacle
from pushplan.sim.control.rest import travel_of
from pushplan.util.arrays import FloatArray

SIDE, AXLE, RADIUS = 0.15, 0.30, 1.008
"""Side of a block, distance of the axle behind the plate, and least turning radius, m."""
WIDTH, HEIGHT, LOWER, WALLS = 4.0, 5.4, 5.2, 0.5
"""Size of the room, height of the layout's room, and distance of the walls outside of it, m."""
FIRST_LIMIT = 4.0
LAYOUT = "boss12"
FILES = ("2o1r", "3o_2", "4o", "5o", "6o2", "8o", LAYOUT)
NOISE = np.array([0.05, 0.05, 0.1])
"""Largest differences from the layout: m, m, rad."""
SQUARE = 0.5 * SIDE * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
COMMON: dict[str, Any] = {
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
    "workspace": {"x": [-WALLS, WIDTH + WALLS], "y": [-WALLS, HEIGHT + WALLS]},
}
"""Sections that all instances share; its poses are replaced."""


@dataclass(frozen=True)
class Instance:
    """Poses (3,) of the blocks, of their goals and of the car's plate in the room, m and rad."""

    blocks: dict[str, FloatArray]
    goals: dict[str, FloatArray]
    plate: FloatArray

    @classmethod
    def of(cls, blocks: Any, goals: Any, assignment: dict[str, str], axle: FloatArray) -> Instance:
        """Return the instance with an assignment of goals to blocks."""
        return cls(
            blocks, {block: goals[goal] for block, goal in assignment.items()}, se2.compose(axle, [AXLE, 0, 0])
        )

    def others(self, block: str) -> list[FloatArray]:
        """Return the poses (3,) of the other blocks."""
        return [pose for name, pose in self.blocks.items() if name != block]

    @property
    def robot(self) -> dict[str, Any]:
        """Section `robot` of a scenario file."""
        return {**COMMON["robot"], "start": self.plate.tolist()}


def read_instances(path: Path) -> Iterator[Instance]:
    """Yield the instances of a file: a line each, `mo:NAME,X,Y,THETA,SIDES;...!robot:...!goal:...!assign:...`."""

    def poses(stated: str) -> dict[str, FloatArray]:
        rows = [one.split(",") for one in stated.split(";")]
        return {name: np.array(pose[:3], dtype=float) for name, *pose in rows}

    for line in filter(None, path.read_text("utf-8").splitlines()):
        parts = dict(part.split(":") for part in line.split("!"))
        assignment = dict(pair.split(",") for pair in parts["assign"].split(";"))
        axle = np.array(parts["robot"].split(","), dtype=float)
        yield Instance.of(poses(parts["mo"]), poses(parts["goal"]), assignment, axle)


def drawn_instances(path: Path, count: int) -> Iterator[Instance]:
    """Yield instances of a layout with pose errors."""
    stated = json.loads(path.read_text("utf-8"))
    for seed in range(count):
        random = np.random.default_rng(seed)

        def off(pose: list[float], random: np.random.Generator = random) -> FloatArray:
            return np.asarray(pose, dtype=float) + random.uniform(-1.0, 1.0, 3) * NOISE

        blocks, goals = ({n: off(p) for n, p in stated[what].items()} for what in ("blocks", "goals"))
        yield Instance.of(blocks, goals, stated["assignment"], off(stated["robot"]))


def write_scenarios(instance: Instance, name: str, folder: Path) -> None:
    """Write a scenario file for each block of an instance whose goal is free, with the others as obstacles."""
    folder.mkdir(parents=True, exist_ok=True)
    for block, goal in instance.goals.items():
        document = {
            **COMMON,
            "name": f"{name}-{block}",
            "robot": instance.robot,
            "start": se2.compose(instance.blocks[block], [-0.5 * SIDE, 0.0, 0.0]).tolist(),
            "goal": {**COMMON["goal"], "pose": goal.tolist()},
            "obstacles": [{"box": [SIDE, SIDE], "pose": pose.tolist()} for pose in instance.others(block)],
        }
        try:
            scenario_from_document(document)
        except ScenarioError as error:
            if not all(finding.where.startswith("goal") for finding in error.findings):
                raise
            continue  # another block stands there
        del document["format"]
        (folder / f"{name}-{block}.yaml").write_text(scenario_yaml(document), "utf-8")


def whole(instance: Instance, height: float, seconds: float) -> tuple[float, float, float] | None:
    """Plan an instance.

    Returns:
        CPU time (s), blocks put out of the way and travel (m), which are NaN without a plan; None if a goal is in a
        wall.
    """
    document = {key: value for key, value in COMMON.items() if key not in ("start", "goal")} | {
        "objects": [{**COMMON["objects"][0], "name": n, "pose": p.tolist()} for n, p in instance.blocks.items()],
        "goals": {name: {"pose": goal.tolist(), "symmetry": 4} for name, goal in instance.goals.items()},
        "robot": instance.robot,
        "workspace": {**COMMON["workspace"], "y": [-WALLS, height + WALLS]},
    }
    try:
        planner = Planner(scenario_from_document(document))
    except ScenarioError:
        return None
    began = time.process_time()
    found = planner.plan(time_limit=seconds, seed=1, timed=False, explain=False, first=True)
    spent = time.process_time() - began
    if not found.solved:
        return spent, np.nan, np.nan
    moved = [push.load.names[0] for push in found.pushes if push.load is not None]
    transfers = [name for name, _ in groupby(moved)]
    return spent, float(len(transfers) - len(set(transfers))), travel_of(found.segments)


def alone(prepared: MultiPushSearch, instance: Instance) -> Iterator[tuple[bool, float]]:
    """Yield for each block with a free goal whether there is a plan, and the CPU time to it, s."""
    inner = se2.inverse(prepared.scenario.chain.objects[0].pose_chain)
    for name, goal in instance.goals.items():
        began = time.process_time()
        turned = [goal + 0.5 * np.pi * np.array([0.0, 0.0, k]) for k in range(4)]
        goals = tuple(Goal(pose, "block", se2.compose(pose, inner), 0.002, 0.0035) for pose in turned)
        load = replace(prepared.scenario.load, start=se2.compose(instance.blocks[name], inner))
        posed = prepared.scenario.with_task(
            loads=(load,), goals=(Poses(load.name, goals),), robot_start=instance.plate
        )
        others = [PolygonObstacle(se2.transform_points(other, SQUARE)) for other in instance.others(name)]
        scenario = replace(posed, obstacles=tuple(others))
        try:
            question = Query(scenario.robot_start, scenario.start, free_goals(scenario))
        except PlanningError:
            continue
        room = prepared.with_obstacles(scenario).room(0)
        found = search(room, question, Limits(time.perf_counter() + FIRST_LIMIT, first=True), seed=1).best
        yield found is not None, time.process_time() - began


def main() -> None:
    asked = options(__doc__, "folder", instances=100, seconds=10.0, files=FILES, scenarios=Path)
    scenario = scenario_from_document(COMMON)
    prepared = MultiPushSearch.of(scenario, PlanSettings().completed(scenario))
    prepared.room(0)
    for name in asked.files:
        if name == LAYOUT:
            instances = [*drawn_instances(asked.folder / "boss12_nominal.json", asked.instances)]
        else:
            instances = [*read_instances(asked.folder / f"data_{name}.txt")][: asked.instances]
        if asked.scenarios is not None:
            for k, instance in enumerate(instances, start=1):
                write_scenarios(instance, f"{name}-{k}", asked.scenarios)
            continue
        print(f"{name}:")
        if name != LAYOUT:
            solved, seconds = zip(*(row for one in instances for row in alone(prepared, one)), strict=True)
            p50, p90, most = 1e3 * np.percentile(seconds, [50, 90, 100])
            print(f"  alone: {sum(solved)} of {len(solved)} blocks with a free goal solved")
            print(f"  first plan, CPU ms: median {p50:.1f}, 90 % {p90:.1f}, most {most:.0f}")
        height = LOWER if name == LAYOUT else HEIGHT
        found = [whole(one, height, asked.seconds) for one in instances]
        spent, moved, travel = np.array([row for row in found if row is not None]).T
        p50, p90, most = np.percentile(spent, [50, 90, 100])
        print(f"  whole: {np.isfinite(travel).sum()} of {len(travel)} instances without a goal in a wall solved")
        print(f"  first plan, or none, CPU s: median {p50:.3f}, 90 % {p90:.3f}, most {most:.2f}")
        print(f"  {np.nanmean(moved):.2f} blocks put out of the way in the mean")
        print(f"  travel of the plate: median {np.nanmedian(travel):.1f} m", flush=True)


if __name__ == "__main__":
    main()
