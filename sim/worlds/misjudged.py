"""Chains whose friction, loads or faces are not what the plan believes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import SupportError
from pushplan.geometry.se2 import compose, rotate, transform_points
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.support import FeetSupport, PressureMapSupport, Support, UniformSupport
from pushplan.sim.physics.model.feet import feet_of
from pushplan.sim.worlds.misplaced import subtree
from pushplan.util.arrays import FloatArray


def with_contact_friction(chain: Chain, factor: float) -> Chain:
    """Return the chain with the friction of all contacts, the plate's too, times `factor`."""
    contacts = tuple(replace(contact, friction=factor * contact.friction) for contact in chain.contacts)
    pusher = replace(chain.pusher, friction=factor * chain.pusher.friction)
    return replace(chain, contacts=contacts, pusher=pusher)


def with_floor_friction(chain: Chain, index: int, factor: float) -> Chain:
    """Return the chain with the floor friction of one object times `factor`."""
    objects = list(chain.objects)
    objects[index] = replace(objects[index], floor_friction=factor * objects[index].floor_friction)
    return replace(chain, objects=tuple(objects))


def with_loads_shifted(chain: Chain, direction: ArrayLike, share: float, index: int | None = None) -> Chain:
    """Return the chain with the load of one object, or of all, shifted towards one side.

    The pressure p(x) becomes p(x) (1 + share e . (x - g) / h): e is the direction, g the centre of the load, and h
    the largest |e . (x - g)| under the object, so that the most that is added or taken away anywhere is that share.

    Args:
        chain: Objects with known loads; a polygon's becomes one on points with the same moments.
        direction: (2,) unit vector in the chain frame.
        share: From 0 to below 1.
        index: Of the object; None for all.

    Raises:
        SupportError: When a load is not known.
    """
    way = np.asarray(direction, dtype=np.float64)
    objects = (
        _shifted(obj, way, share) if index is None or index == i else obj
        for i, obj in enumerate(chain.objects)
    )
    return replace(chain, objects=tuple(objects))


def with_slanted_face(chain: Chain, index: int, angle: float) -> Chain:
    """Return the chain with one object, and all that it carries, turned by `angle` (rad) about its contact's middle.

    The contact itself stays flush: the face of the object is not as square to it as the plan believes.
    """
    contact = chain.contacts[index]
    middle = 0.5 * (contact.right + contact.left)
    turn = np.append(middle - rotate(angle, middle), angle)
    carried = subtree(chain, index)
    objects = [
        replace(obj, pose_chain=compose(turn, obj.pose_chain)) if i in carried else obj
        for i, obj in enumerate(chain.objects)
    ]
    contacts = [
        replace(c, right=transform_points(turn, c.right), left=transform_points(turn, c.left))
        if c.pusher in carried
        else c
        for c in chain.contacts
    ]
    return replace(chain, objects=tuple(objects), contacts=tuple(contacts))


def _shifted(obj: PushedObject, direction: FloatArray, share: float) -> PushedObject:
    points, fractions = _points(obj.name, obj.support)
    along = (points - obj.support.center) @ rotate(-obj.pose_chain[2], direction)
    loads = fractions * (1.0 + share * along / np.abs(along).max())
    return replace(obj, support=FeetSupport(points, loads / loads.sum()))


def _points(name: str, support: Support) -> tuple[FloatArray, FloatArray]:
    if isinstance(support, FeetSupport) and support.fractions is not None:
        return support.positions, support.fractions
    if isinstance(support, PressureMapSupport):
        return support.points, support.fractions
    if isinstance(support, UniformSupport):
        feet = feet_of(support)
        return feet.positions, feet.fractions
    raise SupportError(f"the load under {name!r} can only be shifted where it is known")
