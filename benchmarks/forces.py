"""The needed force of plans against the force of the plate in MuJoCo, by impulse over 50 ms.

Run `python benchmarks/forces.py [NAME ...] [--iterations 300]`; prints for every packaged scenario with known loads
the largest force of the plan, and by how much impulses of the plate differ from the plan's in windows of 50 ms: while
it pushes steadily, with hardly any acceleration, and in all windows. Exits 1 where an impulse of steady pushing is
more than 5 % off. MuJoCo drives the plate at full speed with all inertia. The first 0.1 s do
not count: contacts take up their load.
"""

from __future__ import annotations

import argparse
import math
import sys

import numpy as np

import pushplan
from pushplan.bench.store import Machine
from pushplan.plans.judge import push_force
from pushplan.plans.plan import Plan
from pushplan.scenario.file import example_names
from pushplan.sim.physics.engine import engine
from pushplan.sim.physics.simulator import HARD, PhysicsSimulator, sliding_speed
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

WINDOW = 0.05
"""s."""
BEGIN = 0.1
"""s."""
STEADY = 0.02
"""Acceleration (m/s^2, and rad/s^2 times the chain's length) below which pushing is steady."""
ALLOWED = 0.05


def impulses(plan: Plan) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean forces in windows (k,), N, of MuJoCo and of the plan, and the largest accelerations there (k,)."""
    (segment,), chain = plan.segments, plan.scenario.chain
    trajectory, steps = segment.contact_trajectory, round(WINDOW / HARD.time_step)
    count = math.floor(trajectory.duration / WINDOW) * steps
    at = HARD.time_step * np.arange(count + 1)
    frames = trajectory.poses_at(at)
    world, sliding = World.from_chain(chain, frames[0]), sliding_speed(chain, frames, HARD.time_step)
    forces = PhysicsSimulator(world, HARD, sliding).move_along(frames)[:, :2]
    middle = at[:-1] + 0.5 * HARD.time_step
    twists, rates = trajectory.directions_at(middle), trajectory.rates_at(middle)
    needed = push_force(plan.scenario, plan.stable_set).moving(twists, rates)
    own = forces.reshape(-1, steps, 2).mean(axis=1)
    changing = np.abs(rates * [1.0, 1.0, chain.characteristic_length]).max(axis=1)
    windows = slice(round(BEGIN / WINDOW), None)
    return (
        np.hypot(own[:, 0], own[:, 1])[windows],
        needed.reshape(-1, steps).mean(axis=1)[windows],
        changing.reshape(-1, steps).max(axis=1)[windows],
    )


def main() -> int:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--iterations", type=int, default=300)
    arguments = parser.parse_args()
    print(f"{Machine.this().words}, MuJoCo {engine().__version__}")
    print(f"{'scenario':22} {'force, N':>8} {'steady windows':>15} {'worst, %':>9} {'of all':>7} {'worst, %':>9}")
    worst = 0.0
    for name in arguments.names or example_names():
        scenario = pushplan.load_scenario(name)
        if scenario.kind != "push" or scenario.has_intervals or not scenario.chain.loads_known:
            continue
        plan = pushplan.plan(scenario, seed=1, time_limit=60.0, iterations=arguments.iterations)
        if not plan.solved:
            print(f"{name:22} {plan.reason}")
            return 1
        found, needed, changing = impulses(plan)
        off, steady = np.abs(found / needed - 1.0), changing < STEADY
        worst = max(worst, float(off[steady].max(initial=0.0)))
        print(
            f"{name:22} {plan.max_force:8.2f} {steady.sum():15d} {100.0 * off[steady].max(initial=0.0):9.3f} "
            f"{len(off):7d} {100.0 * off.max():9.3f}"
        )
    print(f"steady pushing: at most {100.0 * worst:.3f} % off; allowed: {100.0 * ALLOWED:g} %")
    return int(worst > ALLOWED)


if __name__ == "__main__":
    sys.exit(main())
