"""The slip simulator against MuJoCo: do the same contacts slip, and do the objects end at the same poses?

    python benchmarks/slip_in_physics.py [--chains 120] [--pushes 6] [--first 1] [--jobs 1]

Prints every figure with its target and exits 1 if one is missed. Chains are those of `random_chains.py` with contact
friction from 0.06 to 0.48; every fourth is a tree. A third of the pushes of a chain is stable, a third unstable, and
a third near the boundary; each goes 0.1 to 0.4 of the chain's length. MuJoCo moves so slowly that inertia does not
matter (v^2 / (mu g L) = 1e-5). Its friction starts so slowly that sliding faces are not lifted off (`SLIPPING`).
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from random_chains import random_chain, random_tree
from script import options, tell

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
COLUMNS = ["tree", "objects", "margin", "held", "held_there", "same_first", "mm", "deg"]


def experiment(seed: int, pushes: int) -> list[tuple[object, ...]]:
    """Return the `COLUMNS` of each push: held here and in MuJoCo, the same contact first, difference of the ends."""
    rng, tree = np.random.default_rng(seed), seed % 4 == 3
    chain = World.from_chain((random_tree if tree else random_chain)(rng)).with_contact_friction(FRICTION).chain
    stable = stable_set(chain)
    twists = sample_pushes(stable, pushes, rng)
    rows: list[tuple[object, ...]] = []
    for twist, margin in zip(twists, stable.margin(twists), strict=True):
        travel = float(rng.uniform(0.1, 0.4)) * chain.characteristic_length
        mine, physics = slide(chain, twist, travel), simulate_twist(chain, twist, travel, SLIPPING, SLIPPING_STEP)
        off = np.abs(se2.pose_errors(mine.objects[-1], physics.objects[-1])).max(axis=0)
        ends = 1e3 * off[0], np.degrees(off[1])
        held = mine.kept, physics.kept, same_first(mine, physics)
        rows.append((tree, len(chain.objects), margin, *held, *ends))
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
    over = mine.moved[:, int(np.argmin(physics.moved_at))]
    return bool(over.any()) and float(mine.t[over.argmax()]) <= mine.loss.time + SIMULTANEOUS


def show(rows: pd.DataFrame) -> bool:
    """Print the counts; return whether all targets are met."""
    decided = rows[rows.margin.abs() > DECIDED]
    slips = rows[~rows.held & ~rows.held_there]
    print(f"{len(rows)} pushes, {len(slips)} slip in both, {len(decided)} with |margin| > {DECIDED}")
    groups = {f"{count} objects": some for count, some in slips.groupby("objects")}
    for what, some in {"all": slips, "trees": slips[slips.tree], **groups}.items():
        p50, p90 = some[["mm", "deg"]].quantile([0.5, 0.9]).to_numpy().round(3)
        print(f"  {what}: {len(some)} slip, median {p50}, 90 % {p90} (mm, deg)")
    good = tell("slipping pushes", len(slips), ">=", 300)
    for name in ("mm", "deg"):
        good &= tell(f"final poses of slipping pushes, median ({name})", slips[name].median(), "<=", 0.2)
        good &= tell(f"final poses of slipping pushes, 90 % ({name})", slips[name].quantile(0.9), "<=", 1.0)
    good &= tell("held or slipped agrees, decided", (decided.held == decided.held_there).mean(), ">=", 0.99)
    first = slips[slips.margin.abs() > DECIDED].same_first
    return good & tell("first contact to slip agrees, decided", first.mean(), ">=", 0.98)


def main() -> int:
    asked = options(__doc__, chains=120, pushes=6, first=1, jobs=1)
    print(f"MuJoCo {engine().__version__}")
    seeds = range(asked.first, asked.first + asked.chains)
    with ProcessPoolExecutor(asked.jobs, mp_context=get_context("spawn")) as pool:
        rows = [row for found in pool.map(experiment, seeds, repeat(asked.pushes)) for row in found]
    return 0 if show(pd.DataFrame(rows, columns=COLUMNS)) else 1


if __name__ == "__main__":
    sys.exit(main())
