"""The sphere of twist directions: longitude is the direction of translation, latitude the share of rotation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import pushplan.core.sphere as sphere
from pushplan.errors import PushplanError
from pushplan.util.arrays import FloatArray, columns_of, frozen, numbers

POLE = np.pi / 2.0
"""Latitude of a counter-clockwise turn about the chain frame's origin."""


@dataclass(frozen=True, eq=False)
class Meridians:
    """Stable intervals of latitude, one per row; a longitude has none, one or several rows.

    Attributes:
        longitude: Longitudes (k,) in increasing order, rad.
        lower: Lower ends (k,), rad; the margin at both ends exceeds the required one.
        upper: Upper ends (k,), rad, >= lower.
    """

    longitude: FloatArray
    lower: FloatArray
    upper: FloatArray

    def __post_init__(self) -> None:
        for name in ("longitude", "lower", "upper"):
            object.__setattr__(self, name, frozen(getattr(self, name), (len(self.longitude),), name))

    def __len__(self) -> int:
        return len(self.longitude)


class TurningRadii(NamedTuple):
    """Smallest distances from the origin to a stable COR, m; infinite if no turn of that sense is stable.

    Attributes:
        left: Radius of counter-clockwise turns.
        right: Radius of clockwise turns.
    """

    left: float
    right: float


def twists_at(longitude: ArrayLike, latitude: ArrayLike, length: float) -> FloatArray:
    """Return the unit twists (..., 3) at longitudes and latitudes (...)."""
    lon, lat = np.asarray(longitude, dtype=np.float64), np.asarray(latitude, dtype=np.float64)
    flat = np.cos(lat)
    axes = np.broadcast_arrays(flat * np.cos(lon), flat * np.sin(lon), np.sin(lat) / length)
    return np.stack(axes, axis=-1)


def angles_of(twists: ArrayLike, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the longitudes and latitudes (...) of twists (..., 3); the inverse of `twists_at`."""
    v = np.asarray(twists, dtype=np.float64)
    speed = np.hypot(v[..., 0], v[..., 1])
    return np.arctan2(v[..., 1], v[..., 0]), np.arctan2(length * v[..., 2], speed)


def twists_about(cors: ArrayLike, sense: int) -> FloatArray:
    """Return the twists (..., 3) with omega = `sense`, +1 or -1, about centres of rotation (..., 2).

    The velocity of the origin is v = -omega J c.
    """
    if sense not in (1, -1):
        raise PushplanError(f"sense is {sense}; it must be +1 (counter-clockwise) or -1 (clockwise)")
    c = np.asarray(cors, dtype=np.float64)
    return np.stack([sense * c[..., 1], -sense * c[..., 0], np.full(c.shape[:-1], float(sense))], axis=-1)


def checked_twists(twists: ArrayLike) -> FloatArray:
    """Return `twists` as a contiguous (k, 3) float array.

    Raises:
        PushplanError: If the shape is another, a number is not finite, or a twist is zero.
    """
    v = np.ascontiguousarray(numbers(twists, "twists"))
    if v.ndim != 2 or v.shape[1] != 3:
        raise PushplanError(f"twists have shape {v.shape}; it must be (k, 3): vx, vy, omega")
    if not np.isfinite(v).all():
        raise PushplanError("a twist holds a number that is not finite")
    resting = ~columns_of(v).any(axis=0)
    if resting.any():
        raise PushplanError(f"twist {int(resting.argmax())} is zero; allowed: nonzero twists")
    return v


WORTHWHILE = 0.7
"""Share of distinct directions above which copying results takes as long as computing all of them."""


def by_direction(values: Callable[[FloatArray], FloatArray], twists: FloatArray, length: float) -> FloatArray:
    """Return `values` (m, ...) of twists (m, 3), computed once for adjacent twists of the same direction.

    Args:
        values: Function that depends only on the directions of twists.
        twists: Nonzero twists (m, 3).
        length: Characteristic length that multiplies angular velocities in the comparison, m.
    """
    owner, first = sphere.directions(twists, length)
    if len(first) > WORTHWHILE * len(twists):
        return values(twists)
    return np.asarray(values(twists[first])[owner])
