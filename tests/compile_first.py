"""Run what compiles most: `python tests/compile_first.py plan|slip`; later processes find it in numba's cache."""

from __future__ import annotations

import sys

import numpy as np


def plan() -> None:
    """Compile searches of one push and of several."""
    from pushplan.several.warm import warm_up_several

    warm_up_several(None, "ecof", intervals=True)


def slip() -> None:
    """Compile the simulator of slipping contacts."""
    import pushplan
    from pushplan.geometry import se2
    from pushplan.sim.slip.simulate import simulate_poses
    from pushplan.sim.worlds.world import World

    world = World.from_scenario(pushplan.load_scenario("two-crates"))
    shares = np.linspace(0.0, 1.0, 3)
    simulate_poses(shares, se2.compose(world.start, np.outer(shares, [0.01, 0.0, 0.0])), world)


if __name__ == "__main__":
    {"plan": plan, "slip": slip}[sys.argv[1]]()
