"""A longitude in every component of a stable set, compiled: `peaks` for compiled margins, as far as it is needed."""

from __future__ import annotations

import math

import numpy as np

from pushplan.basics.arrays import BoolArray, FloatArray
from pushplan.compiled import compiled, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.mechanics.sphere import POLE
from pushplan.stable_sets.boundary.margin_kernel import Packed, margin_of
from pushplan.stable_sets.boundary.peaks import SPOKES, TURN

LONGITUDES, LATITUDES = 72, 37
"""Samples, 5 degrees apart."""
HOPE = 0.35
"""No component is looked for around samples that fall short of the margin asked for by more than this."""
_SHRINK = 0.6
_STEEPEST = 1e3
"""Slope of a margin, 1/rad, above which no peak is hoped for."""
_LAST_STEP = 1e-9


@compiled
def _value(packed: Packed, length: float, at: FloatArray, floor: float) -> float:
    """Return the margin at a unit vector (3,)."""
    return margin_of(packed, at[0], at[1], at[2] / length, floor)


@compiled
def _climbs(packed: Packed, length: float, minimum: float, at: FloatArray, value: float) -> bool:
    """Move a unit vector (3,) uphill by a pattern search whose directions turn; return whether that is enough."""
    step, turn = math.pi / LATITUDES, 0.0
    vectors = scratch(4, 3)
    east, north, best, trial = vectors[0], vectors[1], vectors[2], vectors[3]
    while step > _LAST_STEP and value > minimum - _STEEPEST * step:
        if value > minimum:
            return True
        _tangents(at, east, north)
        highest = value
        for k in range(SPOKES):
            angle = turn + 2.0 * math.pi * k / SPOKES
            for j in range(3):
                spoke = math.cos(angle) * east[j] + math.sin(angle) * north[j]
                trial[j] = math.cos(step) * at[j] + math.sin(step) * spoke
            found = _value(packed, length, trial, highest)
            if found > highest:
                highest = found
                for j in range(3):
                    best[j] = trial[j]
        turn += TURN
        if highest > value:
            value = highest
            for j in range(3):
                at[j] = best[j]
        else:
            step *= _SHRINK
    return value > minimum


@no_refcount
def _tangents(at: FloatArray, east: FloatArray, north: FloatArray) -> None:
    """Fill in two unit vectors (3,) perpendicular to a unit vector and to each other."""
    x, y, z = at
    if abs(z) < 0.7:
        size = math.sqrt(x * x + y * y)
        east[0], east[1], east[2] = -y / size, x / size, 0.0
    else:
        size = math.sqrt(y * y + z * z)
        east[0], east[1], east[2] = 0.0, -z / size, y / size
    for j in range(3):
        a, b = (j + 1) % 3, (j + 2) % 3
        north[j] = at[a] * east[b] - at[b] * east[a]


@compiled
def seeds(packed: Packed, length: float, minimum: float) -> tuple[FloatArray, BoolArray]:
    """Return a longitude in every component of margins above `minimum`, and where to look for more.

    Returns:
        Longitudes (s,) to which samples led, and whether there is hope at each of LONGITUDES equally spaced ones from
        0 on.
    """
    values, floor = np.empty((LONGITUDES, LATITUDES)), minimum - HOPE
    out, count, hope = np.empty(LONGITUDES * LATITUDES), 0, np.zeros(LONGITUDES, dtype=np.bool_)
    at = np.empty(3)
    for i in range(LONGITUDES):
        for j in range(LATITUDES):
            _sample(i, j, at)
            values[i, j] = _value(packed, length, at, floor)
            hope[i] |= values[i, j] > floor
    for i in range(LONGITUDES):
        for j in range(LATITUDES):
            if values[i, j] > floor and _is_peak(values, i, j):
                _sample(i, j, at)
                if _climbs(packed, length, minimum, at, values[i, j]):
                    out[count], count = math.atan2(at[1], at[0]), count + 1
    return out[:count], hope


@no_refcount
def is_hopeful(hope: BoolArray, longitude: float) -> bool:
    """Return whether there is hope at one of the sampled longitudes to both sides."""
    i = math.floor(longitude * LONGITUDES / (2.0 * math.pi))
    return bool(hope[i % LONGITUDES] or hope[(i + 1) % LONGITUDES])


@no_refcount
def _sample(i: int, j: int, at: FloatArray) -> None:
    """Fill in the unit vector (3,) of a sample."""
    lon, lat = 2.0 * math.pi * i / LONGITUDES, -POLE + 2.0 * POLE * j / (LATITUDES - 1)
    at[0], at[1], at[2] = math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)


@no_refcount
def _is_peak(values: FloatArray, i: int, j: int) -> bool:
    """Return whether none of the eight neighbours of a sample exceeds it; of those at a pole, one counts."""
    if i > 0 and (j == 0 or j == LATITUDES - 1):
        return False
    for di in range(-1, 2):
        for dj in range(-1, 2):
            row = min(max(j + dj, 0), LATITUDES - 1)
            if values[(i + di) % LONGITUDES, row] > values[i, j]:
                return False
    return True
