"""Objects that something pushes aside while they are not looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.geometry.penetration import exit_distance
from pushplan.geometry.se2 import compose, rotate, transform_points
from pushplan.mechanics.chain import PLATE
from pushplan.mechanics.contacts.carried import carried_objects
from pushplan.sim.worlds.world import World
from pushplan.util.arrays import FloatArray


@dataclass(frozen=True)
class Kick:
    """A displacement of one object, at once.

    Attributes:
        time: s.
        index: Of the object.
        x: By how much, in the object's own frame, m.
        y: Likewise.
        turn: About the origin of the object's frame, rad.
    """

    time: float
    index: int
    x: float
    y: float
    turn: float


def kicked(world: World, object_poses: FloatArray, plate: FloatArray, kick: Kick) -> FloatArray:
    """Return the poses (n, 3) of the objects after a kick.

    Bodies do not overlap: the object is kept off what pushes it, and what it carries is moved ahead of it.

    Args:
        world: Whose objects they are.
        object_poses: (n, 3) before, in the world.
        plate: (3,) pose of the chain frame.
        kick: See there.
    """
    poses = np.array(object_poses)
    poses[kick.index] = compose(poses[kick.index], [kick.x, kick.y, kick.turn])
    carried = carried_objects(world.chain)
    for k in np.flatnonzero(carried[kick.index]):
        contact = world.chain.contacts[k]
        ahead = rotate(plate[2], contact.normal)
        shift = exit_distance(
            _outline(world, poses, plate, contact.pusher), _outline(world, poses, plate, int(k)), ahead
        )
        poses[carried[k], :2] += shift * ahead
    return poses


def _outline(world: World, poses: FloatArray, plate: FloatArray, index: int) -> FloatArray:
    """Return the outline (v, 2) of an object, or the plate, in the world."""
    if index == PLATE:
        return transform_points(plate, world.chain.pusher.outline)
    return transform_points(poses[index], world.chain.objects[index].outline)
