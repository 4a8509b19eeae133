"""What is drawn of the contacts: segment, friction cone, and the force as an arrow of a length that suits the chain.

Every viewer draws these shapes, all in the chain frame, and one contact in one colour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pushplan.mechanics.chain import Chain, Contact
from pushplan.mechanics.friction_cone import friction_cone
from pushplan.plans.execution import Execution
from pushplan.util.arrays import FloatArray, IntArray

MOST_NAMED = 6
"""Contacts that are named beside a plot."""

_ARROW, _CONE, _HEAD = 0.9, 0.45, 0.3
"""Length of the largest force's arrow and height of the cones, as shares of the size of an object (the root of its
area); length of an arrow's head as a share of that of the longest arrow."""


@dataclass(frozen=True, eq=False)
class ContactShapes:
    """A contact at n instants, chain frame, m.

    Attributes:
        segment: (2, 2) right and left end.
        cones: (n, c, 3, 2) triangles: one at the point of application, or one at either end where that is not known.
        shafts: (n, 2, 2) from the point of application to the tip of the force's arrow; None where it is not known.
        heads: (n, 3, 2) triangles at the tips, which are their first corners; None likewise.
    """

    segment: FloatArray
    cones: FloatArray
    shafts: FloatArray | None = None
    heads: FloatArray | None = None


def object_size(chain: Chain) -> float:
    """Return the side of a square as large as the chain's median object, m."""
    areas = [shapely.Polygon(obj.outline).area for obj in chain.objects]
    return float(np.sqrt(np.median(areas)))


def longest_arrow(chain: Chain) -> float:
    """Return the length of the arrow of the largest force, m."""
    return _ARROW * object_size(chain)


def cone_heights(chain: Chain) -> list[float]:
    """Return how tall the friction cone of each contact is drawn, m."""
    size = object_size(chain)
    return [min(_CONE * size, 0.5 * contact.length) for contact in chain.contacts]


def largest_force(forces: FloatArray) -> float:
    """Return the size of the largest of some finite forces (..., 2), 1 where all are zero."""
    sizes = np.hypot(forces[..., 0], forces[..., 1])
    return float(sizes.max(initial=0.0, where=np.isfinite(sizes))) or 1.0


def resting(chain: Chain) -> list[ContactShapes]:
    """Return the contacts of a chain of whose forces nothing is known, at one instant."""
    heights = zip(chain.contacts, cone_heights(chain), strict=True)
    return [_without_force(contact, tall, 1) for contact, tall in heights]


class PushedContacts:
    """The contacts of a chain during an execution; arrows show shares of its largest force."""

    def __init__(self, chain: Chain, execution: Execution) -> None:
        self._contacts, self._execution = chain.contacts, execution
        self._heights, self._longest = cone_heights(chain), longest_arrow(chain)
        self._largest = 1.0 if execution.forces is None else largest_force(execution.forces)

    def at(self, samples: IntArray) -> list[ContactShapes]:
        """Return the contacts at some `samples` (n,) of the execution."""
        forces, lambdas = self._execution.forces, self._execution.lambdas
        heights = zip(self._contacts, self._heights, strict=True)
        if forces is None or lambdas is None:
            return [_without_force(contact, tall, len(samples)) for contact, tall in heights]
        arrows = self._longest * np.nan_to_num(forces[samples] / self._largest, posinf=0, neginf=0)
        shares = np.nan_to_num(lambdas[samples])
        return [
            _with_force(contact, tall, shares[:, k], arrows[:, k], self._longest)
            for k, (contact, tall) in enumerate(heights)
        ]


def worst_contacts(execution: Execution, most: int = MOST_NAMED) -> list[int]:
    """Return the contacts with the smallest margins, at most so many, in the order of the chain."""
    return sorted(np.argsort(execution.margins.min(axis=0), kind="stable")[:most].tolist())


def _without_force(contact: Contact, tall: float, count: int) -> ContactShapes:
    ends = np.stack([contact.right, contact.left])
    return ContactShapes(ends, np.tile(friction_cone(contact, ends, tall), (count, 1, 1, 1)))


def _with_force(
    contact: Contact, tall: float, shares: FloatArray, arrows: FloatArray, longest: float
) -> ContactShapes:
    """Return a contact whose forces (n, 2), as arrows, m, pass through its segment at `shares` (n,) of its length."""
    ends = np.stack([contact.right, contact.left])
    points = ends[0] + shares[:, None] * (ends[1] - ends[0])
    tips = points + arrows
    lengths = np.hypot(arrows[:, 0], arrows[:, 1])[:, None]
    along = np.divide(arrows, lengths, out=np.zeros_like(arrows), where=lengths > 0.0)
    back = np.minimum(_HEAD * longest, lengths) * along
    aside = 0.4 * np.stack([-back[:, 1], back[:, 0]], axis=1)
    heads = np.stack([tips, tips - back + aside, tips - back - aside], axis=1)
    cones = friction_cone(contact, points, tall)[:, None]
    return ContactShapes(ends, cones, np.stack([points, tips - 0.5 * back], axis=1), heads)
