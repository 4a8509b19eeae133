"""Problems of ReloPush (fluentrobotics/ReloPush, BSD-3-Clause): each block alone, and whole instances.

    python benchmarks/relopush.py FOLDER [--instances 100] [--better 10] [--files 2o1r 4o 6o2] [--strict]

FOLDER holds its `testdata` as 2o1r.json, 4o.json and 6o2.json: lists of {blocks, goals, assignment, robot}, poses as
[x, y, theta]. The robot is a car of 0.42 x 0.285 m, axle 0.30 m behind its plate, turning radius 1.008 m; blocks are
cubes of 0.15 m that may end in any of four orientations; the walls are 0.5 m outside of the room of 4.0 x 5.4 m, or
around it with `--strict`.

Printed for each block alone, the others in the way: how many with a free goal get a plan, the CPU time to the first
one (the load prepared, the room built anew), how long a refusal of an occupied goal takes, and for the first
`--better` instances the way of the block over the straight line after 1 s, its changes weighed little. For whole
instances: how many get a plan within 20 s, the CPU time to it, and how often a block is put out of the way; the legs
of the first `--better` ones are timed, executed and judged by code that the search does not use.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pushplan.basics.arrays import FloatArray
from pushplan.errors import PlanningError
from pushplan.geometry import se2
from pushplan.planners.multi.room import Question
from pushplan.planners.multi.search import Limits, search
from pushplan.planners.multi.sequence import Sequence
from pushplan.reading.scenario_file import scenario_from_document
from pushplan.rearrangement.order import Order
from pushplan.rearrangement.pieces import Piece, Situation
from pushplan.rearrangement.plan import leg_of
from pushplan.scenario import Goal, PolygonObstacle, Scenario, Workspace
from pushplan.several.plan import free_goals
from pushplan.several.prepared import Prepared
from pushplan.several.warm import warm_up_several

SIDE, AXLE, LOOSE = 0.15, 0.30, 0.5
FIRST_LIMIT, WHOLE_LIMIT = 4.0, 20.0
FILES = ("2o1r", "4o", "6o2")
SQUARE = 0.5 * SIDE * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
DOCUMENT: dict[str, Any] = {
    "format": "pushplan/1",
    "name": "relopush",
    "floor": {"friction": 0.3},
    "objects": [{"name": "cube", "shape": {"box": [SIDE, SIDE]}, "mass": 1.0}],
    "pusher": {"width": 0.285, "friction": 0.5, "thickness": 0.02},
    "robot": {
        "footprint": {"box": [0.42, 0.285], "pose": [-0.21, 0.0, 0.0]},
        "drive": {"car": {"axle": [-AXLE, 0.0, 0.0], "min_radius": 1.008}},
        "start": [1.0, -5.0, 0.0],
    },
    "goal": {"pose": [1.0, 0.0, 0.0], "of": "cube", "symmetry": 4},
}


@dataclass(frozen=True)
class Row:
    """What became of a block: CPU time (s), way of the block over the straight line, pushes."""

    refused: bool
    seconds: float
    way: float | None = None
    pushes: int = 0


@dataclass(frozen=True)
class Whole:
    """What became of an instance: CPU time (s), blocks put out of the way, whether all legs passed the check."""

    solved: bool
    seconds: float
    relocations: int = 0
    valid: bool | None = None


def main() -> None:
    """Print the figures of each file."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--instances", type=int, default=100)
    parser.add_argument("--better", type=int, default=10)
    parser.add_argument("--files", nargs="+", default=FILES, choices=FILES)
    parser.add_argument("--strict", action="store_true")
    args = parser.parse_args()
    warm_up_several(print, "ecof", intervals=False)
    prepared = _prepared(0.0 if args.strict else LOOSE, {})
    light = _prepared(0.0 if args.strict else LOOSE, {"switch_cost": 0.05, "transit_weight": 0.01})
    for name in args.files:
        instances = json.loads((args.folder / f"{name}.json").read_text())
        first = [row for one in instances[: args.instances] for row in _blocks(prepared, one, None)]
        better = [row for one in instances[: args.better] for row in _blocks(light, one, 1.0)]
        _report(name, first, better)
        whole = [_whole(prepared, one, k < args.better) for k, one in enumerate(instances[: args.instances])]
        _report_whole(name, whole)


def _prepared(loose: float, pushes: dict[str, float]) -> Prepared:
    scenario = scenario_from_document({**DOCUMENT, "pushes": pushes})
    area = Workspace(-loose, 4.0 + loose, -loose, 5.4 + loose)
    prepared = Prepared.of(replace(scenario, workspace=area))
    prepared.room(0)
    return prepared


def _plate(instance: dict[str, Any]) -> FloatArray:
    x, y, theta = map(float, instance["robot"].split(","))
    return se2.compose(np.array([x, y, theta]), [AXLE, 0.0, 0.0])


def _whole(prepared: Prepared, instance: dict[str, Any], judged: bool) -> Whole:
    began, plate = time.process_time(), _plate(instance)
    scenarios = {
        name: _scenario(
            prepared.scenario,
            plate,
            np.array(pose),
            np.array(instance["goals"][instance["assignment"][name]]),
            [],
        )
        for name, pose in instance["blocks"].items()
    }
    pieces = tuple(Piece(name, prepared.asked(scenario), True) for name, scenario in scenarios.items())
    poses = np.array([scenario.start for scenario in scenarios.values()])
    now = Situation(plate, poses, frozenset(range(len(pieces))))
    errands = Order(pieces, 1, time.perf_counter() + WHOLE_LIMIT).find(now)
    spent = time.process_time() - began
    if errands is None:
        return Whole(False, spent)
    valid = all(leg_of(pieces, one, 1).plan.solved for one in errands) if judged else None
    return Whole(True, spent, sum(not one.delivers for one in errands), valid)


def _blocks(prepared: Prepared, instance: dict[str, Any], limit: float | None) -> Iterator[Row]:
    plate = _plate(instance)
    for name, goal in instance["assignment"].items():
        others = [np.array(pose) for other, pose in instance["blocks"].items() if other != name]
        began = time.process_time()
        block, target = np.array(instance["blocks"][name]), np.array(instance["goals"][goal])
        scenario = _scenario(prepared.scenario, plate, block, target, others)
        yield _row(prepared, scenario, began, float(np.hypot(*(target - block)[:2])), limit)


def _scenario(
    stated: Scenario, plate: FloatArray, block: FloatArray, target: FloatArray, others: list[FloatArray]
) -> Scenario:
    inner = se2.inverse(stated.chain.objects[0].pose_chain)
    pushes = stated.pushes
    assert pushes is not None
    x, y, theta = target
    turned = [np.array([x, y, theta + 0.5 * k * np.pi]) for k in range(4)]
    goals = tuple(Goal(pose, "cube", se2.compose(pose, inner), 0.002, 0.0035) for pose in turned)
    return replace(
        stated,
        start=se2.compose(block, inner),
        goal=goals[0],
        obstacles=tuple(PolygonObstacle(se2.transform_points(other, SQUARE)) for other in others),
        pushes=replace(pushes, robot_start=plate, goals=goals),
    )


def _row(prepared: Prepared, scenario: Scenario, began: float, straight: float, limit: float | None) -> Row:
    try:
        goals = free_goals(scenario)
    except PlanningError:
        return Row(True, time.process_time() - began)
    room = prepared.with_obstacles(scenario).room(0)
    until = time.perf_counter() + (FIRST_LIMIT if limit is None else limit)
    question = Question(scenario.robot_start, scenario.start, goals)
    found = search(room, question, Limits(until, first=limit is None), seed=1).best
    spent = time.process_time() - began
    if found is None:
        return Row(False, spent)
    return Row(False, spent, _way(scenario, found) / straight, len(found.steps))


def _way(scenario: Scenario, found: Sequence) -> float:
    """How far the middle of the block goes, m; it is as far ahead of every contact."""
    ahead = float(scenario.chain.objects[0].pose_chain[0])
    arcs = np.concatenate([step.arcs for step in found.steps])
    return float((np.hypot(arcs[:, 0], arcs[:, 1] + ahead * arcs[:, 2]) * arcs[:, 3]).sum())


def _report(name: str, first: list[Row], better: list[Row]) -> None:
    asked, refused = [row for row in first if not row.refused], [row for row in first if row.refused]
    solved = [row for row in asked if row.way is not None]
    print(f"{name}: {len(solved)} of {len(asked)} blocks with a free goal solved (wanted: 99 %)")
    p50, p90, most = 1e3 * np.percentile([row.seconds for row in asked], [50, 90, 100])
    print(f"  first plan, CPU ms: p50 {p50:.1f} (wanted: 10), p90 {p90:.1f} (wanted: 30), most {most:.0f}")
    if refused:
        longest = 1e3 * max(row.seconds for row in refused)
        print(f"  {len(refused)} occupied goals refused, CPU ms: most {longest:.1f} (wanted: 10)")
    ways = [row.way for row in better if row.way is not None]
    pushes = np.mean([row.pushes for row in better if row.way is not None])
    print(
        f"  way over straight line after 1 s: median {np.median(ways):.3f} (wanted: 1.05), {pushes:.2f} pushes"
    )


def _report_whole(name: str, rows: list[Whole]) -> None:
    solved, judged = [row for row in rows if row.solved], [row.valid for row in rows if row.valid is not None]
    seconds = [row.seconds for row in rows]
    wanted = 2.0 if name == "6o2" else 0.3
    print(f"  whole: {len(solved)} of {len(rows)} instances solved (wanted: 98 %)")
    p50, p90, most = np.percentile(seconds, [50, 90, 100])
    print(f"  first plan, CPU s: median {p50:.3f} (wanted: {wanted}), p90 {p90:.3f}, most {most:.2f}")
    print(f"  {np.mean([row.relocations for row in solved]):.2f} blocks put out of the way in the mean")
    print(f"  {sum(judged)} of {len(judged)} plans pass the check that shares no code with the search")


if __name__ == "__main__":
    main()
