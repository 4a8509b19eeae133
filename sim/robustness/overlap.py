"""How a contact grows and shrinks when one of the two bodies slides along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.errors import ChainError
from pushplan.geometry.contact_segments import TOUCH
from pushplan.mechanics.chain import PLATE, Chain, Contact
from pushplan.util.arrays import FloatArray

PARALLEL = 1e-3
"""Largest angle between a contact and the edges that it lies on, rad."""

NEAR = 4.0 * TOUCH
"""Largest distance of an edge from the contact's line, taken where the edge is nearest to the contact's middle, m."""

NOWHERE = 1e6
"""Right end of no overlap, m; its left end is at minus that."""


@dataclass(frozen=True, eq=False)
class Overlap:
    """The edges of two bodies on the line of their contact, as coordinates along it from right to left, m.

    Attributes:
        pushing: (a, 2) of the pushing body.
        pushed: (b, 2) of the pushed body.
    """

    pushing: FloatArray
    pushed: FloatArray

    @classmethod
    def of(cls, chain: Chain, k: int) -> Overlap:
        """Return the overlap that contact k is.

        Raises:
            ChainError: When the contact does not lie on edges of both bodies.
        """
        contact = chain.contacts[k]
        pushing = (
            chain.pusher.outline if contact.pusher == PLATE else chain.objects[contact.pusher].outline_chain
        )
        found = cls(
            _edges_along(pushing, contact, 1.0),
            _edges_along(chain.objects[k].outline_chain, contact, -1.0),
        )
        right, left = found._ends(np.zeros(1), np.zeros(1))
        if not left > right:
            raise ChainError(f"contact {chain.contact_name(k)} does not lie on an edge of both bodies")
        return found

    def change(self, along: FloatArray, pushed: bool) -> FloatArray:
        """Return by how much (2, q) the right and the left end move when a body slides by `along` (q,), m.

        Args:
            along: In the direction from the right end to the left end.
            pushed: Whether the pushed body slides, or the pushing one.
        """
        still = np.zeros_like(along)
        ends = self._ends(still, along) if pushed else self._ends(along, still)
        return np.asarray(ends - self._ends(np.zeros(1), np.zeros(1)))

    def _ends(self, pushing: FloatArray, pushed: FloatArray) -> FloatArray:
        """Right and left end (2, q); that of nothing runs from `NOWHERE` to minus that."""
        a = self.pushing[:, None, None, :] + pushing[None, None, :, None]
        b = self.pushed[None, :, None, :] + pushed[None, None, :, None]
        low, high = np.maximum(a[..., 0], b[..., 0]), np.minimum(a[..., 1], b[..., 1])
        touching = high - low > TOUCH
        right = np.where(touching, low, NOWHERE).min(axis=(0, 1), initial=NOWHERE)
        left = np.where(touching, high, -NOWHERE).max(axis=(0, 1), initial=-NOWHERE)
        return np.array([right, left])


def _edges_along(outline: FloatArray, contact: Contact, sense: float) -> FloatArray:
    """Return the edges (a, 2) of a counter-clockwise outline on the contact's line that run its way (+1) or back."""
    s, away = ((outline - contact.right) @ axis for axis in (contact.tangent, contact.normal))
    run, rise = (np.roll(values, -1) - values for values in (s, away))
    kept = (sense * run > 0.0) & (np.abs(rise) <= PARALLEL * np.abs(run))
    s, away, run, rise = s[kept], away[kept], run[kept], rise[kept]
    low, high = np.minimum(s, s + run), np.maximum(s, s + run)
    nearest = np.clip(0.5 * contact.length, low, high)
    near = np.abs(away + (nearest - s) * rise / run) <= NEAR
    return np.asarray(np.stack([low, high], axis=1)[near])
