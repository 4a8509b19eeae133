"""Whether the stated robustness is true: just below it every margin stays positive, just above it one does not.

Run `python benchmarks/robustness.py [--plans 500]`: a quarter of an hour of CPU. Random chains on known loads of
all kinds, a third of them pushed above the floor; every tenth motion is a plan, the others are random stable twists,
exact or blended. The chains that are off are built anew from changed objects (`tests/perturbed.py`) and asked at
every sample by `dynamic_margins`. Where a robustness is the largest change that is looked at, nothing above is asked.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import numpy as np

from pushplan.plan import plan
from pushplan.plans.robustness import MOST_ANGLE, MOST_SHARE, Robustness
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.sim.robustness import robustness_of

REPORT = 50
"""Motions after which the table so far is printed."""

PLANNED = 10
"""One motion in so many is a plan."""

MOST = {
    "contact_friction": 1.0,
    "floor_friction": MOST_SHARE,
    "load": MOST_SHARE,
    "position": np.inf,
    "angle": MOST_ANGLE,
}
"""Largest change of each kind that is looked at; of the contact friction 1 - factor."""


def _loaded() -> ModuleType:
    path = Path(__file__).parents[1] / "tests" / "perturbed.py"
    spec = importlib.util.spec_from_file_location("perturbed", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


perturbed = _loaded()


@dataclass
class Tally:
    """What came out.

    Attributes:
        counts: By kind and word: `asked below`, `held`, `asked above`, `lost`.
        cpu: CPU of each robustness per second of motion, ms.
        whole: CPU of each robustness, ms.
        used_up: Motions that hold nothing, since a contact is lost as stated.
    """

    counts: dict[str, Counter[str]] = field(default_factory=lambda: {kind: Counter() for kind in MOST})
    cpu: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    used_up: int = 0

    def take(self, scenario: Scenario, trajectory: Trajectory, seed: int) -> bool:
        """Count one motion; tell what is not true."""
        begin = time.process_time()
        robustness = robustness_of(scenario.chain, trajectory)
        spent = 1e3 * (time.process_time() - begin)
        if robustness.used_up:
            assert perturbed.least_margin(scenario.chain, trajectory) <= 0.0
            self.used_up += 1
            return False
        self.whole.append(spent)
        self.cpu.append(spent / trajectory.duration)
        for kind in MOST:
            self._ask(scenario, trajectory, robustness, kind, seed)
        return True

    def tell(self, taken: int, planned: int) -> None:
        """Print what came out of `taken` motions, `planned` of them plans."""
        print(f"\n{taken} motions, {planned} of them plans; {self.used_up} more hold nothing as stated")
        print("| kind | holds at 0.98 | of | lost at 1.02 | of |\n|---|---|---|---|---|")
        for kind, c in self.counts.items():
            print(f"| {kind} | {c['held']} | {c['asked below']} | {c['lost']} | {c['asked above']} |")
        print(
            f"CPU of a robustness: median {np.median(self.whole):.1f} ms, worst {max(self.whole):.0f} ms; "
            f"{np.median(self.cpu):.2f} ms for a second of motion",
            flush=True,
        )

    def _ask(
        self, scenario: Scenario, trajectory: Trajectory, robustness: Robustness, kind: str, seed: int
    ) -> None:
        size = getattr(robustness, kind)
        size = 1.0 - size if kind == "contact_friction" else size

        def least(share: float) -> float:
            off = 1.0 - share * size if kind == "contact_friction" else share * size
            return float(perturbed.least_at(scenario.chain, trajectory, kind, off))

        counts = self.counts[kind]
        counts["asked below"] += 1
        held = least(0.98) > 0.0 and least(np.random.default_rng(seed).random()) > 0.0
        counts["held"] += held
        lost = True
        if size < MOST[kind]:
            counts["asked above"] += 1
            lost = least(1.02) <= 0.0
            counts["lost"] += lost
        if not (held and lost):
            print(f"not true: seed {seed}, {kind}, {size}: held {held}, lost {lost}", flush=True)


def _motion(scenario: Scenario, seed: int) -> Trajectory | None:
    if seed % PLANNED:
        found: Trajectory | None = perturbed.random_trajectory(scenario, seed)
        return found
    return plan(scenario, seed=seed, time_limit=1.0).trajectory


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--plans", type=int, default=500)
    parser.add_argument("--from-seed", type=int, default=0)
    words = parser.parse_args()
    tally, seed, taken, planned = Tally(), words.from_seed, 0, 0
    while taken < words.plans:
        scenario = perturbed.random_scenario(seed)
        trajectory = _motion(scenario, seed) if perturbed.pushable(scenario) else None
        if trajectory is not None and tally.take(scenario, trajectory, seed):
            taken, planned = taken + 1, planned + (seed % PLANNED == 0)
            if taken % REPORT == 0 or taken == words.plans:
                tally.tell(taken, planned)
        seed += 1


if __name__ == "__main__":
    main()
