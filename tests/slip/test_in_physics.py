"""The slip simulator against MuJoCo: a small version of `benchmarks/slip_in_physics.py`."""

import numpy as np
import pytest
from conftest import ChainMaker

from pushplan.geometry import se2
from pushplan.mechanics.support import FeetSupport
from pushplan.sim.physics.chains import simulate_twist
from pushplan.sim.physics.engine import SLIPPING
from pushplan.sim.slip.simulator import simulate_poses
from pushplan.sim.world import World

pytest.importorskip("mujoco")

make = ChainMaker()


@pytest.mark.parametrize(
    ("count", "twist"),
    [(1, (1.0, 0.5, 2.0)), (1, (1.0, -0.2, 14.0)), (2, (1.0, 0.4, 2.0)), (2, (1.0, 0.0, 8.0))],
)
def test_slipping_objects_end_where_the_physics_engine_puts_them(
    count: int, twist: tuple[float, float, float]
) -> None:
    chain = make.boxes(
        count,
        contact_friction=0.2,
        pusher_friction=0.3,
        support=lambda o: FeetSupport(0.9 * o, np.full(4, 0.25)),
    )
    length = chain.characteristic_length
    travel = 0.15 * length
    way = np.linspace(0.0, travel / np.hypot(np.hypot(*twist[:2]), length * twist[2]), 60)
    mine = simulate_poses(way, se2.exp(np.array(twist) * way[:, None]), World.from_chain(chain))
    physics = simulate_twist(chain, twist, travel, SLIPPING)
    off = mine.objects[-1] - physics.objects[-1]
    assert not mine.kept
    assert not physics.kept
    assert np.hypot(off[:, 0], off[:, 1]).max() < 2e-4
    assert np.degrees(np.abs(off[:, 2])).max() < 0.2
