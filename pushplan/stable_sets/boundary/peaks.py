"""Local maxima of a margin on the twist sphere, so that no component of a stable set is overlooked."""

from __future__ import annotations

import numpy as np

from pushplan.basics.arrays import FloatArray
from pushplan.mechanics.sphere import POLE, twists_at
from pushplan.stable_sets.boundary.meridians import MarginFunction

LONGITUDES, LATITUDES = 96, 49
FLOOR = -0.8
_STEPS = 48
SPOKES = 8
TURN = np.pi * (3.0 - np.sqrt(5.0))


def margin_peaks(margin: MarginFunction, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the local maxima of a margin as unit twists (m, 3) and values (m,).

    Starts from the maxima among samples and climbs by a pattern search whose directions turn, as margins have
    ridges: they are minima of many functions.
    """
    at = _sampled_maxima(margin, length)
    scale = np.array([1.0, 1.0, length])
    values = margin(at / scale, -2.0)
    step = np.full(len(at), np.pi / LATITUDES)
    rows = np.arange(len(at))
    for k in range(_STEPS):
        around = _neighbours(at, step, k * TURN)
        found = margin(around.reshape(-1, 3) / scale, -2.0).reshape(len(at), SPOKES)
        best = found.argmax(axis=1)
        better = found[rows, best] > values
        at = np.where(better[:, None], around[rows, best], at)
        values = np.where(better, found[rows, best], values)
        step = np.where(better, step, 0.6 * step)
    return at / scale, values


def _sampled_maxima(margin: MarginFunction, length: float) -> FloatArray:
    """Return the unit vectors (m, 3) of samples that none of their eight neighbours exceeds."""
    lon = 2.0 * np.pi * np.arange(LONGITUDES) / LONGITUDES
    lat = np.linspace(-POLE, POLE, LATITUDES)
    twists = twists_at(lon[:, None], lat[None, :], length)
    values = margin(twists.reshape(-1, 3), FLOOR).reshape(LONGITUDES, LATITUDES)
    padded = np.pad(np.pad(values, ((1, 1), (0, 0)), mode="wrap"), ((0, 0), (1, 1)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    highest = (values >= windows.max(axis=(2, 3))) & (values > FLOOR)
    highest[1:, [0, -1]] = False  # all longitudes meet at the poles
    return np.asarray(twists[highest] * [1.0, 1.0, length], dtype=np.float64)


def _neighbours(at: FloatArray, step: FloatArray, turn: float) -> FloatArray:
    """Return unit vectors (m, SPOKES, 3) around unit vectors (m, 3) at angles (m,)."""
    axis = np.where(np.abs(at[:, [2]]) < 0.7, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    east = np.cross(axis, at)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    north = np.cross(at, east)
    angle = turn + 2.0 * np.pi * np.arange(SPOKES) / SPOKES
    spokes = (
        np.cos(angle)[None, :, None] * east[:, None, :] + np.sin(angle)[None, :, None] * north[:, None, :]
    )
    step = step[:, None, None]
    return np.asarray(np.cos(step) * at[:, None, :] + np.sin(step) * spokes, dtype=np.float64)
