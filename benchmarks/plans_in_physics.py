"""Do plans hold in a physics engine, at full speed with inertia, also in worlds with errors?

    python benchmarks/plans_in_physics.py [--problems 40] [--scenarios two-crates ...] [--jobs 2]

Every packaged scenario and random problems, all on four feet an object with known loads (`on_feet.py`), are planned
with each of `SETTINGS` and executed in MuJoCo: in the nominal world, and with each of eight model errors
(`perturbed`). Prints a Markdown table; exits 1 if a plan fails in the nominal world.

`--trials SEED` asks instead whether `pushplan trial` agrees with MuJoCo: ten plans, ten samples each. Contact
friction is off by up to 40 %, floor friction and load by 20 %.

A contact is lost if it slides or opens by more than a thousandth of its segment. An object that starts turned touches
with a corner only: slides and gaps count from the moment on in which all contacts are closed (to a tenth of that);
contacts that never close are lost.
"""

from __future__ import annotations

import sys
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace
from itertools import count, repeat
from multiprocessing import get_context
from typing import Any

import numpy as np
import pandas as pd
import yaml
from corner_places import shifted_places, turned_places
from on_feet import on_feet
from script import options, tell

from pushplan.bench.random_problems import DRIVES, generate
from pushplan.bench.schema import ProblemParameters
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
"""Sections of a scenario file that are merged into every scenario."""
EASY: Document = {
    "stability": {"margin": 0.0},
    "pusher": {"limits": {"contact": "quasi-static"}},
    "trajectory": "exact",
    "planner": {"cost": "travel", "arc_price": "2 mm"},
}
"""With these settings random problems have a path."""
PARAMETERS = ProblemParameters(objects=(1, 4), obstacles=(0, 10), room=0.8, drives=DRIVES)
WITHIN = (2e-3, np.radians(0.5))
"""Largest difference from the plan at the end in the nominal world, m and rad."""
ASIDE, TURN = 1e-3, np.radians(0.5)
SAMPLES = 10
"""Of each plan, for `--trials`."""


def perturbed(name: str, chain: Chain) -> dict[str, tuple[Chain, FloatArray | None]]:
    """Return chains with the offsets of their objects; the name decides which object is off, and to which side."""
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    low, high, aside, askew = rng.integers(0, len(chain.objects), 4)
    sides = rng.choice([-1.0, 1.0], 2)
    return {
        "nominal": (chain, None),
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
    """Return whether every contact holds in MuJoCo and, if that is required, the objects end as planned."""
    there = replace(World.from_scenario(made.scenario), chain=chain)
    if placed is not None:
        there = there.with_object_poses(compose(compose(there.start, placed), there.chain.places))
    try:
        report = simulate_in_physics(made, there, until_moved=True)
    except PushplanError:
        return False
    return report.kept and (not at_goal or bool((report.object_errors.max(axis=0) <= WITHIN).all()))


def attempt(name: str, document: Document, setting: str) -> Document:
    """Plan a problem with a setting and execute the plan in all worlds; the result is empty without a plan."""
    with suppress(PushplanError):
        chain = scenario_from_document(document).chain
        made = plan(scenario_from_document(merged(document, SETTINGS[setting])))
        if made.solved and made.path is not None:
            kept = {what: holds(made, *world, what == "nominal") for what, world in perturbed(name, chain).items()}
            return {**kept, "arcs": len(made.path.lengths), "cost": made.path.cost}
    return {}


def merged(document: Mapping[str, Any], added: Mapping[str, Any]) -> Document:
    """Return a document with the values of another added or replaced."""
    result = dict(document)
    for key, value in added.items():
        old = result.get(key)
        result[key] = merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return result


def problems(scenarios: Sequence[str], wanted: int) -> Iterator[tuple[str, Document]]:
    """Yield names and documents of packaged scenarios and of random problems."""
    for name in scenarios:
        yield name, on_feet(yaml.safe_load(example_text(name)))
    found = 0
    for seed in count():
        if found == wanted:
            return
        with suppress(PushplanError):
            document = on_feet(yaml.safe_load(generate(PARAMETERS, seed)))
            if plan(scenario_from_document(merged(document, EASY)), first=True).solved:
                found += 1
                yield f"random {seed}", document


def trials(names: Sequence[str], seed: int) -> int:
    """Compare trials with MuJoCo in the same samples, at the plan's own speed."""
    off = TrialUncertainty(contact_friction=0.4, floor_friction=0.2, load=0.2, position=1e-3, angle=np.radians(0.3))
    same, held = 0, list[float]()
    for name in names:
        found = plan(scenario_from_document(on_feet(yaml.safe_load(example_text(name)))), seed=seed, first=True)
        tried = execute_trials(found, SAMPLES, off, seed)
        for end in tried.ends:
            world = tried.world(end.sample)
            kept = simulate_in_physics(found, world, until_moved=True).kept
            margin = _dynamic_margin(found, world)
            same += kept == (not end.contact)
            if kept != (not end.contact):
                what = f"{'kept' if kept else 'lost'} in MuJoCo, {end.mode or 'held'} in the trial"
                print(f"  {name}, sample {end.sample}: {what}, dynamic margin {margin:.3f}", flush=True)
            held += [] if end.contact else [margin]
    total = SAMPLES * len(names)
    print(f"  {len(held)} of {total} held, least dynamic margin {min(held):.3f}")
    good = tell(f"same result in MuJoCo, of {total}", same, ">=", 0.9 * total)
    return 0 if good & tell("held with a dynamic margin below 0", sum(one < 0.0 for one in held), "<=", 0) else 1


def _dynamic_margin(found: Plan, world: World) -> float:
    """Return the smallest margin with inertia in a world."""
    least = np.inf
    for segment in found.segments:
        if segment.pushes and segment.load is not None:
            own, chain = segment.contact_trajectory, world.pushed(segment.load.chain)
            least = min(least, float(dynamic_margins(chain, own.directions, own.rates_at(own.t)).min()))
    return least


def main() -> int:
    asked = options(__doc__, problems=40, scenarios=tuple(example_names()), jobs=2, trials=int)
    print(f"MuJoCo {engine().__version__}")
    if asked.trials is not None:
        return trials(asked.scenarios[:10], asked.trials)
    names, documents = zip(*problems(asked.scenarios, asked.problems), strict=True)
    failed, costs = 0, []
    with ProcessPoolExecutor(asked.jobs, get_context("spawn")) as pool:
        for setting in SETTINGS:
            found = pd.DataFrame([*pool.map(attempt, names, documents, repeat(setting))], index=names)
            costs.append(found.pop("cost"))
            planned = found.dropna()
            kept = planned.drop(columns="arcs").astype(int)
            if setting == "plain":
                print(f"| setting | planned | {' | '.join(kept)} | all eight | arcs |\n|{'---|' * (len(kept.T) + 4)}")
            counts, share = " | ".join(map(str, kept.sum())), 100.0 * kept.iloc[:, 1:].to_numpy().mean()
            planned_of = f"{len(planned)} of {len(found)}"
            print(f"| {setting} | {planned_of} | {counts} | {share:.1f} % | {planned.arcs.sum():.0f} |", flush=True)
            lost = kept.index[kept.nominal == 0]
            failed += len(lost)
            for name in lost:
                print(f"FAILED {name}, {setting}: not in the nominal world")
    longer = 100.0 * ((costs[1] / costs[0]).median() - 1.0)
    print(f"plans with uncertainty are {longer:.1f} % longer in the median")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
