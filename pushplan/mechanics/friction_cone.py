"""The friction cone of a contact as a shape to draw."""

from __future__ import annotations

import numpy as np

from pushplan.mechanics.chain import Contact
from pushplan.util.arrays import FloatArray


def friction_cone(contact: Contact, apex: FloatArray, tall: float) -> FloatArray:
    """Return triangles (..., 3, 2) from `apex` (..., 2) on: the directions of force that friction allows there.

    Args:
        contact: The contact; the cone opens along its normal, by its friction coefficient to either side.
        apex: Points in the chain frame, m.
        tall: Height of the triangles, m.
    """
    along, aside = tall * contact.normal, contact.friction * tall * contact.tangent
    return np.stack([apex, apex + along - aside, apex + along + aside], axis=-2)
