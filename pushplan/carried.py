"""What every contact of a tree has to move: the objects that it carries, and their common centre of friction."""

from __future__ import annotations

import numpy as np

from pushplan.arrays import BoolArray, FloatArray
from pushplan.chain import PLATE, Chain


def carried_objects(chain: Chain) -> BoolArray:
    """Return (n, n) whether contact k carries object i: the paper's objects 1..k."""
    n = len(chain.objects)
    carried = np.eye(n, dtype=np.bool_)
    for i in range(n - 1, -1, -1):
        pusher = chain.contacts[i].pusher
        if pusher != PLATE:
            carried[pusher] |= carried[i]
    return carried


def common_centers(carried: BoolArray, loads: FloatArray, centers: FloatArray) -> FloatArray:
    """Return the centre of friction (n, 2) of the objects that each contact carries, m.

    G_k = sum of F_i g_i / sum of F_i. Where no carried object has any floor friction, the plain mean stands
    in; no force acts there.

    Args:
        carried: See `carried_objects`.
        loads: (n,) friction loads F_i = mu_i m_i g, N.
        centers: (n, 2) centres g_i, m.
    """
    weights = np.where(carried, loads, 0.0)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 0.0, weights, carried.astype(np.float64))
    return np.asarray(weights @ centers / weights.sum(axis=1, keepdims=True), dtype=np.float64)
