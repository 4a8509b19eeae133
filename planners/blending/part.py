"""Parts of a path between two stops: what can be asked of them, and the simplest of them, arcs of one twist."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pushplan.geometry import se2
from pushplan.planners.timing.arc_limits import contact_limits
from pushplan.planners.timing.bounds import Bounds
from pushplan.planners.timing.exact_timing import time_run
from pushplan.planners.timing.step_sum import Pieces
from pushplan.util.arrays import FloatArray, IntArray


class Part(Protocol):
    """Arcs of a path between two stops; methods take the lengths (k,) of all arcs of the path."""

    @property
    def arcs(self) -> IntArray:
        """Indices (a,) of the arcs."""

    def pieces(self, lengths: FloatArray) -> Pieces:
        """Return the twist over time; a piece's level is the index of its arc."""

    def duration(self, lengths: FloatArray) -> float:
        """Return how long it takes, s."""

    def motion(self, lengths: FloatArray) -> FloatArray:
        """Return the pose (3,) at the end, seen from the beginning."""

    def corners(self, lengths: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the arcs (c,) after which the twist changes, and when (c,), s from the beginning."""

    def eased(self, lengths: FloatArray) -> Part:
        """Return it with wider steps wherever a limit is exceeded, as far as that helps."""

    def slowed(self, lengths: FloatArray) -> tuple[Part, float]:
        """Return it slowed down as a whole until no limit is exceeded, and when the most was, s."""


@dataclass(frozen=True, eq=False)
class Push:
    """Arcs of one twist, driven by the exact profile of `timing`; see `Part`.

    Attributes:
        arcs: (a,) their indices.
        twist: (3,) body twist per unit of the arcs' parameters.
        bounds: What limits the motion.
    """

    arcs: IntArray
    twist: FloatArray
    bounds: Bounds

    def pieces(self, lengths: FloatArray) -> Pieces:
        """Return the twist over time."""
        own = lengths[self.arcs]
        limits = contact_limits(self.twist, float(own.sum()), self.bounds)
        durations, coefficients, owner = time_run(self.twist, own, limits)
        return Pieces(durations, coefficients, self.arcs[owner])

    def duration(self, lengths: FloatArray) -> float:
        """Return how long it takes, s."""
        return float(self.pieces(lengths).durations.sum())

    def motion(self, lengths: FloatArray) -> FloatArray:
        """Return the pose (3,) at the end."""
        return se2.exp(self.twist * lengths[self.arcs].sum())

    def corners(self, lengths: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return nothing: there are none."""
        del lengths
        return np.zeros(0, dtype=np.int64), np.zeros(0)

    def eased(self, lengths: FloatArray) -> Push:
        """Return the push: its profile keeps the limits."""
        del lengths
        return self

    def slowed(self, lengths: FloatArray) -> tuple[Push, float]:
        """Return the push: its profile keeps the limits."""
        del lengths
        return self, 0.0
