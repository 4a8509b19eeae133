"""The part of the plane of centres of rotation that pictures and exports show by default."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite

import numpy as np
import shapely

from pushplan.mechanics.chain import Chain
from pushplan.sets.cor import Window
from pushplan.sets.stable_set import StableSet
from pushplan.util.arrays import FloatArray

_SHOWN_RADII = 2.2
"""How many smallest turning radii are shown to either side."""
_SHOWN_RADIUS = 1.3
"""Of the tightest turn of the drive that is stable, so much of its radius is shown, if it is not too wide."""
_ASPECT = 0.7
"""Least width of the window over its height."""
_PAD = 0.04


def default_window(chain: Chain, sets: Iterable[StableSet]) -> Window:
    """Return a window that holds the chain and the tightest turns to both sides, of all `sets` and of the drive."""
    sets, drive = list(sets), chain.pusher.drive
    outlines = [body.outline for body in chain.bodies]
    radii = [each.turning_radii() for each in sets]
    left = [_SHOWN_RADII * r.left for r in radii if isfinite(r.left)]
    right = [_SHOWN_RADII * r.right for r in radii if isfinite(r.right)]
    turns = np.array([[0.0, max(left, default=0.0)], [0.0, -max(right, default=0.0)]])
    window = _around([*outlines, turns])
    wider, far = grown(window, 0.5), 2.0 * float(np.hypot(window[2] - window[0], window[3] - window[1]))
    for sense, line in zip((+1, -1), drive.turning_centres(far), strict=False):
        regions = [each.cor_region(sense, wider).intersection(shapely.LineString(line)) for each in sets]
        nearest = min((one.distance(shapely.Point(line[0])) for one in regions if not one.is_empty), default=0.0)
        outlines.append(line[0] + _SHOWN_RADIUS * nearest * (line[1] - line[0]) / np.hypot(*(line[1] - line[0])))
    return _around([*outlines, turns])


def _around(outlines: list[FloatArray]) -> Window:
    points = np.concatenate([np.atleast_2d(outline) for outline in outlines])
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = (1.0 + 2.0 * _PAD) * (high - low)
    (x, y), width = 0.5 * (low + high), max(width, _ASPECT * height)
    return (float(x - width / 2), float(y - height / 2), float(x + width / 2), float(y + height / 2))


def grown(window: Window, share: float) -> Window:
    """Return the window with `share` of its width and height added on every side."""
    dx, dy = share * (window[2] - window[0]), share * (window[3] - window[1])
    return (window[0] - dx, window[1] - dy, window[2] + dx, window[3] + dy)
