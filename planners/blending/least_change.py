"""The smallest vector that meets linear equations and inequalities."""

from __future__ import annotations

import daqp
import numpy as np

from pushplan.util.arrays import FloatArray

RANK = 1e-9
"""Singular values below this share of the largest one count as 0."""

MISSED = 1e-12
"""By so much an inequality may be missed: the lengths have to end on the goal to 1e-10."""


def least_change(
    equations: FloatArray, values: FloatArray, rows: FloatArray, bounds: FloatArray
) -> FloatArray | None:
    """Return the shortest y (k,) with equations y = values and rows y >= bounds, None where there is none.

    Equations that contradict one another are met as well as they can be. Of what they leave free, y = y_0 + N z,
    the shortest z with G z >= h is taken: a quadratic program (DAQP, Arnstrom, Bemporad and Axehill 2022).

    Args:
        equations: (m, k).
        values: (m,).
        rows: (c, k).
        bounds: (c,).
    """
    left, sizes, right = np.linalg.svd(equations)
    rank = int((sizes > RANK * sizes[0]).sum())
    particular = right[:rank].T @ ((left[:, :rank].T @ values) / sizes[:rank])
    free = right[rank:].T
    g, h = rows @ free, bounds - rows @ particular
    if (h <= 0.0).all():
        return np.asarray(particular)
    if not free.shape[1]:
        return None
    square, none = np.eye(free.shape[1]), np.zeros(free.shape[1])
    z, _, flag, _ = daqp.solve(
        square, none, np.ascontiguousarray(g), np.full(len(h), np.inf), h, primal_tol=MISSED
    )
    return np.asarray(particular + free @ z) if flag > 0 else None
