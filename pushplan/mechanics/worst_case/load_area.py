"""What can be said about a load when only its centre and the points that may carry it are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pushplan.errors import SupportError
from pushplan.geometry.se2 import transform_points
from pushplan.mechanics.chain import Chain, PushedObject
from pushplan.mechanics.support import FeetSupport
from pushplan.util.arrays import FloatArray, frozen


@dataclass(frozen=True, eq=False)
class LoadArea:
    """Any pressure with a given centre, in the chain frame.

    Attributes:
        points: (m, 2) feet, or the corners of a convex polygon, counter-clockwise, m.
        solid: Whether the whole polygon may carry load, or only its corners.
        center: (2,) centre of the load at rest, m.
        shift: h mu (m): by how much a push at height h moves that centre, against the friction force, when
            the whole load slides in one direction.
    """

    points: FloatArray
    solid: bool
    center: FloatArray
    shift: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, (None, 2), "points that may carry load"))
        object.__setattr__(self, "center", frozen(self.center, (2,), "centre of a load"))


def load_area(obj: PushedObject, contact_height: float = 0.0) -> LoadArea:
    """Return where the load of `obj` may rest: its feet, or the convex hull of its support.

    Args:
        obj: The object; a load that is known counts by its centre alone.
        contact_height: Height of the contact forces above the floor, m.

    Raises:
        SupportError: When a push at that height could tip the object.
    """
    support = obj.support
    points = support.positions if isinstance(support, FeetSupport) else support.hull
    solid = not isinstance(support, FeetSupport) and len(points) > 2
    shift = contact_height * obj.floor_friction
    center = transform_points(obj.pose_chain, support.center)
    if shift > 0.0:
        _require_standing(obj, transform_points(obj.pose_chain, support.hull), center, contact_height)
    return LoadArea(transform_points(obj.pose_chain, points), solid, center, shift)


def load_areas(chain: Chain) -> tuple[LoadArea, ...]:
    """Return the load area of every object; see `load_area`."""
    return tuple(load_area(obj, chain.pusher.contact_height) for obj in chain.objects)


def _require_standing(obj: PushedObject, hull: FloatArray, center: FloatArray, height: float) -> None:
    """Raise SupportError unless the load's centre stays in `hull` (h, 2) wherever friction may move it."""
    room = _room(hull, center) if len(hull) > 2 else 0.0
    highest = room / obj.floor_friction
    if height > highest * (1.0 + 1e-9):
        raise SupportError(
            f"a push at height {height:.6g} m could tip {obj.name!r}: the load's centre moves by up to "
            f"{height * obj.floor_friction:.6g} m and is {max(room, 0.0):.6g} m inside the support; the contact "
            f"height must be at most {max(highest, 0.0):.6g} m"
        )


def _room(hull: FloatArray, center: FloatArray) -> float:
    """Return how far a point (2,) is inside a convex polygon (h, 2), m."""
    step = np.roll(hull, -1, axis=0) - hull
    normal = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.linalg.norm(step, axis=1, keepdims=True)
    return float(((hull - center) * normal).sum(axis=1).min())
