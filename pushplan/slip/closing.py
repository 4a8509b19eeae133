"""Whether a contact closes: what is held is pushed straight at an object that does not stand quite where it should.

Pushed squarely, an object turns until it is flush with what pushes it. How far it may be off for that depends on
sizes, loads and frictions, so it is simulated.
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
"""So far the object may stand to the side (m), and be turned (rad)."""

FRICTION = (0.8, 1.2)
"""What frictions of contacts are multiplied by, and the object's friction with the floor is divided by."""

FLUSH = np.radians(0.2)
"""An object that is turned by less against what pushes it is flush with it, rad."""

KEPT = 1e-3
"""What is held may move by so much on the plate, m."""

STEP = 4e-3
"""Coarse, m: of 210 random rows of two and three boxes, half of which do not close, all end as with half of it."""


def closes(chain: Chain, gap: float, push: float, other_friction: float) -> bool:
    """Return whether the last object of a chain becomes flush with those before it, though it stands off.

    Simulated with the object off by `OFF` to either side and turned either way, with both frictions of `FRICTION`. A
    load that is not known is taken as an even one.

    Args:
        chain: All objects flush in a row, the one that is closed onto last; its frame is the plate's.
        gap: How far from it the others begin, m.
        push: How far all are pushed on after they have met, m.
        other_friction: Between objects that are not in contact in the chain.
    """
    objects = [_known(obj) for obj in chain.objects]
    last = len(objects) - 1
    held = replace(chain, objects=tuple(objects[:-1]), contacts=chain.contacts[:last])
    # The last one stands by itself: its contact in that chain is with the plate, which does not touch it.
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
    """Return whether all objects are as in a chain now, but for where the last one is along the face."""
    errors = se2.pose_errors(se2.relative(simulator.plate_pose, simulator.object_poses), chain.places)
    return bool((errors[:-1, 0] < KEPT).all() and errors[-1, 1] < FLUSH)
