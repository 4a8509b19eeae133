"""The smallest vector that meets linear equations and inequalities."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from pushplan.basics.arrays import FloatArray

RANK = 1e-9
"""Singular values below this share of the largest one count as 0."""

CONTRADICTION = 1e-9
"""A residual below this says that the inequalities contradict one another."""


def least_change(
    equations: FloatArray, values: FloatArray, rows: FloatArray, bounds: FloatArray
) -> FloatArray | None:
    """Return the shortest y (k,) with equations y = values and rows y >= bounds, None where there is none.

    Equations that contradict one another are met as well as they can be. What they leave free, y = y_0 + N z, is
    found by least distance programming: the shortest z with G z >= h comes from the non-negative least squares
    of [G, h]^T u = (0, ..., 0, 1) (Lawson and Hanson 1974, chapter 23).

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
    matrix, target = np.vstack([g.T, h]), np.append(np.zeros(free.shape[1]), 1.0)
    residual = matrix @ nnls(matrix, target)[0] - target
    if abs(residual[-1]) < CONTRADICTION:
        return None
    return np.asarray(particular - free @ residual[:-1] / residual[-1])
