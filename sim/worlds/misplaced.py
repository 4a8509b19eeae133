"""Objects that do not stand where the plan believes: shifted along their contact, or turned.

Places are given as motions (n, 3) of the chain frame that bring every object from where it belongs to where it is.
All that touched still touches, with a corner at least, and nothing overlaps.
"""

from __future__ import annotations

import numpy as np

from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Chain, Contact
from pushplan.util.arrays import FloatArray


def shifted(chain: Chain, index: int, distance: float) -> FloatArray:
    """Return places (n, 3) with one object off to its left by `distance` (m), along the contact that pushes it.

    What it carries stays, but for what leans: that follows until it touches again.
    """
    moved = np.zeros((len(chain.objects), 3))
    moved[index, :2] = distance * chain.contacts[index].tangent
    return _followed(chain, moved, index)


def turned(chain: Chain, index: int, angle: float) -> FloatArray:
    """Return places (n, 3) with one object turned by `angle` (rad), so that one end of its contact still touches.

    What it carries keeps its heading and is moved ahead until it touches with a corner.
    """
    contact = chain.contacts[index]
    pivot = contact.left if angle > 0.0 else contact.right
    moved = np.zeros((len(chain.objects), 3))
    moved[index, 2] = angle
    moved[index, :2] = pivot - transform_points(moved[index], pivot)
    return _followed(chain, moved, index)


def _followed(chain: Chain, moved: FloatArray, index: int) -> FloatArray:
    """Return places where all that an object carries has been moved along its contact's normal until it touches."""
    for child, contact in enumerate(chain.contacts):
        if contact.pusher == index:
            shift = _gap(contact, moved[index]) * contact.normal
            for carried in subtree(chain, child):
                moved[carried, :2] = shift
    return moved


def _gap(contact: Contact, motion: FloatArray) -> float:
    """Return how far the pushing face comes ahead along the normal somewhere under the segment, m.

    The segment is taken longer by what the face moves along it, so that nothing overlaps at its ends.
    """
    ends = np.stack([contact.right, contact.left])
    along = np.abs((transform_points(motion, ends) - ends) @ contact.tangent).max()
    ends = ends + along * np.outer([-1.0, 1.0], contact.tangent)
    return float(((transform_points(motion, ends) - ends) @ contact.normal).max())


def subtree(chain: Chain, index: int) -> list[int]:
    """Return the indices of an object and of all that it carries."""
    found = [index]
    for child, contact in enumerate(chain.contacts):
        if contact.pusher in found:
            found.append(child)
    return found
