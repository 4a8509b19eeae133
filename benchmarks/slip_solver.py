"""The slip simulator's solver on random pushes: residuals, drift, step length, jams, speed.

Run `python benchmarks/slip_solver.py [--steps 1000000] [--first 1]`; prints every figure next to what is
wanted and exits 1 if one is missed. Chains are those of `physics_agreement.py` (one to four quadrilaterals in
partial and slanted contact, even pressure or three to six feet, contact friction 0.1 to 0.8), and every
fourth is a tree; pushes go 10 cm in steps of 1 mm.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace

import numpy as np
from physics_agreement import PLATE, random_chain

from pushplan.bench.processes.machine import Machine
from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain, Contact, PushedObject, Pusher
from pushplan.mechanics.support import FeetSupport
from pushplan.scenario.parts import PolygonObstacle
from pushplan.sim.slip.kernels.state import FALLBACK, JAMMED, UNSOLVED
from pushplan.sim.slip.settings import SlipSettings
from pushplan.sim.slip.simulator import SlipSimulator
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray

WAY = 0.1
"""How far the plate goes, m."""


def box(length: float, width: float) -> FloatArray:
    return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * [0.5 * length, 0.5 * width]


def on_feet(name: str, outline: FloatArray, mass: float, pose: FloatArray) -> PushedObject:
    return PushedObject(name, outline, mass, 0.3, FeetSupport(0.9 * outline, np.full(4, 0.25)), pose)


def random_tree(rng: np.random.Generator) -> Chain:
    """A wide box with two stacks on it, of one and of one or two boxes."""
    friction = rng.uniform(0.1, 0.5, 4)
    depth = rng.uniform(0.05, 0.1, 4)
    left, right = rng.uniform(0.025, 0.055, 2)
    places = [
        [depth[0] / 2, 0.0, 0.0],
        [depth[0] + depth[1] / 2, left + 0.005, 0.0],
        [depth[0] + depth[2] / 2, -right, 0.0],
    ]
    widths = [0.16, 2.0 * left, 2.0 * right - 0.01]
    pushers = [-1, 0, 0]
    if rng.random() < 0.5:
        places.append([depth[0] + depth[1] + depth[3] / 2, left + 0.005, 0.0])
        widths.append(2.0 * left)
        pushers.append(1)
    objects, contacts = [], []
    for i, (place, width, pusher) in enumerate(zip(places, widths, pushers, strict=True)):
        mass = float(rng.uniform(0.3, 3.0))
        objects.append(on_feet(f"object{i}", box(depth[i], width), mass, np.array(place)))
        x, y = place[0] - depth[i] / 2, place[1]
        ends = np.array([[x, y - width / 2], [x, y + width / 2]])
        contacts.append(Contact(ends[0], ends[1], float(friction[i]), i, pusher))
    return Chain(tuple(objects), tuple(contacts), Pusher(PLATE, contacts[0].friction))


def random_twist(rng: np.random.Generator, chain: Chain) -> FloatArray:
    """A unit twist that pushes forward."""
    twist = rng.normal(size=3)
    twist[0] = abs(twist[0])
    return twist / np.linalg.norm(twist) / np.array([1.0, 1.0, chain.characteristic_length])


def random_steps(steps: int, first: int) -> bool:
    """Count how steps of random pushes end; tell whether that is as wanted."""
    done = fallback = jams = unsolved = switched = seed = 0
    residuals: list[FloatArray] = []
    finite = True
    while done < steps:
        rng = np.random.default_rng(first + seed)
        chain = random_tree(rng) if seed % 4 == 3 else random_chain(rng)
        world = World.from_chain(chain)
        simulator = SlipSimulator(world)
        for _ in range(10):
            simulator.place(world.object_poses, world.start)
            trace = simulator.follow(np.tile(random_twist(rng, chain) * 1e-3, (round(WAY / 1e-3), 1)))
            finite = finite and bool(np.isfinite(trace.poses).all() and np.isfinite(trace.forces).all())
            moved = (trace.end != JAMMED) & (trace.end != UNSOLVED)
            residuals.append(trace.residual[moved])
            done += len(trace.end)
            fallback += int((trace.end == FALLBACK).sum())
            jams += int((trace.end == JAMMED).sum())
            unsolved += int((trace.end == UNSOLVED).sum())
            switched += int(trace.switched.sum())
        seed += 1
    residual = np.concatenate(residuals)
    print(
        f"{done} steps of {10 * seed} pushes: {100.0 * fallback / done:.2f} % with the fallback, {switched} jumps"
    )
    print(f"  stopped, and told: {jams} jams, {unsolved} without a solution that was found")
    good = tell("finite", 1.0 * finite, "=", 1.0)
    good &= tell("largest residual of a step that moved", float(residual.max()), "<=", 1e-4)
    return good & tell("share of steps with residual <= 1e-7", float((residual <= 1e-7).mean()), ">=", 0.995)


def drift() -> bool:
    """Push what sticks round a circle of 3 m radius, at any step length."""
    world = World.from_chain(boxes(3))
    worst = 0.0
    for step in (1e-3, 5e-3, 2e-2, 1e-1):
        simulator = SlipSimulator(world, settings=SlipSettings(step=step))
        trace = simulator.move([0.1, 0.0, 0.1 / 3.0], 20.0)
        assert (trace.modes == 1).all()
        places = np.array([obj.pose_chain for obj in world.chain.objects])
        off = simulator.object_poses - se2.compose(simulator.plate_pose, places)
        worst = max(worst, float(np.abs(off).max()))
    return tell("drift of what sticks over 2 m, steps of 1 to 100 mm (m)", worst, "<", 1e-9)


def boxes(count: int) -> Chain:
    """Equal boxes of 10 cm in a row, on four feet each."""
    objects, contacts = [], []
    for i in range(count):
        objects.append(on_feet(f"box{i}", box(0.1, 0.1), 1.0, np.array([0.05 + 0.1 * i, 0.0, 0.0])))
        contacts.append(Contact(np.array([0.1 * i, -0.05]), np.array([0.1 * i, 0.05]), 0.3, i, i - 1))
    return Chain(tuple(objects), tuple(contacts), Pusher(PLATE, 0.3))


def step_length(first: int) -> bool:
    """Compare slipping pushes in steps of 5 mm with steps of 0.25 mm."""
    changes = []
    for seed in range(first, first + 120):
        rng = np.random.default_rng(seed)
        chain = random_chain(rng)
        world = World.from_chain(chain).with_contact_friction(0.5)
        twist = random_twist(rng, chain)
        ends = []
        for step in (2.5e-4, 5e-3):
            simulator = SlipSimulator(world)
            trace = simulator.follow(np.tile(twist * step, (round(WAY / step), 1)))
            ends.append((simulator.object_poses, (trace.modes != 1).any() and not simulator.jammed))
        (fine, slips), (coarse, _) = ends
        if slips:
            changes.append(float(np.hypot(*(fine - coarse)[:, :2].T).max()))
    print(f"{len(changes)} slipping pushes of {100 * WAY:.0f} cm in steps of 5 mm against 0.25 mm:")
    print(f"  median {1e3 * np.median(changes):.3f} mm")
    return tell(
        "p95 of the largest change of an object (mm)", 1e3 * float(np.percentile(changes, 95)), "<", 0.6
    )


def jams() -> bool:
    """Drive boxes into walls square on: every one has to be told."""
    told = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        angle, gap = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, 0.05)
        wall = np.array([[0.1 + gap, -0.3], [0.2 + gap, -0.3], [0.2 + gap, 0.3], [0.1 + gap, 0.3]])
        start = np.array([0.0, 0.0, angle])
        world = replace(
            World.from_chain(boxes(1), start), obstacles=(PolygonObstacle(se2.transform_points(start, wall)),)
        )
        simulator = SlipSimulator(world)
        trace = simulator.move([0.1, 0.0, 0.0], 1.0)
        told += simulator.jammed and abs(1e-3 * (len(trace.end) - 1) - gap) < 2e-3
    return tell("of 100 boxes driven into walls, jams told in the right place", float(told), "=", 100.0)


def speed() -> bool:
    """Pushes and plans a second of CPU time, compiled before."""
    good = True
    for count, wanted in ((1, 3000.0), (3, 800.0)):
        world = World.from_chain(boxes(count))
        simulator = SlipSimulator(world)
        rng = np.random.default_rng(1)
        twists = [np.tile(random_twist(rng, world.chain) * 1e-3, (100, 1)) for _ in range(1000)]
        begin, steps = time.process_time(), 0
        for motions in twists:
            simulator.place(world.object_poses, world.start)
            steps += len(simulator.follow(motions).end)
        seconds = time.process_time() - begin
        print(f"{count} on four feet: {1e6 * seconds / steps:.2f} us a step")
        good &= tell(f"pushes of 10 cm a second, objects: {count}", 1000.0 / seconds, ">=", wanted)
    simulator = SlipSimulator(World.from_chain(boxes(3)))
    plan = np.concatenate(
        [np.tile([1e-3, 0.0, turn], (100, 1)) for turn in np.tile([4e-4, 0.0, -3e-4, 2e-4, 0.0], 2)]
    )
    begin = time.process_time()
    for _ in range(100):
        simulator.place(simulator.world.object_poses, simulator.world.start)
        kept = (simulator.follow(plan).modes == 1).all()
    assert kept
    return good & tell(
        "plans of 1000 steps a second, three objects", 100.0 / (time.process_time() - begin), ">=", 100.0
    )


def tell(what: str, value: float, relation: str, wanted: float) -> bool:
    """Print a figure next to what is wanted; tell whether it is met."""
    met = {"<": value < wanted, "<=": value <= wanted, "=": value == wanted, ">=": value >= wanted}[relation]
    print(f"{'ok  ' if met else 'MISS'} {what}: {value:.4g} (wanted {relation} {wanted:g})")
    return met


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--first", type=int, default=1, help="seed of the first chain")
    arguments = parser.parse_args()
    print(Machine.this().words)
    SlipSimulator(World.from_chain(boxes(1))).move([0.1, 0.0, 0.0], 0.01)  # compiles
    good = speed() & drift() & jams() & step_length(arguments.first)
    return 0 if random_steps(arguments.steps, arguments.first) & good else 1


if __name__ == "__main__":
    sys.exit(main())
