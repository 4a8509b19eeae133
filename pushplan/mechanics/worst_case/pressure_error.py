"""What a pressure that is a little off can change in the wrench that moves an object.

Of a stated pressure p, of total 1, all that lie between (1 - s) p and (1 + s) p are p (1 + s theta) with |theta| <= 1
and integral of p theta = 0. With r(x) the value of a row where the floor pulls at x, and any number c,

    | integral of p theta r | = | integral of p theta (r - c) | <= integral of p |r - c| ,

with equality for the median c. Taken here with the mean, which is the median where r is symmetric, over the cells of
`load_cells`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.arrays import FloatArray
from pushplan.mechanics.chain import PushedObject
from pushplan.mechanics.inertia import InertiaTable, inertia_per_object
from pushplan.mechanics.worst_case.load_cells import load_cells

CELLS_MISS = (0.08, 0.015)
"""Share, and part of the load, added for what varies inside the cells; sums over 40 times as many stay below."""

_AT_ONCE = 1 << 20


class Loss(NamedTuple):
    """What a unit friction load can lose through its pressure.

    Attributes:
        rows: (k, j) by which every row may be smaller.
        size: (k,) by which the length of the wrench may change.
    """

    rows: FloatArray
    size: FloatArray


class PressureError:
    """A known load whose pressure may be off by a share `share` at any place, its total kept."""

    def __init__(self, obj: PushedObject, share: float, length: float) -> None:
        self._points, self._parts = load_cells(obj)
        self._share, self._length = share, length

    def losses(self, twists: FloatArray, rows: FloatArray) -> Loss:
        """Return the largest losses at twists (k, 3) of rows (j, 3), whose moments are divided by the length."""
        step = max(_AT_ONCE // (len(self._parts) * max(len(rows), 3)), 1)
        found = [
            self._losses(self._pulls(twists[i : i + step]), rows, CELLS_MISS)
            for i in range(0, len(twists), step)
        ]
        if not found:
            return Loss(np.zeros((0, len(rows))), np.zeros(0))
        return Loss(np.concatenate([part.rows for part in found]), np.concatenate([p.size for p in found]))

    def inertia_losses(self, twists: FloatArray, rates: FloatArray, rows: FloatArray) -> Loss:
        """Return the same for what the inertia of 1 kg that lies where the load is adds to the rows.

        The wrench of a mass point is a polynomial of its place, so that the cells miss next to nothing of it.

        Args:
            twists: (k, 3) body twists.
            rates: (k, 3) their time derivatives.
            rows: (j, 3) with moments divided by the length.
        """
        points = InertiaTable(np.ones(len(self._parts)), self._points, np.zeros(len(self._parts)))
        pulls = inertia_per_object(points, twists, rates) / [1.0, 1.0, self._length]
        return self._losses(pulls, rows, (CELLS_MISS[0], 0.0))

    def _losses(self, pulls: FloatArray, rows: FloatArray, cells_miss: tuple[float, float]) -> Loss:
        pulls -= (self._parts @ pulls)[:, None]
        values = np.abs(pulls @ rows.T)
        sizes = np.sqrt(np.einsum("kpd,kpd->kp", pulls, pulls))
        more, constant = cells_miss
        rows, size = self._parts @ values, sizes @ self._parts
        return Loss(
            self._share * ((1.0 + more) * rows + constant), self._share * ((1.0 + more) * size + constant)
        )

    def _pulls(self, twists: FloatArray) -> FloatArray:
        """Return the wrench (k, p, 3) that moves a unit friction load at every cell; none where nothing moves."""
        x, y = self._points.T
        u = twists[:, [0]] - twists[:, [2]] * y
        v = twists[:, [1]] + twists[:, [2]] * x
        speed = np.hypot(u, v)
        speed[speed == 0.0] = np.inf
        u, v = u / speed, v / speed
        return np.stack([u, v, (x * v - y * u) / self._length], axis=-1)
