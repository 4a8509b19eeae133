"""Do plans hold in a physics engine, at their own speed, with full inertia, also in worlds with errors?

Run `python benchmarks/plans_in_physics.py [--problems 40] [--scenarios two-crates ...] [--jobs 2]`. Every packaged
scenario and random problems, all on four feet an object with known loads (`on_feet.py`), are planned with each of
`SETTINGS` and executed in MuJoCo: as stated, and in each of eight worlds that differ from what the plan believes
(`perturbed`). Prints a Markdown table; exits 1 when a plan fails in the world as stated.

`--trials SEED` asks instead whether `pushplan trial` tells the truth: ten plans, ten samples each, and whether the
contacts hold in MuJoCo in the same samples. Contact friction is off by up to 40 %, floor friction and load by 20 %.

A contact is lost when it slides or opens by more than a thousandth of its segment. An object that starts turned
touches with a corner only: slides and gaps count from the moment on in which all contacts are closed (to a tenth of
that); contacts that never close are lost.
"""

from __future__ import annotations

import argparse
import sys
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np
import yaml
from corner_places import shifted_places, turned_places
from on_feet import on_feet
from random_chains import tell

from pushplan.bench.random_problems import DRIVES, generate
from pushplan.bench.schema import ProblemParameters
from pushplan.bench.store import Machine
from pushplan.errors import PushplanError
from pushplan.geometry.se2 import compose
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.dynamics import dynamic_margins
from pushplan.mechanics.perturb import with_contact_friction, with_floor_friction, with_leaning_load
from pushplan.planner import plan
from pushplan.plans.plan import Plan
from pushplan.plans.robustness import TrialUncertainty
from pushplan.scenario.file import example_names, example_text, scenario_from_document
from pushplan.sim.physics.engine import engine
from pushplan.sim.physics.simulate import simulate_in_physics
from pushplan.sim.trials import execute_trials
from pushplan.slip.world import World
from pushplan.util.arrays import FloatArray

Document = dict[str, Any]

SETTINGS: dict[str, Document] = {
    "plain": {},
    "uncertainty": {"uncertainty": {"contact_friction": "20 %", "floor_friction": "20 %", "load": "10 %"}},
}
"""What is merged into every scenario: sections of a scenario file."""
EASY: Document = {
    "stability": {"margin": 0.0},
    "pusher": {"limits": {"contact": "quasi-static"}},
    "trajectory": "exact",
    "planner": {"cost": "travel", "arc_price": "2 mm"},
}
"""With these settings random problems have a path."""
PARAMETERS = ProblemParameters(objects=(1, 4), obstacles=(0, 10), room=0.8, drives=DRIVES)
STATED = "as stated"
POSITION, ANGLE = 2e-3, np.radians(0.5)
"""How far an object may end off the plan in the world as stated, m and rad."""
ASIDE, TURN = 1e-3, np.radians(0.5)
SAMPLES = 10
"""Of each plan, for `--trials`."""


def perturbed(name: str, chain: Chain) -> dict[str, tuple[Chain, FloatArray | None]]:
    """Return chains and how their objects stand off their places; which object, to which side, the name decides."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    low, high, aside, askew = rng.integers(0, len(chain.objects), 4)
    sides = rng.choice([-1.0, 1.0], 2)
    return {
        STATED: (chain, None),
        "contact x0.9": (with_contact_friction(chain, 0.9), None),
        "floor x0.8": (with_floor_friction(chain, 0.8, low), None),
        "floor x1.2": (with_floor_friction(chain, 1.2, high), None),
        "load left": (with_leaning_load(chain, (0.0, 1.0), 0.1), None),
        "load right": (with_leaning_load(chain, (0.0, -1.0), 0.1), None),
        "load front": (with_leaning_load(chain, (1.0, 0.0), 0.1), None),
        "1 mm off": (chain, shifted_places(chain, aside, sides[0] * ASIDE)),
        "0.5 deg off": (chain, turned_places(chain, askew, sides[1] * TURN)),
    }


def holds(made: Plan, chain: Chain, placed: FloatArray | None, at_goal: bool) -> bool:
    """Execute a plan; tell whether every contact held, and the objects end where they shall if that is asked."""
    there = replace(World.from_scenario(made.scenario), chain=chain)
    if placed is not None:
        there = there.with_object_poses(compose(compose(there.start, placed), there.chain.places))
    try:
        report = simulate_in_physics(made, there, until_moved=True)
    except PushplanError:
        return False
    arrived = bool((report.object_errors.max(axis=0) <= [POSITION, ANGLE]).all())
    return report.kept and (arrived or not at_goal)


def attempt(name: str, document: Document, setting: str) -> Document:
    """Plan a problem with a setting and execute the plan in all worlds."""
    try:
        chain = scenario_from_document(document).chain
        made = plan(scenario_from_document(merged(document, SETTINGS[setting])))
    except PushplanError:
        return {}
    if not made.solved or made.path is None:
        return {}
    worlds = perturbed(name, chain).items()
    kept = {what: holds(made, *world, what == STATED) for what, world in worlds}
    return {"arcs": len(made.path.lengths), "cost": made.path.cost, **kept}


def merged(document: Mapping[str, Any], added: Mapping[str, Any]) -> Document:
    """Return a document with the values of another added or replaced."""
    result = dict(document)
    for key, value in added.items():
        old = result.get(key)
        result[key] = merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return result


def problems(scenarios: Sequence[str], count: int) -> Iterator[tuple[str, Document]]:
    """Yield names and documents of packaged scenarios and of random problems."""
    for name in scenarios:
        yield name, on_feet(yaml.safe_load(example_text(name)))
    seed = found = 0
    while found < count:
        try:
            document = on_feet(yaml.safe_load(generate(PARAMETERS, seed)))
            if plan(scenario_from_document(merged(document, EASY)), first=True).solved:
                found += 1
                yield f"random {seed}", document
        except PushplanError:
            pass
        seed += 1


def row(setting: str, results: list[Document]) -> str:
    """Return a line of the table."""
    planned = [one for one in results if one]
    kept = {name: sum(one[name] for one in planned) for name in (planned or [{}])[0] if name not in ("arcs", "cost")}
    others = [count for name, count in kept.items() if name != STATED]
    share = 100.0 * sum(others) / max(len(planned) * len(others), 1)
    counts = " | ".join(f"{name}: {count}" for name, count in kept.items())
    arcs = sum(one["arcs"] for one in planned)
    return f"| {setting} | {len(planned)} of {len(results)} | {counts} | {share:.1f} % | {arcs} |"


def trials(names: Sequence[str], seed: int) -> int:
    """Compare the verdict of trials with the engine in the same samples, at the plan's own speed."""
    off = TrialUncertainty(contact_friction=0.4, floor_friction=0.2, load=0.2, position=1e-3, angle=np.radians(0.3))
    same, held, below, least, began = 0, 0, 0, np.inf, time.process_time()
    for name in names:
        found = plan(scenario_from_document(on_feet(yaml.safe_load(example_text(name)))), seed=seed, first=True)
        tried = execute_trials(found, SAMPLES, off, seed)
        agree = 0
        for end in tried.ends:
            world = tried.world(end.sample)
            kept = simulate_in_physics(found, world, until_moved=True).kept
            margin = _dynamic_margin(found, world)
            agree += kept == (not end.contact)
            if kept != (not end.contact):
                what = f"{'kept' if kept else 'lost'} in MuJoCo, {end.mode or 'held'} in the trial"
                print(f"    sample {end.sample}: {what}, dynamic margin {margin:.3f}")
            if not end.contact:
                held, below, least = held + 1, below + (margin < 0.0), min(least, margin)
        same += agree
        print(f"  {name:20} {agree} of {SAMPLES} alike, {SAMPLES - int(tried.lost.sum())} held", flush=True)
    count = SAMPLES * len(names)
    print(
        f"  {held} of {count} held, least dynamic margin {least:.3f}; {time.process_time() - began:.0f} s of CPU time"
    )
    good = tell(f"same verdict in MuJoCo, of {count}", same, ">=", 0.9 * count)
    return 0 if good & tell("held with a dynamic margin below 0", below, "=", 0) else 1


def _dynamic_margin(found: Plan, world: World) -> float:
    """Return the smallest margin with inertia in a world."""
    least = np.inf
    for segment in found.segments:
        if segment.pushes and segment.load is not None:
            own, chain = segment.contact_trajectory, world.pushed(segment.load.chain)
            least = min(least, float(dynamic_margins(chain, own.directions, own.rates_at(own.t)).min()))
    return least


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=40, help="number of random problems")
    parser.add_argument("--scenarios", nargs="*", default=example_names(), choices=example_names(), metavar="NAME")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--trials", type=int, metavar="SEED", help="seed of trials of ten plans, instead")
    given = parser.parse_args()
    if given.trials is not None:
        print(f"{Machine.this().words}, MuJoCo {engine().__version__}")
        return trials(given.scenarios[:10], given.trials)
    print(f"{Machine.this().words}, MuJoCo {engine().__version__}")
    print("| setting | planned | plans that keep every contact, by world | all eight | arcs |\n|---|---|---|---|---|")
    every, failed = [*problems(given.scenarios, given.problems)], 0
    found: dict[str, list[Document]] = {}
    with ProcessPoolExecutor(given.jobs, get_context("spawn")) as pool:
        for setting in SETTINGS:
            found[setting] = [*pool.map(attempt, *zip(*every, strict=True), [setting] * len(every))]
            print(row(setting, found[setting]), flush=True)
            for (name, _), one in zip(every, found[setting], strict=True):
                if one and not one[STATED]:
                    failed += 1
                    print(f"FAILED {name}, {setting}: not in the world as stated")
    pairs = [(a["cost"], b["cost"]) for a, b in zip(found["plain"], found["uncertainty"], strict=True) if a and b]
    if pairs:
        longer = np.median([b / a for a, b in pairs]) - 1.0
        print(f"plans with uncertainty are {100.0 * longer:.1f} % longer in the median")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
