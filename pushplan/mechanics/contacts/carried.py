"""What every contact of a tree has to move: the objects that it carries, and their common centre of friction."""

from __future__ import annotations

import numpy as np

from pushplan.geometry.polygon import convex_hull
from pushplan.mechanics.chain import PLATE, Chain
from pushplan.util.arrays import BoolArray, FloatArray

_AXES = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
_ROUNDING = 1e-12


def carried_objects(chain: Chain) -> BoolArray:
    """Return (n, n) whether contact k carries object i: the paper's objects 1..k."""
    n = len(chain.objects)
    carried = np.eye(n, dtype=np.bool_)
    for i in reversed(range(n)):
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


def center_range(loads: FloatArray, centers: FloatArray) -> FloatArray:
    """Return the corners (v, 2) of all centres of friction that some objects can have together, m.

    A corner is farthest in some direction: the objects farther than it in that direction have their largest
    load, the others their least. The normals of the edges found so far say where to look for more.

    Args:
        loads: (m, 2) least and largest friction load of every object, N.
        centers: (m, 2) centres of the objects, m.
    """
    if loads[:, 1].sum() == 0.0:
        return np.asarray(centers.mean(axis=0)[None], dtype=np.float64)
    rounding = _ROUNDING * float(np.abs(centers - centers[0]).max())
    corners = convex_hull(np.array([_farthest(loads, centers, axis) for axis in _AXES]))
    while len(corners) > 1:
        step = np.roll(corners, -1, axis=0) - corners
        normals = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.linalg.norm(step, axis=1, keepdims=True)
        found = np.array([_farthest(loads, centers, normal) for normal in normals])
        beyond = ((found - corners) * normals).sum(axis=1) > rounding
        if not beyond.any():
            break
        corners = convex_hull(np.concatenate([corners, found[beyond]]))
    return corners


def _farthest(loads: FloatArray, centers: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the common centre (2,) that is farthest in a direction."""
    order = np.argsort(-(centers @ direction))
    largest = np.tri(len(order) + 1, len(order), -1, dtype=np.bool_)
    weights = np.where(largest, loads[order, 1], loads[order, 0])
    weights = weights[weights.sum(axis=1) > 0.0]
    common = weights @ centers[order] / weights.sum(axis=1, keepdims=True)
    return np.asarray(common[np.argmax(common @ direction)], dtype=np.float64)
