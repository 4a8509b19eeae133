"""Local maxima of a margin on the twist sphere, so that no component of a stable set is overlooked."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import compiled
from pushplan.mechanics.sphere import POLE, twists_at
from pushplan.sets.boundary.asked import MarginFunction
from pushplan.util.arrays import FloatArray, IntArray

FLOOR = -0.8
_SHAPE = (96, 49)
_STEPS = 48
_STEEPEST = 1e3
"""Slope of a margin, 1/rad, above which no peak is hoped for."""
_SPOKES = 8
_TURN = np.pi * (3.0 - np.sqrt(5.0))


class SphereSamples(NamedTuple):
    """Margins at equally spaced places.

    Attributes:
        longitude: (n + 1,) from -pi to pi, rad.
        latitude: (s,) from pole to pole, rad.
        value: (n + 1, s) margins, exact above the floor.
    """

    longitude: FloatArray
    latitude: FloatArray
    value: FloatArray

    @classmethod
    def of(cls, margin: MarginFunction, length: float, floor: float, shape: tuple[int, int]) -> SphereSamples:
        """Return the margins of a set with a characteristic length, m, at so many longitudes and latitudes."""
        longitude, latitude = np.linspace(-np.pi, np.pi, shape[0] + 1), np.linspace(-POLE, POLE, shape[1])
        twists = twists_at(longitude[:-1, None], latitude[None, :], length)
        value = margin(twists.reshape(-1, 3), floor).reshape(shape)
        return cls(longitude, latitude, np.concatenate([value, value[:1]]))

    def maxima(self, floor: float) -> tuple[FloatArray, FloatArray]:
        """Return unit vectors (m, 3) and values (m,) of samples above the floor that no neighbour exceeds."""
        value = self.value[:-1]
        rows = np.maximum(np.maximum(np.roll(value, 1, axis=0), value), np.roll(value, -1, axis=0))
        beside = np.pad(rows, ((0, 0), (1, 1)), mode="edge")
        most = np.maximum(np.maximum(beside[:, :-2], rows), beside[:, 2:])
        highest = (value >= most) & (value > floor)
        highest[1:, [0, -1]] = False  # all longitudes meet at the poles
        i, j = np.nonzero(highest)
        return twists_at(self.longitude[i], self.latitude[j], 1.0), value[i, j]

    def on_meridians(self, floor: float) -> FloatArray:
        """Return the samples (k, 3) of longitudes where one is above the floor: index, latitude and value."""
        hope = np.flatnonzero(self.value.max(axis=1) > floor)
        latitude = np.tile(self.latitude, len(hope))
        return np.column_stack([np.repeat(hope, len(self.latitude)), latitude, self.value[hope].ravel()])


def margin_peaks(margin: MarginFunction, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the local maxima of a margin as unit twists (m, 3) and values (m,)."""
    at, values = SphereSamples.of(margin, length, FLOOR, _SHAPE).maxima(FLOOR)
    climb(margin, length, at, values, np.pi / _SHAPE[1])
    return at / [1.0, 1.0, length], values


def climb(
    margin: MarginFunction,
    length: float,
    at: FloatArray,
    values: FloatArray,
    first_step: float,
    goal: float = np.inf,
) -> None:
    """Move unit vectors (m, 3) with margins (m,) uphill, each until it is above the goal or cannot get there.

    It is a pattern search whose directions turn, as margins have ridges: they are minima of many functions.
    """
    step = np.full(len(at), first_step)
    for k in range(_STEPS):
        live = np.flatnonzero((values <= goal) & (values > goal - _STEEPEST * step) | np.isinf(goal))
        if len(live) == 0:
            break
        around = _neighbours(at, step, live, k * _TURN)
        _move(at, values, step, live, around, margin(around / [1.0, 1.0, length], -2.0))


@compiled
def _neighbours(at: FloatArray, step: FloatArray, live: IntArray, turn: float) -> FloatArray:
    """Return unit vectors (8 m, 3) at angles `step` around m of the unit vectors."""
    out, spoke = np.empty((len(live) * _SPOKES, 3)), np.empty(3)
    for j in range(len(out)):
        i, angle = live[j // _SPOKES], turn + 2.0 * math.pi * (j % _SPOKES) / _SPOKES
        x, y, z = at[i]
        flat = abs(z) < 0.7
        size = math.sqrt(x * x + y * y) if flat else math.sqrt(y * y + z * z)
        ex, ey, ez = (-y / size, x / size, 0.0) if flat else (0.0, -z / size, y / size)
        north = y * ez - z * ey, z * ex - x * ez, x * ey - y * ex
        spoke[0], spoke[1], spoke[2] = ex, ey, ez
        for axis in range(3):
            spoke[axis] = math.cos(angle) * spoke[axis] + math.sin(angle) * north[axis]
            out[j, axis] = math.cos(step[i]) * at[i, axis] + math.sin(step[i]) * spoke[axis]
    return out


@compiled
def _move(
    at: FloatArray,
    values: FloatArray,
    step: FloatArray,
    live: IntArray,
    around: FloatArray,
    found: FloatArray,
) -> None:
    """Go to the highest of the neighbours, or look closer."""
    for j in range(len(live)):
        i, best = live[j], j * _SPOKES
        for k in range(best, best + _SPOKES):
            best = k if found[k] > found[best] else best
        if found[best] > values[i]:
            values[i] = found[best]
            for axis in range(3):
                at[i, axis] = around[best, axis]
        else:
            step[i] *= 0.6
