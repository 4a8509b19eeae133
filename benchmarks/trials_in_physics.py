"""Trials with slip against the same worlds in MuJoCo: do as many plans arrive?

Run `python benchmarks/trials_in_physics.py [--scenario two-crates] [--worlds 100] [--jobs 1] [--uncertainty ...]`;
prints both rates of success with Wilson's 95 % intervals and exits 1 if one lies outside the other's interval. MuJoCo
follows the plan so slowly that inertia does not matter; it knows contacts of the chain only, so obstacles go.
The packaged scenario stands on four feet an object (`pushplan.bench.on_feet`): both have the same load on the floor.
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from multiprocessing import get_context

import numpy as np
import yaml

from pushplan.bench.on_feet import on_feet
from pushplan.bench.processes.machine import Machine
from pushplan.cli.steps.trial_words import uncertainty
from pushplan.plan import plan
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.file import example_text, scenario_from_document
from pushplan.scenario.model import Scenario
from pushplan.sim.physics.model.settings import SLIPPING
from pushplan.sim.physics.simulate import simulate_trajectory
from pushplan.sim.slip.report import SlipReport
from pushplan.sim.slip.simulate import simulate
from pushplan.sim.trials.uncertain import TrialUncertainty, sampled_world
from pushplan.util.arrays import FloatArray
from pushplan.util.wilson import wilson

OFF = "contact_friction=40%,floor_friction=20%,load=20%,position=1.5mm"
"""By default so much that about every second plan fails."""
SETTINGS = replace(SLIPPING, step=1e-4)


@cache
def planned(name: str) -> tuple[Scenario, Trajectory]:
    document = on_feet(yaml.safe_load(example_text(name)))
    scenario = replace(scenario_from_document(document), obstacles=(), workspace=None)
    found = plan(scenario, seed=1, first=True)
    assert found.trajectory is not None, found.reason
    return scenario, found.trajectory


def both(name: str, off: TrialUncertainty, sample: int) -> tuple[bool, bool, bool]:
    """Return whether a plan arrives, here and in MuJoCo, and whether every contact holds here."""
    scenario, trajectory = planned(name)
    world = sampled_world(scenario, off, np.random.default_rng([1, sample]))
    mine = simulate(trajectory, world)
    physics = simulate_trajectory(
        world.chain, trajectory, quasi_static=True, settings=SETTINGS, placed=motions(mine)
    )
    there = replace(mine, t=physics.t, poses=physics.poses, object_poses=physics.object_poses)
    return mine.arrived(scenario.goal), there.arrived(scenario.goal), mine.kept


def motions(report: SlipReport) -> FloatArray:
    """Return how the objects stand off their places (n, 3), as motions of the chain frame."""
    return np.asarray(report.motions[0, :-1])


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenario", default="two-crates")
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--uncertainty", type=uncertainty, default=uncertainty(OFF))
    arguments = parser.parse_args()
    print(f"{Machine.this().words}; {arguments.uncertainty.words}")
    began = time.perf_counter()
    names, offs = [arguments.scenario] * arguments.worlds, [arguments.uncertainty] * arguments.worlds
    with ProcessPoolExecutor(arguments.jobs, mp_context=get_context("spawn")) as pool:
        rows = np.array(list(pool.map(both, names, offs, range(arguments.worlds))))
    counts = rows.sum(axis=0)
    for who, arrived in (("here", counts[0]), ("MuJoCo", counts[1])):
        low, high = wilson(int(arrived), len(rows))
        print(f"{who:7} {arrived} of {len(rows)} arrive ({100 * low:.1f} to {100 * high:.1f} %)")
    print(f"every contact holds in {counts[2]}")
    same = int((rows[:, 0] == rows[:, 1]).sum())
    print(f"the same world by world in {same} of {len(rows)}; {time.perf_counter() - began:.0f} s")
    (low, high), (begin, end) = (wilson(int(counts[k]), len(rows)) for k in (0, 1))
    shares = counts / len(rows)
    agree = bool(begin <= shares[0] <= end and low <= shares[1] <= high)
    print(f"{'ok  ' if agree else 'MISS'} each rate lies in the other's interval")
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
