"""Blocks of boxes side by side: do plans hold in a physics engine with the small gaps of real blocks?

    python benchmarks/blocks.py [--plans 60] [--draws 10] [--seed 5900] [--spread]

Columns of unequal boxes (2 x 1, 3 x 1, 2 x 2, 3 x 2), a plate that is wider or narrower than the block, among
obstacles. Every box stands on four feet, or, with `--spread`, on its whole face, for which the engine takes up to
fifty times as long. Every plan is executed in MuJoCo at its own speed; the columns stand apart by gaps drawn from 0
to 0.3 mm. A run counts as kept where every object stays within 0.5 mm and 0.3 deg of where it is on the plate after
the first 20 mm, and as arrived where each ends within 2 mm and 0.5 deg of the end of the plan.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from script import options, share

import pushplan
from pushplan.geometry import se2
from pushplan.scenario.file import scenario_from_document
from pushplan.sim.physics.simulate import simulate_in_physics
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

BLOCKS = ((2, 1), (3, 1), (2, 2), (3, 2))
"""Columns and rows."""
WIDTH, GAP, INSET = 0.15, 3e-4, 0.01
SETTLED = 0.02
KEPT, ARRIVED = (5e-4, math.radians(0.3)), (2e-3, math.radians(0.5))


def document(columns: int, rows: int, wide: bool, spread: bool, random: np.random.Generator) -> dict[str, Any]:
    """Return a scenario document of a block with unequal boxes among obstacles."""
    objects: list[dict[str, Any]] = []
    plate = columns * WIDTH + (0.1 if wide else -0.1)
    first = -0.5 * (columns - 1) * WIDTH
    origin = 0.5 * (max(first - 0.5 * WIDTH, -0.5 * plate) + min(first + 0.5 * WIDTH, 0.5 * plate))
    for column in range(columns):
        x = 0.0
        for row in range(rows):
            length = random.uniform(0.1, 0.2)
            y = first + column * WIDTH - origin
            objects.append({
                "name": f"b{column}{row}",
                "shape": {"box": [length, WIDTH]},
                "mass": random.uniform(0.8, 2.0),
                "pose": [x + 0.5 * length, y, 0.0],
                "support": "uniform" if spread else {"feet": [
                    [a * (0.5 * length - INSET), b * (0.5 * WIDTH - INSET), 0.25] for a in (1, -1) for b in (1, -1)
                ]},
            })  # fmt: skip
            x += length
    objects[0]["offset"] = first  # the origin is the middle of the plate's contact with it
    goal = [random.uniform(1.8, 2.4), random.uniform(-0.7, 0.7), random.uniform(-0.8, 0.8)]
    obstacles = [{"circle": 0.12, "center": random.uniform([0.7, -1.2], [1.1, 1.2]).tolist()} for _ in range(3)]
    return {
        "format": "pushplan/1",
        "name": f"block-{columns}x{rows}",
        "floor": {"friction": random.uniform(0.2, 0.4)},
        "objects": objects,
        "contacts": {"friction": random.uniform(0.3, 0.6)},
        "pusher": {"width": plate, "friction": 0.5},
        "start": [0.0, 0.0, 0.0],
        "goal": {"pose": goal},
        "obstacles": obstacles,
        "workspace": {"x": [-1.5, 3.5], "y": [-2.0, 2.0]},
    }


def apart(world: World, gaps: FloatArray) -> World:
    """Return a world whose columns are separated by gaps (columns - 1,), m, about the middle one."""
    places = np.array([obj.pose_chain for obj in world.chain.objects])
    column = np.round((places[:, 1] - places[:, 1].min()) / WIDTH).astype(int)
    aside = np.concatenate([[0.0], np.cumsum(gaps)])
    places[:, 1] += (aside - aside.mean())[column]
    return world.with_object_poses(se2.compose(world.start, places))


def held(report: Any, plate: FloatArray) -> tuple[float, float]:
    """Return the largest motion (m, rad) of objects on the plate with poses (m, 3) after it has driven `SETTLED`."""
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(plate[:, :2], axis=0).T))])
    on_plate = se2.relative(plate[:, None], report.objects)[driven > SETTLED]
    off = on_plate - on_plate[0]
    return float(np.hypot(off[..., 0], off[..., 1]).max()), float(np.abs(se2.wrap_angle(off[..., 2])).max())


def main() -> None:
    """Print a line for each plan, and the shares of runs that were kept and that arrived."""
    asked = options(__doc__, plans=60, draws=10, seed=5900, spread=False)
    kept = arrived = runs = plans = seed = 0
    while plans < asked.plans:
        random = np.random.default_rng([asked.seed, seed])
        columns, rows = BLOCKS[seed % len(BLOCKS)]
        seed += 1
        try:
            scenario = scenario_from_document(document(columns, rows, seed % 8 < 4, asked.spread, random))
        except pushplan.ScenarioError:  # ends of boxes in neighbouring columns lie within 1 mm of one another
            continue
        plan = pushplan.plan(scenario, seed=1, iterations=300)
        if not plan.solved or plan.trajectory is None:
            continue
        plans, began, worst = plans + 1, time.process_time(), np.zeros(2)
        for _ in range(asked.draws):
            there = apart(World.from_scenario(scenario), random.uniform(0.0, GAP, columns - 1))
            report = simulate_in_physics(plan, there)
            moved = np.array(held(report, report.poses))
            worst = np.maximum(worst, moved)
            kept += bool((moved <= KEPT).all())
            arrived += bool((report.object_errors.max(axis=0) <= ARRIVED).all())
            runs += 1
        print(
            f"{scenario.name} {seed - 1:3}  margin {plan.min_margin:.3f}  moved at most {1e3 * worst[0]:.2f} mm "
            f"{math.degrees(worst[1]):.2f} deg  {time.process_time() - began:.1f} s",
            flush=True,
        )
    print(f"{plans} plans, runs: kept {share(kept, runs)}, arrived {share(arrived, runs)}")


if __name__ == "__main__":
    main()
