"""The part of the plane of centres of rotation that pictures and exports show by default."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite

import numpy as np

from pushplan.mechanics.chain import Chain
from pushplan.sets.cor import Window
from pushplan.sets.stable_set import StableSet

_SHOWN_RADII = 2.2
"""How many smallest turning radii are shown to either side."""
_ASPECT = 0.7
"""Least width of the window over its height."""
_PAD = 0.04


def default_window(chain: Chain, sets: Iterable[StableSet]) -> Window:
    """Return a window that holds the whole chain and the tightest turns to both sides of all `sets`."""
    points = np.concatenate([body.outline for body in chain.bodies])
    low, high = points.min(axis=0), points.max(axis=0)
    radii = [each.turning_radii() for each in sets]
    top = max(high[1], *(_SHOWN_RADII * r.left for r in radii if isfinite(r.left)), 0.0)
    bottom = min(low[1], *(-_SHOWN_RADII * r.right for r in radii if isfinite(r.right)), 0.0)
    height = (1.0 + 2.0 * _PAD) * (top - bottom)
    width = max((1.0 + 2.0 * _PAD) * (high[0] - low[0]), _ASPECT * height)
    x, y = 0.5 * (low[0] + high[0]), 0.5 * (bottom + top)
    return (float(x - width / 2), float(y - height / 2), float(x + width / 2), float(y + height / 2))


def grown(window: Window, share: float) -> Window:
    """Return the window with `share` of its width and height added on every side."""
    dx, dy = share * (window[2] - window[0]), share * (window[3] - window[1])
    return (window[0] - dx, window[1] - dy, window[2] + dx, window[3] + dy)
