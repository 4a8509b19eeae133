"""How often do the intervals of identification hold the truth? Simulated pushes with errors of the model.

    python benchmarks/identification.py [--sets 200] [--seed 58] [--jobs 1]

A set is one random object, or two in one of four sets, on even pressure or on three to six feet with unknown loads.
It is pushed three times by 4 to 7 cm so that something slips. Between pushes each friction changes by up to 10 %
(standard deviation, drawn by set) and each load by half of that; the plate is up to 0.3 deg off. Poses have noise of
0.2 to 1 mm and 0.06 to 0.3 deg. Every third set is measured only before and after each push. The script pools all
stated intervals, which are those of values that the pushes determine. A set takes about 10 s of CPU time.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat

import numpy as np
import pandas as pd
from random_chains import random_chain
from script import options, share, tell

from pushplan.geometry import se2
from pushplan.mechanics.support import FeetSupport
from pushplan.sim.identify.identify import identify_pushes
from pushplan.sim.identify.measured_push import LEVEL, MeasuredPush
from pushplan.sim.identify.unknowns import Unknowns
from pushplan.sim.slip import simulate_poses
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

PUSHES, SAMPLES = 3, 41
SLIPS = 2e-3
"""Distance (m) by which something has to slip in a push."""


def stated(random: np.random.Generator) -> World:
    """Return the world of a set as a user would state it: loads of feet are unknown."""
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


def intervals(seed: int, number: int) -> list[tuple[str, bool, float]]:
    """Return the intervals of a set: kind of the unknown, whether it holds the truth, and its relative width."""
    random = np.random.default_rng((seed, number))
    world = stated(random)
    unknowns = Unknowns.from_world(world)
    parts = random.uniform(0.08, 0.6, len(unknowns.each))
    spread, noise = random.uniform(0.0, 0.1), random.uniform(2e-4, 1e-3)
    pushes = [pushed(unknowns, parts, spread, noise, number % 3 == 2, random) for _ in range(PUSHES)]
    return [
        (one.unknown.kind, one.low <= truth <= one.high, (one.high - one.low) / (one.unknown.high - one.unknown.low))
        for one, truth in zip(identify_pushes(world, pushes, jobs=1).estimates, unknowns.values(parts), strict=True)
        if one.determined
    ]


def main() -> int:
    asked = options(__doc__, sets=200, seed=58, jobs=1)
    with ProcessPoolExecutor(asked.jobs) as pool:
        rows = [row for found in pool.map(intervals, repeat(asked.seed), range(asked.sets)) for row in found]
    table = pd.DataFrame(rows, columns=["kind", "holds", "width"])
    for kind, these in table.groupby("kind", sort=False):
        width = 100.0 * these.width.median()
        print(f"  {kind}: {these.holds.sum()} of {len(these)}, {width:.0f} % of what was possible wide")
    print(f"  intervals of {100 * LEVEL:.0f} % that hold the truth: {share(table.holds.sum(), len(table))}")
    good = tell(f"share of {len(table)} stated intervals that hold the truth", table.holds.mean(), ">=", 0.90)
    return 0 if good & tell("and at most", table.holds.mean(), "<=", 0.99) else 1


if __name__ == "__main__":
    sys.exit(main())
