"""Stable centres of rotation as polygons in the chain frame.

The COR plane is the central projection of the twist sphere: meridians are lines through the origin, great
circles are straight lines. Strips between neighbouring meridians are joined; what reaches the equator
reaches to infinity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from pushplan.arrays import FloatArray
from pushplan.errors import PushplanError
from pushplan.refined_meridians import RefinedMeridians

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Window = tuple[float, float, float, float]
"""(xmin, ymin, xmax, ymax) in the chain frame, m."""
_DEFAULT_WINDOW = 4.0


def cor_polygons(refined: RefinedMeridians, length: float, sense: int, window: Window | None) -> BaseGeometry:
    """Return the CORs of one sense inside `window`; see `StableSet.cor_region`.

    Raises:
        PushplanError: On another sense than +1 and -1, or an empty window.
    """
    if sense not in (1, -1):
        raise PushplanError(f"sense is {sense}; it must be +1 (counter-clockwise) or -1 (clockwise)")
    box = _box(window, length)
    beyond = 2.0 * float(np.abs(shapely.get_coordinates(box)).max()) * np.sqrt(2.0)
    strips = [shapely.Polygon(outline) for outline in _strips(refined, length, sense, beyond)]
    return shapely.union_all([shapely.make_valid(strip) for strip in strips]).intersection(box)


def _box(window: Window | None, length: float) -> shapely.Polygon:
    if window is None:
        half = _DEFAULT_WINDOW * length
        window = (-half, -half, half, half)
    if not (window[0] < window[2] and window[1] < window[3] and np.isfinite(window).all()):
        raise PushplanError(
            f"window is {window}; it must be (xmin, ymin, xmax, ymax) with xmin < xmax, ymin < ymax"
        )
    return shapely.box(*window)


def _strips(refined: RefinedMeridians, length: float, sense: int, beyond: float) -> list[FloatArray]:
    """Return the outlines (v, 2) of runs of intervals on consecutive meridians."""
    per_meridian = _intervals(refined, sense)
    strips: list[FloatArray] = []
    live: list[list[tuple[float, float, float]]] = []
    for lon, intervals in zip(refined.longitude, per_meridian, strict=True):
        rows = [(float(lon), low, high) for low, high in intervals]
        kept: list[list[tuple[float, float, float]]] = []
        for run in live:
            heirs = [row for row in rows if row[1] < run[-1][2] and run[-1][1] < row[2]]
            if len(heirs) == 1 and sum(_overlap(other[-1], heirs[0]) for other in live) == 1:
                run.append(heirs[0])
                rows.remove(heirs[0])
                kept.append(run)
            else:
                strips.append(_outline(run, length, sense, beyond))
        live = kept + [[row] for row in rows]
    return [s for s in strips + [_outline(run, length, sense, beyond) for run in live] if len(s)]


def _overlap(a: tuple[float, float, float], b: tuple[float, float, float]) -> bool:
    return a[1] < b[2] and b[1] < a[2]


def _intervals(refined: RefinedMeridians, sense: int) -> list[list[tuple[float, float]]]:
    """Return, meridian by meridian, the intervals of |latitude| that turn with `sense`."""
    m = refined.meridians
    low = np.maximum(m.lower if sense > 0 else -m.upper, 0.0)
    high = m.upper if sense > 0 else -m.lower
    out: list[list[tuple[float, float]]] = [[] for _ in refined.longitude]
    for row, at in enumerate(np.searchsorted(refined.longitude, m.longitude)):
        if high[row] > low[row]:
            out[at].append((float(low[row]), float(high[row])))
    return out


def _outline(run: list[tuple[float, float, float]], length: float, sense: int, beyond: float) -> FloatArray:
    """Return the outline (v, 2) of consecutive intervals (longitude, low, high); empty for a single one."""
    if len(run) < 2:
        return np.empty((0, 2))
    lon, low, high = np.array(run).T
    ray = sense * np.stack([-np.sin(lon), np.cos(lon)], axis=1)
    near = length / np.tan(high)
    far = np.where(low > 0.0, length / np.tan(np.maximum(low, 1e-300)), np.inf)
    far = np.where(np.isfinite(far), far, np.maximum(beyond, 2.0 * near))
    return np.concatenate([near[:, None] * ray, (far[:, None] * ray)[::-1]])
