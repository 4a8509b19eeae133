"""Turns on the boundary of a stable set, and which left and right ones have close centres of rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.arrays import FloatArray, IntArray
from pushplan.mechanics.sphere import Meridians, twists_at


@dataclass(frozen=True, eq=False)
class BoundaryTurns:
    """Turns of one sense where meridians leave the set.

    Attributes:
        longitude: (k,) rad.
        twist: (k, 3) unit twists.
        cor: (k, 2) centres of rotation, m.
    """

    longitude: FloatArray
    twist: FloatArray
    cor: FloatArray

    @classmethod
    def of(cls, rows: Meridians, sense: int, length: float) -> BoundaryTurns:
        """Return the ends of intervals that turn with `sense`; `length` is the characteristic one."""
        longitude = np.concatenate([rows.longitude, rows.longitude])
        latitude = np.concatenate([rows.lower, rows.upper])
        turning = sense * latitude > 0.0
        twist = twists_at(longitude[turning], latitude[turning], length)
        cor = np.stack([-twist[:, 1], twist[:, 0]], axis=1) / twist[:, 2:]
        return cls(longitude[turning], twist, cor)


@dataclass(frozen=True, eq=False)
class TurnPairs:
    """Left and right turns (k each), by the distance of their CORs.

    Attributes:
        left: The left turns.
        right: The right turns.
        i: (k,) index of the left turn.
        j: (k,) index of the right turn.
        separation: (k,) distance of the CORs, m, increasing.
        heading: (k,) direction of the translation between the two, rad.
    """

    left: BoundaryTurns
    right: BoundaryTurns
    i: IntArray
    j: IntArray
    separation: FloatArray
    heading: FloatArray

    def at(self, k: IntArray, share: FloatArray, scale: FloatArray) -> FloatArray:
        """Return twists (m, 3) that mix the turns of pairs k (m,): `share` (m,) of the right one's unit twist.

        `scale` (3,) makes twists unit vectors.
        """
        a, b = self.left.twist[self.i[k]] * scale, self.right.twist[self.j[k]] * scale
        return np.asarray(((1.0 - share)[:, None] * a + share[:, None] * b) / scale, dtype=np.float64)

    def shares(self, samples: int, scale: FloatArray) -> FloatArray:
        """Return shares (k, 2 samples), half of them even in the angle between the twists, half crowding the ends."""
        even = np.linspace(0.0, 1.0, samples)[None, :]
        a, b = self.left.twist[self.i] * scale, self.right.twist[self.j] * scale
        gap = np.arccos(np.clip((a * b).sum(axis=1, keepdims=True), -1.0, 1.0))
        left, right = np.sin((1.0 - even) * gap), np.sin(even * gap)
        crowded = np.broadcast_to(0.5 - 0.5 * np.cos(np.pi * even), left.shape)
        return np.concatenate([crowded, right / (left + right)], axis=1)


def close_pairs(
    left: BoundaryTurns, right: BoundaryTurns, first: float, last: float, count: int
) -> TurnPairs:
    """Return the `count` closest pairs whose translation heads between `first` and `last`, rad.

    J (cR - cL) is the translation's direction.
    """
    gap = right.cor[None, :, :] - left.cor[:, None, :]
    separation = np.hypot(gap[..., 0], gap[..., 1])
    heading = first + (np.arctan2(gap[..., 0], -gap[..., 1]) - first) % (2.0 * np.pi)
    i, j = np.nonzero((heading < last) & (separation > 0.0))
    order = np.argsort(separation[i, j], kind="stable")[:count]
    i, j = i[order], j[order]
    return TurnPairs(left, right, i, j, separation[i, j], heading[i, j])
