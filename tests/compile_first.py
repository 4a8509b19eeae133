"""Run what compiles most, for numba's cache: `python tests/compile_first.py [plan] [slip] [sets]`."""

from __future__ import annotations

import sys

import numpy as np
import yaml


def plan() -> None:
    """Compile searches of one push and of several."""
    from pushplan.kernels import warm_up

    warm_up("auto", intervals=True, multi_push=True)


def slip() -> None:
    """Compile the simulator of slipping contacts."""
    import pushplan
    from pushplan.geometry import se2
    from pushplan.sim.slip.simulator import simulate_poses
    from pushplan.sim.world import World

    world = World.from_scenario(pushplan.load_scenario("two-crates"))
    shares = np.linspace(0.0, 1.0, 3)
    simulate_poses(shares, se2.compose(world.start, np.outer(shares, [0.01, 0.0, 0.0])), world)


def sets() -> None:
    """Compile the boundaries of stable sets, of numbers and of intervals."""
    import pushplan
    from pushplan.scenario.file import scenario_from_document
    from pushplan.scenario.template import new_scenario_text

    with_intervals = scenario_from_document(yaml.safe_load(new_scenario_text("new")))
    for scenario in (pushplan.load_scenario("one-box"), with_intervals):
        scenario.stable_set().refined_meridians()


if __name__ == "__main__":
    for what in sys.argv[1:]:
        {"plan": plan, "slip": slip, "sets": sets}[what]()
