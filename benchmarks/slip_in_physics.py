"""The slip simulator against MuJoCo: do the same contacts slip, and do the objects end at the same poses?

Run `python benchmarks/slip_in_physics.py [--chains 120] [--pushes 6] [--first 1] [--jobs 1]`; prints every
figure next to what is wanted and exits 1 if one is missed. Chains are those of `random_chains.py` with
contact friction from 0.06 to 0.48, every fourth is a tree; of the pushes of a chain a third each is stable,
unstable, and near the boundary. They go 0.1 to 0.4 of the chain's length. MuJoCo moves so slowly that inertia
does not matter (v^2 / (mu g L) = 1e-5), and its friction takes hold so slowly that sliding faces are not
lifted off (`SLIPPING`).
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from random_chains import random_chain, random_tree, tell

from pushplan.bench.store import Machine
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain
from pushplan.sets.named import stable_set
from pushplan.sim.physics.engine import engine
from pushplan.sim.report import ContactReport
from pushplan.sim.slip import simulate_poses
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "harada2006"))
from agreement import sample_pushes
from pushes import SLIPPING, SLIPPING_STEP, simulate_twist

FRICTION = 0.6
"""Factor of the contact friction of the chains."""
DECIDED = 0.01
"""Margins nearer to 0 say nothing: the end of a segment is an unstable equilibrium."""
STEP = 5e-4
SIMULTANEOUS = 0.01
"""Share of the push within which two contacts begin to slip at the same time."""


def experiment(seed: int, pushes: int) -> list[list[float]]:
    """Return for each push: seed, number, objects, margin, held here, held in MuJoCo, same first, mm, deg."""
    rng = np.random.default_rng(seed)
    chain = random_tree(rng) if seed % 4 == 3 else random_chain(rng)
    chain = World.from_chain(chain).with_contact_friction(FRICTION).chain
    stable = stable_set(chain)
    twists = sample_pushes(stable, pushes, rng)
    rows = []
    for k, (twist, margin) in enumerate(zip(twists, stable.margin(twists), strict=True)):
        travel = float(rng.uniform(0.1, 0.4)) * chain.characteristic_length
        mine = slide(chain, twist, travel)
        physics = simulate_twist(chain, twist, travel, SLIPPING, SLIPPING_STEP)
        off = mine.objects[-1] - physics.objects[-1]
        away = 1e3 * float(np.hypot(off[:, 0], off[:, 1]).max())
        turn = float(np.degrees(np.abs(se2.wrap_angle(off[:, 2])).max()))
        rows.append(
            [seed, k, len(chain.objects), margin, mine.kept, physics.kept, same_first(mine, physics), away, turn]
        )
    return rows


def slide(chain: Chain, twist: FloatArray, travel: float) -> ContactReport:
    """Push with a constant twist."""
    rate = np.hypot(np.hypot(twist[0], twist[1]), chain.characteristic_length * twist[2])
    way = np.linspace(0.0, travel / rate, int(np.ceil(travel / STEP)) + 1)
    return simulate_poses(way / way[-1], se2.exp(twist * way[:, None]), World.from_chain(chain))


def same_first(mine: ContactReport, physics: ContactReport) -> bool:
    """Return whether the first slipping contact in MuJoCo is also the first here, or slips at the same time."""
    if mine.loss is None or physics.kept:
        return False
    first = int(np.argmin(physics.moved_at))
    over = mine.moved[:, first]
    return bool(over.any()) and float(mine.t[over.argmax()]) <= mine.loss.time + SIMULTANEOUS


def show(rows: FloatArray, seconds: float) -> bool:
    """Print the counts; return whether all targets are met."""
    margin, mine, physics, first = rows[:, 3], rows[:, 4] > 0.0, rows[:, 5] > 0.0, rows[:, 6] > 0.0
    decided, slips = np.abs(margin) > DECIDED, ~mine & ~physics
    print(
        f"{len(rows)} pushes, {slips.sum()} slip in both, {decided.sum()} with |margin| > {DECIDED}; {seconds:.0f} s"
    )
    for count in range(1, 5):
        here = slips & (rows[:, 2] == count)
        print(
            f"  {count} objects: {here.sum()} slip, median {np.median(rows[here, 7]):.3f} mm"
        ) if here.any() else None
    here = slips & (rows[:, 0] % 4 == 3)
    p50, p90 = np.percentile(rows[here, 7], [50, 90])
    print(f"  trees: {here.sum()} slip, median {p50:.3f} mm, p90 {p90:.3f} mm")
    good = tell("slipping pushes", float(slips.sum()), ">=", 300.0)
    for name, column in (("mm", 7), ("deg", 8)):
        p50, p90 = np.percentile(rows[slips, column], [50, 90])
        good &= tell(f"final poses of slipping pushes, median ({name})", float(p50), "<=", 0.2)
        good &= tell(f"final poses of slipping pushes, p90 ({name})", float(p90), "<=", 1.0)
    good &= tell("held or slipped agrees, decided", float((mine == physics)[decided].mean()), ">=", 0.99)
    return good & tell("first contact to slip agrees, decided", float(first[slips & decided].mean()), ">=", 0.98)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--chains", type=int, default=120)
    parser.add_argument("--pushes", type=int, default=6)
    parser.add_argument("--first", type=int, default=1, help="seed of the first chain")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--worst", type=int, default=0, help="print so many of the largest differences")
    arguments = parser.parse_args()
    print(f"{Machine.this().words}, MuJoCo {engine().__version__}")
    began = time.perf_counter()
    seeds = range(arguments.first, arguments.first + arguments.chains)
    with ProcessPoolExecutor(arguments.jobs, mp_context=get_context("spawn")) as pool:
        found = pool.map(experiment, seeds, [arguments.pushes] * len(seeds))
        rows = np.array([row for rows in found for row in rows], dtype=np.float64)
    for row in rows[np.argsort(-rows[:, 7])][: arguments.worst]:
        print(row.round(4).tolist())
    return 0 if show(rows, time.perf_counter() - began) else 1


if __name__ == "__main__":
    sys.exit(main())
