"""Intervals of friction and loads against the truth, on simulated pushes with noise.

Run `python benchmarks/identify.py [--cases 200] [--first 1] [--forces]`; prints every figure next to what is wanted
and exits 1 if one is missed. Each case is a plate and one box or two, uniform or on four feet, whose friction and
loads are drawn evenly from everything that identification takes for possible; the plate pushes them twice by 12 cm
along random arcs, and the poses of the objects are measured with an error of 1 mm and 0.3 deg. With `--forces` the
wrench of the plate is measured, too, to 5 % of the objects' stated floor friction, and the size of floor friction
is unknown.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import defaultdict

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads only wait for one another

import numpy as np
from slip_solver import box, tell

from pushplan.bench.processes.machine import Machine
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.support import FeetSupport, UniformSupport
from pushplan.sim.identify.course import Course
from pushplan.sim.identify.identification import Identification
from pushplan.sim.identify.identify import identify_courses
from pushplan.sim.identify.unknowns import Unknowns
from pushplan.sim.slip.executed import at_poses
from pushplan.sim.slip.settings import SlipSettings
from pushplan.sim.slip.simulate import simulate_poses
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray

NOISE = np.array([1e-3, 1e-3, np.radians(0.3)])
WRENCH_NOISE = 0.05 * np.array([1.0, 1.0, 0.05])
"""Of a force (N) and torque (N m) over the stated floor friction, N."""
WAY, POSES, PUSHES = 0.12, 61, 2


def chain_of(rng: np.random.Generator) -> Chain:
    """One box or two in a row, on the whole face or on four feet."""
    objects, contacts, x, rear = [], [], 0.0, 0.1
    for i in range(int(rng.integers(1, 3))):
        depth, width = rng.uniform(0.06, 0.12, 2)
        outline = box(depth, width)
        feet = FeetSupport(0.9 * outline, np.full(4, 0.25))
        support = feet if rng.random() < 0.5 else UniformSupport(outline)
        place = np.array([x + depth / 2, 0.0, 0.0])
        objects.append(PushedObject(f"box {i + 1}", outline, 1.0, 0.3, support, place))
        half = min(rear, 0.5 * width)
        contacts.append(Contact(np.array([x, -half]), np.array([x, half]), 0.3, i, i - 1))
        x, rear = x + depth, 0.5 * width
    plate = np.array([[-0.03, -0.1], [0.0, -0.1], [0.0, 0.1], [-0.03, 0.1]])
    return Chain(tuple(objects), tuple(contacts), Pusher(plate, 0.3))


def pushed(world: World, rng: np.random.Generator, name: str, floor: float | None) -> Course:
    """What is measured of a push along a random arc; with a floor friction (N) wrenches, too."""
    direction, turn = rng.uniform(-0.9, 0.9), rng.uniform(-6.0, 6.0)
    twist = np.array([np.cos(direction), np.sin(direction), turn]) * WAY
    shares = np.linspace(0.0, 1.0, 4 * (POSES - 1) + 1)
    plate = se2.compose(world.start, se2.exp(shares[:, None] * twist))
    report = simulate_poses(shares, plate, world, SlipSettings(step=WAY))
    measured = report.object_poses[::4] + NOISE * rng.standard_normal(report.object_poses[::4].shape)
    if floor is None:
        return Course(report.poses[::4], measured, name)
    wrenches = at_poses(report.wrenches)[::4]
    wrenches += floor * WRENCH_NOISE * rng.standard_normal(wrenches.shape)
    return Course(report.poses[::4], measured, name, wrenches)


def case(seed: int, forces: bool) -> tuple[FloatArray, Identification]:
    """Return the true values of one case, and what is found."""
    rng = np.random.default_rng([19, seed])
    stated = World.from_chain(chain_of(rng))
    floor = sum(obj.friction_load for obj in stated.chain.objects) if forces else None
    unknowns = Unknowns.from_world(stated, absolute=forces)
    truth = unknowns.values(rng.uniform(size=len(unknowns.each)))
    world = unknowns.world_for(truth)
    courses: list[Course] = []
    while len(courses) < PUSHES:
        course = pushed(world, rng, f"push {len(courses)}", floor)
        if len(course.plate_poses) == POSES:
            courses.append(course)
    return truth, identify_courses(stated, courses, seed=seed, jobs=1)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=1, help="seed of the first case")
    parser.add_argument("--forces", action="store_true", help="measure the plate's wrench, too")
    arguments = parser.parse_args()
    print(Machine.this().words)
    inside: dict[str, list[bool]] = defaultdict(list)
    told: dict[str, list[bool]] = defaultdict(list)
    lengths: dict[str, list[float]] = defaultdict(list)
    for seed in range(arguments.first, arguments.first + arguments.cases):
        truth, found = case(seed, arguments.forces)
        for value, estimate in zip(truth, found.estimates, strict=True):
            kind = estimate.unknown.kind
            inside[kind].append(estimate.low <= value <= estimate.high)
            told[kind].append(estimate.determined)
            lengths[kind].append(estimate.high - estimate.low)
        if (seed - arguments.first) % 10 == 9:
            print(f"  {seed - arguments.first + 1} cases", flush=True)
    good = True
    for kind, hits in inside.items():
        determined = np.array(told[kind])
        long = np.median(np.array(lengths[kind])[determined]) if determined.any() else np.nan
        print(f"  {kind}: {len(hits)}, determined {100 * determined.mean():.0f} %, these {long:.3f} long")
        good &= within(kind, hits)
    good &= within("all", [hit for hits in inside.values() for hit in hits])
    return 0 if good else 1


def within(what: str, hits: list[bool]) -> bool:
    """Tell whether as many intervals hold the truth as they say."""
    share, name = 100.0 * float(np.mean(hits)), f"{what}: intervals that hold the truth (%)"
    return tell(name, share, ">=", 85.0) & tell(name, share, "<=", 95.0)


if __name__ == "__main__":
    sys.exit(main())
