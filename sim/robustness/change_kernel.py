"""The contact conditions of many variants of one chain at many moments, inertia included, in compiled form."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled, no_refcount
from pushplan.mechanics.friction.kernel import carried_wrench
from pushplan.mechanics.friction.series import ComplexArray
from pushplan.sim.robustness.instants import Instants
from pushplan.util.arrays import BoolArray, FloatArray, IntArray


class Variants(NamedTuple):
    """q variants of a chain; the first axis of an array in which they do not differ may have length 1.

    Attributes:
        objects: (q, n, 11) as in a `PackedChain`, like `parts` and `links`.
        parts: (q, e, 5).
        links: (n, 4).
        moved: (n,) whether the wrench of the floor's friction on the object differs from the one as stated.
        moves: (q, n, 4) cos, sin, x, y of the motion that takes the object from where it is stated to where it is.
        centers: (q, n, 2) centres of mass, m.
        facets: (q, n, 4, 3) the contact holds where all facets . (f_x, f_y, m) are > 0.
        holds: (q,) > 0 where such a chain exists: every contact has a length, every pressure is positive.
    """

    objects: FloatArray
    parts: FloatArray
    links: IntArray
    moved: BoolArray
    moves: FloatArray
    centers: FloatArray
    facets: FloatArray
    holds: FloatArray


@no_refcount
def _moved_wrench(
    objects: FloatArray,
    parts: FloatArray,
    series: ComplexArray,
    links: IntArray,
    k: int,
    move: FloatArray,
    twist: FloatArray,
    out: FloatArray,
) -> None:
    """Fill `out` (3,) with the wrench that moves object k against the floor from where `move` (4,) has put it.

    The twist is taken into the frame that moved along, and the wrench back.
    """
    cos, sin, x, y = move[0], move[1], move[2], move[3]
    vx, vy, omega = twist[0] - twist[2] * y, twist[1] + twist[2] * x, twist[2]
    fx, fy, m = carried_wrench(
        objects, parts, series, links, k, cos * vx + sin * vy, cos * vy - sin * vx, omega
    )
    out[0], out[1] = cos * fx - sin * fy, sin * fx + cos * fy
    out[2] = m + x * out[1] - y * out[0]


@no_refcount
def _add_inertia(
    mass: float, moment: float, center: FloatArray, v: FloatArray, dv: FloatArray, out: FloatArray
) -> None:
    """Add to `out` (3,) what an object's inertia asks for, see `mechanics.dynamics`."""
    x, y, omega = center[0], center[1], v[2]
    fx = mass * (dv[0] - dv[2] * y - omega * v[1] - omega**2 * x)
    fy = mass * (dv[1] + dv[2] * x + omega * v[0] - omega**2 * y)
    out[0] += fx
    out[1] += fy
    out[2] += moment * dv[2] + x * fy - y * fx


@compiled
def floor_wrenches_of(variants: Variants, series: ComplexArray, directions: FloatArray) -> FloatArray:
    """Return the wrenches (m, n, 3) that move each object of the first variant against the floor."""
    out = np.empty((len(directions), len(variants.links), 3))
    for s in range(len(directions)):
        for k in range(len(variants.links)):
            move = variants.moves[0, k]
            _moved_wrench(
                variants.objects[0],
                variants.parts[0],
                series,
                variants.links,
                k,
                move,
                directions[s],
                out[s, k],
            )
    return out


@compiled
def facet_values(
    variants: Variants,
    series: ComplexArray,
    mass: FloatArray,
    moment: FloatArray,
    instants: Instants,
    stated: FloatArray,
) -> FloatArray:
    """Return the facets' values (q, m, n, 4) of the contacts of q variants at m moments, N and N m.

    Args:
        variants: The chains.
        series: Of the `PackedChain`.
        mass: (n,) kg.
        moment: (n,) moments of inertia, kg m^2.
        instants: The moments.
        stated: (m, n, 3) wrenches that move the objects against the floor as stated, for those not `moved`.
    """
    objects, parts, links, moved, moves, centers, facets, holds = variants
    directions, twists, rates, group = instants
    n = len(links)
    out = np.empty((len(holds), len(twists), n, 4))
    floor, carried = np.zeros((n, 3)), np.empty((n, 3))
    for a in range(len(holds)):
        o, p, h = min(a, len(objects) - 1), min(a, len(parts) - 1), min(a, len(moves) - 1)
        c, g = min(a, len(centers) - 1), min(a, len(facets) - 1)
        for s in range(len(twists)):
            fresh = s == 0 or group[s] != group[s - 1]
            for k in range(n):
                if moved[k] and fresh:
                    _moved_wrench(
                        objects[o], parts[p], series, links, k, moves[h, k], directions[s], floor[k]
                    )
                for j in range(3):
                    carried[k, j] = floor[k, j] if moved[k] else stated[s, k, j]
                _add_inertia(mass[k], moment[k], centers[c, k], twists[s], rates[s], carried[k])
            for k in range(n - 1, -1, -1):
                w, pusher = carried[k], links[k, 3]
                for j in range(4):
                    row = facets[g, k, j]
                    out[a, s, k, j] = row[0] * w[0] + row[1] * w[1] + row[2] * w[2]
                if pusher >= 0:
                    for j in range(3):
                        carried[pusher, j] += w[j]
    return out


@compiled
def lost_contacts(values: FloatArray, holds: FloatArray) -> BoolArray:
    """Return where (q, m) any of the values (q, m, n, 4) is not positive, or the chain does not exist."""
    q, m, n, _ = values.shape
    out = np.empty((q, m), dtype=np.bool_)
    for a in range(q):
        for s in range(m):
            lost = holds[a] <= 0.0
            for k in range(n):
                for j in range(4):
                    lost = lost or values[a, s, k, j] <= 0.0
            out[a, s] = lost
    return out
