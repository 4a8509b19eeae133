"""A chain as it was measured: how far each contact is from flush, and the chain whose objects have slid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pushplan.errors import ChainError
from pushplan.geometry.contact_segments import find_touch
from pushplan.geometry.se2 import compose, inverse, relative, wrap_angle
from pushplan.mechanics.chain import PLATE, Chain, Contact
from pushplan.sim.physics.report import contact_motion
from pushplan.util.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Contacts:
    """What contacts are like against those of a chain.

    Attributes:
        slide: (..., n) how far the middle of each segment has slid on the pushing body, m; to the left is positive.
        opening: (..., n) the wider of the gaps at the two ends, m.
        rotation: (..., n) turn of the pushed against the pushing body, rad.
    """

    slide: FloatArray
    opening: FloatArray
    rotation: FloatArray

    def flush(self, gap: float, angle: float) -> BoolArray:
        """Return whether all contacts are closed, to a gap (m) and an angle (rad)."""
        closed = (self.opening <= gap) & (np.abs(self.rotation) <= angle)
        return np.asarray(closed.all(axis=-1))


def contacts_at(chain: Chain, places: FloatArray) -> Contacts:
    """Return what the contacts are like with the objects at poses (..., n, 3) in the chain frame."""
    many = places.reshape(-1, len(chain.objects), 3)
    motions = compose(many, inverse(chain.places))
    plate = np.zeros((len(many), 1, 3))
    found = contact_motion(chain, np.concatenate([motions, plate], axis=1), None)
    return Contacts(*(values.reshape(places.shape[:-1]) for values in found))


def off_places(chain: Chain, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far (n,), m, and by what angle (n,), rad, objects at `places` (n, 3) are off the chain's."""
    apart = relative(chain.places, places)
    return np.hypot(apart[:, 0], apart[:, 1]), np.abs(wrap_angle(apart[:, 2]))


def slid(chain: Chain, slides: Sequence[float] | FloatArray) -> Chain:
    """Return the chain with every object slid along the contact that pushes it, to the left by `slides` (n,), m.

    What an object carries goes along with it.

    Raises:
        ChainError: When a contact is left without a segment.
    """
    shifts = {PLATE: np.zeros(2)}
    for k, contact in enumerate(chain.contacts):
        shifts[k] = shifts[contact.pusher] + slides[k] * contact.tangent
    objects = tuple(
        replace(obj, pose_chain=obj.pose_chain + np.append(shifts[i], 0.0))
        for i, obj in enumerate(chain.objects)
    )
    outlines = {PLATE: chain.pusher.outline, **{i: obj.outline_chain for i, obj in enumerate(objects)}}
    contacts = tuple(
        _again(contact, outlines[contact.pusher], outlines[k]) for k, contact in enumerate(chain.contacts)
    )
    return replace(chain, objects=objects, contacts=contacts)


def _again(contact: Contact, pushing: FloatArray, pushed: FloatArray) -> Contact:
    """Return the contact with the segment along which the outlines touch now."""
    touch = find_touch(pushing, pushed)
    segments = [] if touch is None else list(touch)
    facing = [s for s in segments if (s[1] - s[0]) @ contact.tangent > 0.99 * np.linalg.norm(s[1] - s[0])]
    if not facing:
        raise ChainError(f"object {contact.pushed} has slid off what pushes it")
    right, left = max(facing, key=lambda s: float(np.linalg.norm(s[1] - s[0])))
    return replace(contact, right=right, left=left)
