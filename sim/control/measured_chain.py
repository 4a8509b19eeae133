"""A chain as it was measured: how far each contact is from flush, and each object off its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.geometry.se2 import compose, inverse, relative, wrap_angle
from pushplan.mechanics.chain import Chain
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
