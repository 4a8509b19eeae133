"""Algorithm 1 as Harada et al. 2006 state it: a grid over the COR plane, friction by numerical integration.

For pictures and comparison; `EcofSet` answers the same question exactly and faster.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.errors import PushplanError, SupportError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Chain, Contact, PushedObject
from pushplan.mechanics.contacts import carried_objects
from pushplan.sets.cor import Window, window_box
from pushplan.util.arrays import BoolArray, FloatArray, frozen

_CHUNK = 1000


@dataclass(frozen=True, eq=False)
class GridCorSet:
    """Which cells of the COR plane are stable.

    Attributes:
        x: (nx,) centres of the cells, chain frame, m.
        y: (ny,) likewise.
        counter_clockwise: (ny, nx) whether turning counter-clockwise about a cell's centre is stable.
        clockwise: (ny, nx) likewise.
    """

    x: FloatArray
    y: FloatArray
    counter_clockwise: BoolArray
    clockwise: BoolArray


def grid_cor_set(
    chain: Chain, window: Window, shape: tuple[int, int] = (200, 200), elements: int = 1000
) -> GridCorSet:
    """Return the stable cells of a window of the COR plane.

    Args:
        chain: Objects and contacts; the loads must be known, and the pusher push at the floor.
        window: (xmin, ymin, xmax, ymax) in the chain frame, m.
        shape: Number of cells along x and along y.
        elements: About how many elements an object's support polygon is cut into.

    Raises:
        PushplanError: On an empty window, a shape or number of elements below 1, or a pusher that pushes above
            the floor.
        SupportError: When a load is not known.
    """
    if min(*shape, elements) < 1:
        raise PushplanError(f"shape {shape} and {elements} elements must be at least 1")
    if chain.contact_heights.any():
        raise PushplanError("Algorithm 1 on a grid is for a push at the floor; contact_height must be 0")
    low_x, low_y, high_x, high_y = window_box(window, 1.0).bounds
    x = low_x + (np.arange(shape[0]) + 0.5) * (high_x - low_x) / shape[0]
    y = low_y + (np.arange(shape[1]) + 0.5) * (high_y - low_y) / shape[1]
    cors = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    turning = _ecof_velocities(chain, cors, elements)
    stable = []
    for sense in (+1.0, -1.0):
        holds = [_holds(c, cors + arm, sense * v) for c, (arm, v) in zip(chain.contacts, turning, strict=True)]
        stable.append(np.logical_and.reduce(holds).reshape(shape[1], shape[0]))
    for cells in stable:
        cells.setflags(write=False)
    return GridCorSet(frozen(x, (None,), "x"), frozen(y, (None,), "y"), stable[0], stable[1])


def _ecof_velocities(chain: Chain, cors: FloatArray, elements: int) -> list[tuple[FloatArray, FloatArray]]:
    """Return, contact by contact, ECOF - c (m, 2) of all it carries, and its velocity (m, 2) at omega = 1.

    With G the sum of r / |r| and Q that of |r| over the elements' friction loads, r = x - c, the friction force is
    -J G and its moment about c is -Q, so that ECOF - c = Q G / |G|^2 (appendix of the paper).
    """
    sums = np.array([_of_object(cors, obj, elements) for obj in chain.objects])
    result = []
    for behind in carried_objects(chain):
        total = sums[behind].sum(axis=0)
        g, q = total[:, :2], total[:, 2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            arm = q * g / (g * g).sum(axis=1, keepdims=True)
        result.append((arm, np.stack([-arm[:, 1], arm[:, 0]], axis=1)))
    return result


def _of_object(cors: FloatArray, obj: PushedObject, count: int) -> FloatArray:
    """Return `_sums` over about `count` elements of one object's friction load."""
    if not obj.support.known:
        raise SupportError(f"the load under {obj.name!r} is unknown; integrating its friction needs a known one")
    places, parts = obj.support.elements(count)
    return _sums(cors, transform_points(obj.pose_chain, places), parts) * obj.friction_load


def _sums(cors: FloatArray, points: FloatArray, parts: FloatArray) -> FloatArray:
    """Return the sums (m, 3) of r / |r| and |r| over elements, for CORs (m, 2)."""
    out = np.empty((len(cors), 3))
    for first in range(0, len(cors), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        rx = points[:, 0] - cors[chunk, :1]
        ry = points[:, 1] - cors[chunk, 1:]
        distance = np.sqrt(rx * rx + ry * ry)
        inverse = parts / np.where(distance > 0.0, distance, np.inf)
        out[chunk, 0] = (rx * inverse).sum(axis=1)
        out[chunk, 1] = (ry * inverse).sum(axis=1)
        out[chunk, 2] = distance @ parts
    return out


def _holds(contact: Contact, ecof: FloatArray, velocity: FloatArray) -> BoolArray:
    """Return (m,) whether a contact can transmit forces along velocities (m, 2) through ECOFs (m, 2).

    [C1]: the velocity is inside the friction cone. [C2]: moments about the two ends have opposite signs. Where
    there is no ECOF, neither holds.
    """
    forward, sideways = velocity @ contact.normal, velocity @ contact.tangent
    inside = np.abs(sideways) < contact.friction * forward
    right, left = ecof - contact.right, ecof - contact.left
    about_right = right[:, 0] * velocity[:, 1] - right[:, 1] * velocity[:, 0]
    about_left = left[:, 0] * velocity[:, 1] - left[:, 1] * velocity[:, 0]
    return np.asarray(inside & (about_right < 0.0) & (about_left > 0.0), dtype=np.bool_)
