"""How the plate comes up to a load: straight ahead until the contact that closes tells where the plate is."""

from __future__ import annotations

import numpy as np

from pushplan.geometry.se2 import compose, inverse, relative, rotate, transform_points, wrap_angle
from pushplan.mechanics.chain import Chain
from pushplan.sim.control.settings import ControlSettings, words
from pushplan.util.arrays import FloatArray

ASIDE = (1e-3, np.radians(0.3))
"""By how much (m, rad) the plate has to have met a load aside so that another approach may do better."""
FOUND = 3.0
"""A contact that is found by approach is off where it is believed to be by so many times what is likely, at most."""
MET = 0.25
"""Share of the straight push by which the plate has to have moved a load that it has met: 5 of 20 mm make boxes flush
that are 15 cm wide and turned by 2 deg."""
TRIES = 3
"""Straight pushes in search of a load, at most."""


def shift_at_contact(chain: Chain, plate: FloatArray, object_poses: FloatArray) -> FloatArray:
    """Return by what body motion (3,) the plate is off if the first object that it pushes is flush.

    Along the contact, where that cannot be told, the plate is where it is believed to be.

    Args:
        chain: With all contacts closed.
        plate: (3,) pose of the chain frame in the world, as believed.
        object_poses: (n, 3) as measured.
    """
    k = chain.first_pushed
    contact = chain.contacts[k]
    carried = relative(plate, compose(object_poses[k], inverse(chain.places[k])))
    middle, turned = 0.5 * (contact.right + contact.left), float(wrap_angle(carried[2]))
    there = transform_points(carried, middle[None])[0]
    slide = float(rotate(-turned, there - middle) @ contact.tangent)
    return np.append(there - rotate(turned, middle + slide * contact.tangent), turned)


def tangents_of(places: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the directions (n, 2) along contacts in the objects' frames.

    Args:
        places: (n, 3) of the objects in the chain frame.
        normals: (n, 2) of the contact that each is pushed through, in that frame.
    """
    along = np.arctan2(normals[:, 1], normals[:, 0]) + 0.5 * np.pi - places[:, 2]
    return np.stack([np.cos(along), np.sin(along)], axis=-1)


class Touch:
    """The straight push with which the plate comes up to a load.

    Args:
        chain: The load.
        length: Of the push, m; 0 where the plate is in contact.
        straight: The load is in contact, and closes onto an object by that push.
        settings: See there.

    Attributes:
        length: Of the next straight push, m.
        over: Whether the load was met, and tells where the plate is.
    """

    def __init__(self, chain: Chain, length: float, straight: bool, settings: ControlSettings) -> None:
        self.length, self.over = length, length == 0.0
        self._chain, self._straight = chain, straight
        self._most = FOUND * np.array(settings.approach_error)
        self._tries, self._off = 1, (0.0, 0.0)

    @property
    def aside(self) -> bool:
        """Whether the plate was elsewhere than believed, so that another approach may do better."""
        return self._off[0] > ASIDE[0] or self._off[1] > ASIDE[1]

    def told(self, plate: FloatArray, object_poses: FloatArray, sure: bool = False) -> tuple[FloatArray, str] | None:
        """Return by what body motion (3,) the plate is off where it is believed to be, and words for that.

        The first object that the plate pushes, at rest after the push, is taken for flush; along it, what was
        believed holds. Bodies do not overlap: one that stands where the plate is believed to be was not moved as far
        as that has gone. Where it was hardly moved, the push is `over` only after another one.

        Args:
            plate: (3,) pose of the chain frame in the world, as believed.
            object_poses: (n, 3) as measured.
            sure: Whether the object is flush for sure. None is returned where it is not, and far ahead of the plate.
        """
        shift = shift_at_contact(self._chain, plate, object_poses)
        first, behind = self._chain.objects[self._chain.first_pushed].name, -float(shift[0])
        if not (sure or self._straight or self._tries == TRIES or self.length - behind > MET * self.length):
            self._tries, self.length = self._tries + 1, behind
            text = f"{first} was not met: the plate is {1e3 * behind:.1f} mm behind"
            return np.array([-behind, 0.0, 0.0]), text
        self.over = True
        off = float(np.hypot(shift[0], shift[1])), abs(float(shift[2]))
        far = off[0] if self._straight else -behind
        if not sure and (far > self._most[0] or off[1] > self._most[1]):
            return None
        self._off = off
        return shift, f"{first} tells that the plate is {words(*off)} off"
