"""Random pushes of random chains: predicted by the conditions on the exact friction wrench, simulated in MuJoCo.

Run `python benchmarks/physics_agreement.py [--chains 120] [--pushes 12] [--first 1]`; prints counts and exits 1 if
predictions that are clear of the boundary are wrong more often than promised. Of the pushes of a chain a third is
stable, one unstable, and one within 3 degrees of the boundary on the sphere of twists.
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import reduce

import numpy as np

from pushplan.bench.processes.machine import Machine
from pushplan.geometry.se2 import compose, transform_points
from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.support import FeetSupport, Support, UniformSupport
from pushplan.sets.named import stable_set
from pushplan.sim.physics.agreement import Agreement, compare
from pushplan.sim.physics.model.engine import engine
from pushplan.sim.physics.pushes import sample_pushes
from pushplan.util.arrays import BoolArray, FloatArray

BAND = np.radians(0.5), 0.02
"""Predictions at least so far from the boundary (angle, share of a segment) have to be right in 99 % of cases."""
SAFE_BAND = np.radians(0.1), 0.005
"""No push that is predicted stable and so far inside may move."""
AGREEMENT = 0.99
PLATE = np.array([[-0.03, -0.08], [0.0, -0.08], [0.0, 0.08], [-0.03, 0.08]])


def random_chain(rng: np.random.Generator) -> Chain:
    """One to four quadrilaterals, each with its rear edge somewhere on the front edge of the one before."""
    objects: list[PushedObject] = []
    contacts: list[Contact] = []
    line, half = np.zeros(3), 0.08
    for i in range(int(rng.integers(1, 5))):
        outline, lean = random_outline(rng)
        rear = float(outline[3, 1])
        offset = float(rng.uniform(-0.6, 0.6)) * min(rear, half)
        pose = compose(line, np.array([0.0, offset, 0.0]))
        ends = transform_points(line, [[0.0, max(-half, offset - rear)], [0.0, min(half, offset + rear)]])
        contacts.append(Contact(ends[0], ends[1], float(rng.uniform(0.1, 0.8)), i, i - 1))
        mass, floor_friction = float(rng.uniform(0.3, 3.0)), float(rng.uniform(0.1, 0.7))
        objects.append(
            PushedObject(f"object{i}", outline, mass, floor_friction, random_support(rng, outline), pose)
        )
        line = compose(pose, np.append(outline[1:3].mean(axis=0), lean))
        half = 0.5 * float(np.linalg.norm(outline[2] - outline[1]))
    return Chain(tuple(objects), tuple(contacts), Pusher(PLATE, contacts[0].friction))


def random_outline(rng: np.random.Generator) -> tuple[FloatArray, float]:
    """A quadrilateral (4, 2) with its rear edge on x = 0, and the direction of the normal of its front edge, rad."""
    rear, front = rng.uniform(0.03, 0.06, 2)
    depth, shift, lean = rng.uniform(0.04, 0.1), rng.uniform(-0.02, 0.02), rng.uniform(-0.3, 0.3)
    y = shift + np.array([-front, front])
    x = depth - np.tan(lean) * y
    return np.array([[0.0, -rear], [x[0], y[0]], [x[1], y[1]], [0.0, rear]]), float(lean)


def random_support(rng: np.random.Generator, outline: FloatArray) -> Support:
    """Even pressure, or three to six feet with random loads."""
    if rng.random() < 0.5:
        return UniformSupport(outline)
    count = int(rng.integers(3, 7))
    positions = rng.dirichlet(np.ones(4), count) @ outline
    return FeetSupport(positions, rng.dirichlet(np.full(count, 3.0)))


def experiment(seed: int, pushes: int) -> Agreement:
    rng = np.random.default_rng(seed)
    chain = random_chain(rng)
    return compare(chain, sample_pushes(stable_set(chain), pushes, rng))


def show(result: Agreement) -> bool:
    """Print the counts; tell whether the promises hold."""
    (held, lost), (stuck, moved) = result.confusion()
    print(f"{'':20}{'held':>8}{'moved':>8}")
    print(f"{'predicted stable':20}{held:8}{lost:8}")
    print(f"{'predicted unstable':20}{stuck:8}{moved:8}")
    band, safe = result.depth(*BAND), result.depth(*SAFE_BAND)
    wrong, clear, inside = ~result.agreed, np.abs(band) > 1.0, safe > 1.0
    broken = inside & ~result.kept
    print(f"agreement of all {len(wrong)} pushes: {share(~wrong)}")
    print(f"  outside 0.5 deg / 0.02: {share(~wrong[clear])} of {clear.sum()}")
    print(f"  and COR not under an object: {share(~wrong[clear & ~result.footprint])}")
    if wrong.any():
        print(f"  farthest wrong one: {np.abs(band[wrong]).max():.2f} of that band from the boundary")
    print(f"predicted stable by more than 0.1 deg / 0.005: {inside.sum()}, of these moved: {broken.sum()}")
    print(f"  largest displacement: {result.displacement[inside].max():.1e} of a segment")
    return float((~wrong[clear]).mean()) >= AGREEMENT and not broken.any()


def share(right: BoolArray) -> str:
    return f"{100.0 * right.mean():.2f} %"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--chains", type=int, default=120)
    parser.add_argument("--pushes", type=int, default=12)
    parser.add_argument("--first", type=int, default=1, help="seed of the first chain")
    arguments = parser.parse_args()
    print(f"{Machine.this().words}, MuJoCo {engine().__version__}")
    began = time.perf_counter()
    seeds = range(arguments.first, arguments.first + arguments.chains)
    results = [experiment(seed, arguments.pushes) for seed in seeds]
    kept = show(reduce(Agreement.joined, results))
    print(f"{time.perf_counter() - began:.0f} s")
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
