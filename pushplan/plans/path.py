"""A push path: constant-twist arcs from one pose of the chain frame to another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from pushplan.errors import PushplanError
from pushplan.geometry import se2
from pushplan.util.arrays import FloatArray, distinct, frozen, parameters

TURN_WEIGHT = 0.1
"""Path cost of a turn, m per rad."""


SHORTEST_ARC = 1e-10
"""Shorter arcs (m) are rounding errors."""

SAME_TWIST = 1e-12
"""Twists that differ by less (m/s, rad/s) are the same."""


def cost_rate(twists: ArrayLike) -> FloatArray:
    """Return the path cost per unit of time (k,) of body twists (k, 3): |v| + 0.1 |omega|, m/s."""
    v = np.asarray(twists, dtype=np.float64)
    return np.hypot(v[..., 0], v[..., 1]) + TURN_WEIGHT * np.abs(v[..., 2])


@dataclass(frozen=True, eq=False)
class PushPath:
    """Arcs of constant body twist, parametrised by path cost.

    Arcs no longer than `SHORTEST_ARC` are dropped, and neighbours with the same twist are merged.

    Attributes:
        start: (3,) pose of the chain frame in the world at the start.
        twists: (k, 3) body twists in the chain frame, scaled so that the cost grows at 1 m/s.
        lengths: (k,) lengths of the arcs, in the unit of the cost (m).
    """

    start: FloatArray
    twists: FloatArray
    lengths: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), "start of the path"))
        object.__setattr__(self, "twists", frozen(self.twists, (None, 3), "twists of the path"))
        object.__setattr__(self, "lengths", frozen(self.lengths, (len(self.twists),), "lengths of the path"))
        if (self.lengths < 0.0).any():
            raise PushplanError("an arc of the path has a negative length")
        moving = self.lengths > SHORTEST_ARC
        twists, lengths = self.twists[moving], self.lengths[moving]
        if not np.abs(cost_rate(twists) - 1.0).max(initial=0.0) <= 1e-9:
            raise PushplanError("the twists of the path must have a cost rate of 1 m/s")
        changes = np.abs(np.diff(twists, axis=0)).max(axis=1, initial=0.0) > SAME_TWIST
        if len(twists) < len(self.twists) or not changes.all():
            first = np.flatnonzero(np.append(len(twists) > 0, changes))
            object.__setattr__(self, "twists", frozen(twists[first], (None, 3), "twists of the path"))
            merged = np.add.reduceat(lengths, first)
            object.__setattr__(self, "lengths", frozen(merged, (len(first),), "lengths of the path"))

    @classmethod
    def of_arcs(cls, start: FloatArray, arcs: FloatArray) -> PushPath:
        """Return the path of arcs (k, 4), twist and length, from a pose (3,)."""
        return cls(start, arcs[:, :3], arcs[:, 3])

    @property
    def cost(self) -> float:
        """Travel of the contact midpoint plus 0.1 m per radian turned, m."""
        return float(self.lengths.sum())

    @property
    def travel(self) -> float:
        """Length of the path of the frame's origin, m."""
        return float(np.hypot(*self.twists[:, :2].T) @ self.lengths)

    @cached_property
    def knots(self) -> FloatArray:
        """(k + 1, 3) poses in the world at the ends of the arcs; angles are continuous, not wrapped."""
        steps = se2.exp(self.twists * self.lengths[:, None])
        return frozen(se2.chained(self.start, steps), (None, 3), "knots of the path")

    @property
    def end(self) -> FloatArray:
        """(3,) pose in the world at the end."""
        return np.asarray(self.knots[-1])

    def of_frame(self, frame: FloatArray) -> PushPath:
        """Return the path of another frame of the same body.

        Args:
            frame: (3,) pose of the other frame in this path's frame.
        """
        if not np.any(frame):
            return self
        twists = se2.twist_of(frame, self.twists)
        rate = cost_rate(twists)
        return PushPath(se2.compose(self.start, frame), twists / rate[:, None], self.lengths * rate)

    def poses_at(self, s: ArrayLike) -> FloatArray:
        """Return the poses (m, 3) in the world at the costs `s` (m,), clipped to the path.

        Raises:
            PushplanError: If a cost is not a number.
        """
        s = np.clip(parameters(s, "costs"), 0.0, self.cost)
        if len(self.lengths) == 0:
            return np.broadcast_to(self.start, (*s.shape, 3)).copy()
        begins = np.concatenate([[0.0], np.cumsum(self.lengths)])
        arc = np.clip(np.searchsorted(begins, s, side="right") - 1, 0, len(self.lengths) - 1)
        step = self.twists[arc] * (s - begins[arc])[:, None]
        return se2.compose(self.knots[arc], se2.exp(step))

    def sampled(self, spacing: float) -> FloatArray:
        """Return poses (m, 3) at most `spacing` apart in cost, including every knot."""
        begins = np.concatenate([[0.0], np.cumsum(self.lengths)])
        parts = [np.linspace(a, b, max(2, int(np.ceil((b - a) / spacing)) + 1)) for a, b in pairwise(begins)]
        return self.poses_at(distinct(np.concatenate([*parts, [0.0]])))
