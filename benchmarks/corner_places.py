"""Objects that touch their pusher only with a corner, after a shift or a turn."""

from __future__ import annotations

import numpy as np

from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Chain
from pushplan.mechanics.contacts import carried_objects
from pushplan.util.arrays import FloatArray


def shifted_places(chain: Chain, index: int, distance: float) -> FloatArray:
    """Return motions (n, 3), as in `Motion.poses`, with one object to the left along its contact by a distance, m.

    What it carries stays, but for what leans: that follows until it touches again, and nothing overlaps.
    """
    moved = np.zeros((len(chain.objects), 3))
    moved[index, :2] = distance * chain.contacts[index].tangent
    return _followed(chain, moved, index)


def turned_places(chain: Chain, index: int, angle: float) -> FloatArray:
    """Return motions (n, 3) with one object turned by an angle (rad), so that one end of its contact still touches.

    What it carries keeps its heading and is moved ahead until it touches with a corner.
    """
    contact = chain.contacts[index]
    pivot = contact.left if angle > 0.0 else contact.right
    moved = np.zeros((len(chain.objects), 3))
    moved[index, 2] = angle
    moved[index, :2] = pivot - transform_points(moved[index], pivot)
    return _followed(chain, moved, index)


def _followed(chain: Chain, moved: FloatArray, index: int) -> FloatArray:
    """Return motions in which all objects carried by one move along its contact's normal until they touch."""
    carried = carried_objects(chain)
    for child, contact in enumerate(chain.contacts):
        if contact.pusher == index:
            # The segment is taken longer by what the face moves along it, so that nothing overlaps at its ends.
            ends = np.stack([contact.right, contact.left])
            along = np.abs((transform_points(moved[index], ends) - ends) @ contact.tangent).max()
            ends = ends + along * np.outer([-1.0, 1.0], contact.tangent)
            gap = float(((transform_points(moved[index], ends) - ends) @ contact.normal).max())
            moved[carried[child], :2] = gap * contact.normal
    return moved
