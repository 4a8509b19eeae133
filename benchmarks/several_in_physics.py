"""Do plans of several pushes bring objects home in a physics engine, also from places that were measured wrong?

    python benchmarks/several_in_physics.py [--plans 100] [--batches 30] [--boxes 2]

Random rooms (`pushplan.bench.random_problems`, with a robot beside the chain) of one box or a row of two, for all
drives. Every plan is executed in MuJoCo from the first transit to the last retreat, at full speed with all inertia,
and in the simulator of slipping contacts: as planned, and with the objects 2 mm and half a degree off their places at
first. A search ends after so many batches of poses, not seconds, so that a busy machine finds the same plans. Wanted:
objects at their goals within 5 mm and 1 degree, approach and retreat that move nothing by more than 1 mm where
everything is in its place, and contacts closed by the settling push where it is not.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from dataclasses import replace

import numpy as np

from pushplan.bench.random_problems.generator import generate
from pushplan.bench.random_problems.parameters import DRIVES, ProblemParameters
from pushplan.geometry import se2
from pushplan.plan import plan
from pushplan.plans.result import PlanResult
from pushplan.scenario.file import scenario_from_text
from pushplan.scenario.model import Scenario
from pushplan.several.modes import find_modes
from pushplan.several.physics import SeveralReport, execute_in_physics
from pushplan.sim.slip.simulate import simulate
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray

MOST_SECONDS = 120.0
POSITION, ANGLE = 5e-3, math.radians(1.0)
ASIDE, TURN = 2e-3, math.radians(0.5)
MOST_GAP = 5e-4
"""Gap below which a contact counts as closed, m."""
PARAMETERS = ProblemParameters(
    size=(0.1, 0.3), obstacles=(0, 8), workspace=(3.0, 4.0), drives=DRIVES, robot=(0.5, 1.5)
)


def main() -> None:
    """Print what became of the plans."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--plans", type=int, default=100)
    parser.add_argument("--batches", type=int, default=30)
    parser.add_argument("--boxes", type=int, default=2)
    args = parser.parse_args()
    counts: Counter[str] = Counter()
    worst: dict[str, float] = {}
    seed = 0
    while counts["plans"] < args.plans:
        seed += 1
        boxes = 1 + seed % args.boxes
        scenario = scenario_from_text(generate(_parameters(boxes), seed))
        found = plan(scenario, iterations=args.batches, time_limit=MOST_SECONDS)
        counts["problems"] += 1
        if not found.solved:
            print(f"room {seed}: {found.reason}", flush=True)
            continue
        counts["plans"] += 1
        counts["pushes"] += sum(segment.pushes for segment in found.segments)
        _execute(scenario, found, seed, counts, worst)
    _tell(counts, worst)


def _parameters(boxes: int) -> ProblemParameters:
    return replace(PARAMETERS, objects=(boxes, boxes))


def _execute(
    scenario: Scenario, found: PlanResult, seed: int, counts: Counter[str], worst: dict[str, float]
) -> None:
    """Execute a plan four times, and count what went right."""
    modes = find_modes(scenario)
    assert found.trajectory is not None
    for name, placed in (("in place", None), ("off", _placed(scenario, seed))):
        began = time.perf_counter()
        report = execute_in_physics(scenario, found.segments, found.trajectory, modes, placed=placed)
        counts["seconds"] += int(1e3 * (time.perf_counter() - began))
        good = report.reached(POSITION, ANGLE)
        counts[f"{name}: at goals"] += good
        counts[f"{name}: closed"] += all(push.gap <= MOST_GAP for push in report.pushes)
        counts[f"{name}: kept"] += report.kept
        _worsen(worst, name, report)
        slipped = _slipped(scenario, found, placed)
        counts[f"{name}: at goals where contacts slip"] += bool((slipped <= [POSITION, ANGLE]).all())
        if not good or (placed is None and not report.kept):
            errors = "; ".join(f"{1e3 * p:.1f} mm {math.degrees(a):.2f} deg" for p, a in report.errors)
            print(f"room {seed}, {name}: {errors}, clear {1e3 * report.clear:.1f} mm", flush=True)


def _placed(scenario: Scenario, seed: int) -> FloatArray:
    """How the load as a whole stands off its place (n, 3), turned about its middle, in its frame."""
    way, side = np.random.default_rng(seed).uniform(-np.pi, np.pi), 1.0 if seed % 2 else -1.0
    middle = np.append(np.mean([obj.pose_chain[:2] for obj in scenario.chain.objects], axis=0), 0.0)
    shift = [ASIDE * np.cos(way), ASIDE * np.sin(way), side * TURN]
    moved = se2.compose(se2.compose(middle, shift), se2.inverse(middle))
    return np.tile(moved, (len(scenario.chain.objects), 1))


def _slipped(scenario: Scenario, found: PlanResult, placed: FloatArray | None) -> FloatArray:
    """Errors (n, 2) in the simulator of slipping contacts, the whole trajectory in one go."""
    world, own = World.from_scenario(scenario), np.array([obj.pose_chain for obj in scenario.chain.objects])
    if placed is not None:
        world = world.with_object_poses(se2.compose(se2.compose(scenario.start, placed), own))
    assert found.trajectory is not None
    report = simulate(found.trajectory, world)
    wanted = se2.compose(found.segments[-1].load_after, own)
    return np.array([se2.pose_error(a, b) for a, b in zip(report.object_poses[-1], wanted, strict=True)])


def _worsen(worst: dict[str, float], name: str, report: SeveralReport) -> None:
    found = {
        "position, mm": 1e3 * report.errors[:, 0].max(),
        "angle, deg": math.degrees(report.errors[:, 1].max()),
        "moved in an approach, mm": 1e3 * max(push.approach for push in report.pushes),
        "moved in a retreat, mm": 1e3 * max(push.retreat for push in report.pushes),
        "gap after settling, mm": 1e3 * max(push.gap for push in report.pushes),
    }
    for what, value in found.items():
        worst[f"{name}: {what}"] = max(worst.get(f"{name}: {what}", 0.0), float(value))


def _tell(counts: Counter[str], worst: dict[str, float]) -> None:
    plans = counts["plans"]
    print(f"{plans} plans of {counts['problems']} rooms, {counts['pushes']} pushes")
    for name in ("in place", "off"):
        for what in ("at goals", "closed", "kept", "at goals where contacts slip"):
            print(f"  {name}: {counts[f'{name}: {what}']} of {plans} {what}")
    for what, value in worst.items():
        print(f"  most {what}: {value:.3g}")
    print(f"  {1e-3 * counts['seconds'] / (2 * plans):.2f} s each in the engine")


if __name__ == "__main__":
    main()
