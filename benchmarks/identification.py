"""How often do the intervals that identification states hold the truth? Simulated pushes with errors of the model.

Run `python benchmarks/identification.py [--sets 200] [--seed 58] [--jobs 1]`: about 10 s of CPU time a set. A
set is one random object, or two in one of four sets, on even pressure or on three to six feet with unknown
loads. It is pushed three times by 4 to 7 cm so that something slips. Errors of the model: between pushes, each
friction changes by up to 10 % (standard deviation, drawn by set) and each load by half of that; the plate
stands up to 0.3 deg off. Poses have noise of 0.2 to 1 mm and 0.06 to 0.3 deg. Every third set is measured only
before and after each push. The script pools all stated intervals, that is those of values that the pushes
determine.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from random_chains import random_chain, tell

from pushplan.bench.store import Machine
from pushplan.geometry import se2
from pushplan.mechanics.support import FeetSupport
from pushplan.plans.execution import wilson
from pushplan.sim.identify.identify import identify_pushes
from pushplan.sim.identify.measured_push import LEVEL, MeasuredPush
from pushplan.sim.identify.unknowns import Unknowns
from pushplan.sim.slip import simulate_poses
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

PUSHES, SAMPLES = 3, 41
SLIPS = 2e-3
"""Distance (m) by which something has to slip in a push."""


@dataclass(frozen=True)
class Interval:
    """An interval of one kind of unknown, and the truth."""

    kind: str
    low: float
    high: float
    truth: float
    widest: float

    @property
    def holds(self) -> bool:
        return self.low <= self.truth <= self.high


def stated(random: np.random.Generator) -> World:
    """Return the world of a set as somebody would state it: loads of feet are unknown."""
    most = 1 + int(random.random() < 0.25)
    while len((chain := random_chain(random)).objects) != most:
        pass
    world = World.from_chain(chain)
    for obj in chain.objects:
        if isinstance(obj.support, FeetSupport):
            feet = obj.support.positions
            world = world.with_support(FeetSupport(feet, center_of_mass=feet.mean(axis=0)), obj.name)
    return world


def pushed(
    unknowns: Unknowns, parts: FloatArray, spread: float, noise: float, rare: bool, random: np.random.Generator
) -> MeasuredPush:
    """Return a push in which something slips, of a world that is a little different in each push."""
    for _ in range(100):
        off = spread * unknowns.units(parts) * random.normal(size=len(parts))
        off *= [0.5 if one.kind in ("border", "tilt", "foot") else 1.0 for one in unknowns.each]
        world = unknowns.world_for(unknowns.values(np.clip(parts + off, 0.005, 0.995)))
        twist = np.array([1.0, random.uniform(-0.8, 0.8), random.uniform(-8.0, 8.0)]) * random.uniform(0.04, 0.07)
        plate = se2.compose(world.start, se2.exp(np.linspace(0.0, 1.0, SAMPLES)[:, None] * twist))
        report = simulate_poses(np.linspace(0.0, 1.0, SAMPLES), plate, world)
        if report.jammed_at is None and np.nanmax(np.abs(report.slide)) > SLIPS:
            break
    size = noise * np.array([1.0, 1.0, 5.0])
    seen = report.objects + size * random.normal(size=report.objects.shape)
    if rare:
        seen[1:-1] = np.nan
    turned = np.array([0.0, 0.0, np.radians(random.uniform(-0.3, 0.3))])
    return MeasuredPush(se2.compose(report.poses, turned), seen)


def intervals(job: tuple[int, int]) -> list[Interval]:
    """Return what is stated of one set."""
    random = np.random.default_rng(job)
    world = stated(random)
    unknowns = Unknowns.from_world(world)
    parts = random.uniform(0.08, 0.6, len(unknowns.each))
    spread, noise = random.uniform(0.0, 0.1), random.uniform(2e-4, 1e-3)
    pushes = [pushed(unknowns, parts, spread, noise, job[1] % 3 == 2, random) for _ in range(PUSHES)]
    found = identify_pushes(world, pushes, jobs=1)
    return [
        Interval(one.unknown.kind, one.low, one.high, float(truth), one.unknown.high - one.unknown.low)
        for one, truth in zip(found.estimates, unknowns.values(parts), strict=True)
        if one.determined
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=58)
    parser.add_argument("--jobs", type=int, default=1)
    asked = parser.parse_args()
    print(Machine.this().words)
    every = list[Interval]()
    with ProcessPoolExecutor(asked.jobs) as pool:
        for k, found in enumerate(pool.map(intervals, [(asked.seed, k) for k in range(asked.sets)])):
            every += found
            if (k + 1) % 10 == 0:
                print(f"  {k + 1} sets: {sum(one.holds for one in every)} of {len(every)}", flush=True)
    for kind, count in Counter(one.kind for one in every).items():
        these = [one for one in every if one.kind == kind]
        width = float(np.median([(one.high - one.low) / one.widest for one in these]))
        print(
            f"  {kind}: {sum(one.holds for one in these)} of {count}, {100.0 * width:.0f} % of what was possible wide"
        )
    share = sum(one.holds for one in every) / len(every)
    low, high = wilson(sum(one.holds for one in every), len(every))
    print(f"  {len(every)} intervals of {100 * LEVEL:.0f} %: {100 * low:.1f} to {100 * high:.1f} % hold the truth")
    good = tell(f"share of {len(every)} stated intervals that hold the truth", share, ">=", 0.90)
    return 0 if good & tell("and at most", share, "<=", 0.99) else 1


if __name__ == "__main__":
    sys.exit(main())
