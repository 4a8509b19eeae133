"""Time and memory of one plan from call to checked, timed result, and answers of `Planner` per second.

Run `python benchmarks/whole_call.py [--questions 100]`. Chains of 1, 3, 8 and 20 boxes in light rooms, and three
boxes among fifteen obstacles. Every whole call gets a scenario of its own, read anew; times are CPU times of one
process that has planned before. Questions are asked between random free poses; those that find no path in 0.3 s are
told and left out of the means. Garbage is collected before: Python's full collection takes as long as a hundred
questions, and would fall into one of the runs by chance.
"""

from __future__ import annotations

import argparse
import gc
import resource
import time
from collections.abc import Callable, Iterator

import numpy as np

from pushplan.bench.store import Machine
from pushplan.geometry import se2
from pushplan.planner import Planner, plan
from pushplan.planners.clearance import Room
from pushplan.plans.plan import Plan
from pushplan.scenario.builders import box, build_scenario, plate
from pushplan.scenario.file import load_scenario
from pushplan.scenario.model import Scenario
from pushplan.util.arrays import FloatArray

CALLS = 15
ROOM = 0.02


def light_room(count: int) -> Scenario:
    """Return a row of small boxes in a room of proportional size, with three obstacles."""
    side = 7.0 + 0.5 * count
    square = 0.25 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return build_scenario(
        f"{count} objects",
        [box(f"box-{i}", 0.08, 0.10, 0.5) for i in range(count)],
        plate(0.12, 0.5),
        (0.6 * side, 0.4 * side, 0.4),
        floor_friction=0.3,
        contact_friction=0.3 if count > 1 else None,
        start=(0.3 * side, 0.2 * side, 0.0),
        obstacles=[square + side * np.array(place) for place in ([0.7, 0.1], [0.2, 0.7], [0.85, 0.6])],
        workspace={"x": [0.0, side], "y": [0.0, side]},
    )


def problems() -> Iterator[tuple[str, Callable[[], Scenario]]]:
    for count in (1, 3, 8, 20):
        yield f"{count} objects, light room", lambda count=count: light_room(count)
    yield "three-boxes-clutter", lambda: load_scenario("three-boxes-clutter")


def whole_calls(make: Callable[[], Scenario]) -> float:
    """Return the median CPU time of a first plan, ms."""
    taken = []
    for _ in range(CALLS):
        scenario = make()
        began = time.process_time()
        result = plan(scenario, first=True)
        taken.append(1e3 * (time.process_time() - began))
        assert result.solved, result.reason
    return float(np.median(taken))


def free_poses(scenario: Scenario, count: int) -> FloatArray:
    rng, room, area = np.random.default_rng(1), Room.of(scenario), scenario.workspace
    assert area is not None
    middle = np.mean([body.outline.mean(axis=0) for body in scenario.chain.bodies], axis=0)
    found = np.zeros((0, 3))
    while len(found) < count:
        poses = rng.uniform([area.xmin, area.ymin, -np.pi], [area.xmax, area.ymax, np.pi], (count, 3))
        poses[:, :2] -= se2.rotate(poses[:, 2], middle)  # long chains stick out to one side of their frame
        found = np.concatenate([found, poses[room.gaps(poses, 2.0 * ROOM) > ROOM]])
    return found[:count]


def asked(ask: Callable[[FloatArray, FloatArray], Plan], pairs: FloatArray) -> tuple[float, int]:
    """Return the mean CPU time of queries with a path, s, and the number of queries without one."""
    gc.collect()
    taken, without = [], 0
    for start, goal in pairs:
        began = time.process_time()
        result = ask(start, goal)
        if result.solved:
            taken.append(time.process_time() - began)
        else:
            without += 1
    return float(np.mean(taken)), without


def show(name: str, make: Callable[[], Scenario], questions: int) -> None:
    whole = whole_calls(make)
    queries = Planner(make())
    poses = free_poses(queries.scenario, 2 * questions)
    pairs = poses.reshape(-1, 2, 3)
    queries.plan(*pairs[0], time_limit=0.3)
    timed, _ = asked(lambda a, b: queries.plan(a, b, time_limit=0.3), pairs)
    paths, without = asked(lambda a, b: queries.plan(a, b, timed=False, time_limit=0.3), pairs)
    queries.reach(poses[:1], poses[:1])
    began = time.process_time()
    costs = queries.reach(poses[::2], poses[1::2])
    each = (time.process_time() - began) / costs.size
    print(
        f"{name:24} whole call {whole:6.1f} ms | questions/s: timed {1 / timed:6.0f}, paths {1 / paths:6.0f} "
        f"({without} of {len(pairs)} without a path), reach {1 / each:8.0f} pairs/s",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--questions", type=int, default=100)
    arguments = parser.parse_args()
    print(Machine.this().words)
    plan(load_scenario("two-crates"), first=True)
    for name, make in problems():
        show(name, make, arguments.questions)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"peak memory of the process: {peak:.0f} MB")


if __name__ == "__main__":
    main()
