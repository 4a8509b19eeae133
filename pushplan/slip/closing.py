"""Simulates whether a contact closes: held objects are pushed straight at an object with a pose error.

An object that is pushed squarely turns until it is flush with the pushing body. The pose error for which this works
depends on sizes, loads and frictions, so it is simulated.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from pushplan.geometry import se2
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.support import UniformSupport
from pushplan.slip.simulator import SlipSimulator
from pushplan.slip.world import World

OFF = (3e-3, np.radians(2.0))
"""Simulated pose errors of the object: lateral offset (m) and angle (rad)."""

FRICTION = (0.8, 1.2)
"""Factors on all contact friction; the object's floor friction is divided by them."""

FLUSH = np.radians(0.2)
"""Largest angle between flush faces, rad."""

KEPT = 1e-3
"""Largest allowed motion of held objects on the plate, m."""

STEP = 4e-3
"""Simulation step, m. For 210 random rows of two and three boxes, half of which do not close, half the step gives the
same results."""


def closes(chain: Chain, gap: float, push: float, other_friction: float) -> bool:
    """Return whether the last object of a chain becomes flush with the others in spite of a pose error.

    The simulations combine offsets and turns of `OFF` in both directions with both factors of `FRICTION`. An unknown
    load is assumed to be uniform.

    Args:
        chain: All objects flush in a row, the standing object last; the chain frame is the plate's frame.
        gap: Initial distance of the others from the last object, m.
        push: Length of the push after they have met, m.
        other_friction: Friction coefficient between objects that are not in contact in the chain.
    """
    objects = [_known(obj) for obj in chain.objects]
    last = len(objects) - 1
    held = replace(chain, objects=tuple(objects[:-1]), contacts=chain.contacts[:last])
    # The last object stands alone: its chain needs a contact with the plate, which does not touch it.
    alone = replace(objects[-1], pose_chain=np.zeros(3))
    one = replace(chain, objects=(alone,), contacts=(replace(chain.contacts[0], pushed=0),))
    plate = np.array([-gap, 0.0, 0.0])
    beside = (World.from_chain(one, chain.places[-1]),)
    world = World(held, plate, np.zeros((last, 3)), other_friction=other_friction, beside=beside)
    for factor in FRICTION:
        changed = world.with_contact_friction(factor).with_floor_friction(1.0 / factor, alone.name)
        simulator = SlipSimulator(changed, step=STEP)
        for side, turn in itertools.product((-1.0, 1.0), repeat=2):
            stands = chain.places[-1] + [0.0, side * OFF[0], turn * OFF[1]]
            simulator.place([*se2.compose(plate, held.places), stands], plate)
            simulator.move([1.0, 0.0, 0.0], gap + push)
            if simulator.jammed or not _is_flush(simulator, chain):
                return False
    return True


def _known(obj: PushedObject) -> PushedObject:
    return obj if obj.support.known else replace(obj, support=UniformSupport(obj.outline))


def _is_flush(simulator: SlipSimulator, chain: Chain) -> bool:
    """Return whether the objects have their poses of the chain, except for the last one's position along the face."""
    errors = se2.pose_errors(se2.relative(simulator.plate_pose, simulator.object_poses), chain.places)
    return bool((errors[:-1, 0] < KEPT).all() and errors[-1, 1] < FLUSH)
