"""Looks at the contacts while a chain is pushed: from when on slides and gaps count, and whether to go on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pushplan.mechanics.chain import Chain
from pushplan.sim.physics.report import contact_motion
from pushplan.util.arrays import FloatArray

_CLOSED = 0.1
"""A contact counts as closed when its gap is below this part of what counts as moved: until then it still slides."""


class ContactWatch:
    """Follows one simulation, look by look.

    Attributes:
        placed: (n, 3) how the objects stand off their places at the start, or None.
        base: Number of the look from which slides and gaps count. Objects off their places touch with a corner only
            and have to close first, until no gap is wider than a tenth of the tolerance. None before that.
    """

    def __init__(
        self,
        chain: Chain,
        tolerance: float,
        begin: float = 0.0,
        placed: FloatArray | None = None,
        until_moved: bool = False,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Watch `chain`.

        Args:
            chain: What is pushed.
            tolerance: Slide or gap over the length of a segment above which a contact counts as moved.
            begin: Share of the motion before which nothing counts.
            placed: See the class.
            until_moved: Ask to stop when a contact has moved.
            progress: Called with the share that is done.
        """
        self.placed = placed
        self.base: int | None = None
        self._chain, self._begin, self._until_moved, self._progress = chain, begin, until_moved, progress
        self._most = tolerance * np.array([contact.length for contact in chain.contacts])
        self._looks = 0
        self._reference: FloatArray | None = None

    def __call__(self, share: float, motions: FloatArray) -> bool:
        """Take a look; tell whether to stop. See `physics_drive.Watch`."""
        if self._progress is not None:
            self._progress(share)
        if self.base is None and share >= self._begin and self._closed(motions):
            self.base, self._reference = self._looks, motions
        self._looks += 1
        return self._until_moved and self._reference is not None and self._moved(self._reference, motions)

    def _closed(self, motions: FloatArray) -> bool:
        if self.placed is None:
            return True
        opening = contact_motion(self._chain, motions[None], None)[1][0]
        return bool((opening <= _CLOSED * self._most).all())

    def _moved(self, reference: FloatArray, motions: FloatArray) -> bool:
        slide, opening, _ = contact_motion(self._chain, np.stack([reference, motions]))
        return bool((np.maximum(np.abs(slide[1]), opening[1]) > self._most).any())
