"""Computes regions of centres of rotation as polygons in the chain frame."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import shapely

from pushplan.errors import PushplanError
from pushplan.sets.boundary import RefinedMeridians
from pushplan.util.arrays import FloatArray, IntArray, numbers

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


def velocity_rows(forces: FloatArray, points: FloatArray, length: float) -> FloatArray:
    """Return the rows (..., 3) of gamma . v(x) for directions gamma (..., 2) at points x (..., 2).

    The velocity is v(x) = v + omega J x.
    """
    turn = forces[..., 1] * points[..., 0] - forces[..., 0] * points[..., 1]
    return np.stack(np.broadcast_arrays(forces[..., 0], forces[..., 1], turn / length), axis=-1)


def unit_rows(rows: FloatArray, scale: float) -> FloatArray:
    """Return rows (m, 3) scaled to length 1; rows that are rounding errors relative to `scale` become 0."""
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    kept = size > 1e-12 * scale
    return np.where(kept, rows / np.where(kept, size, 1.0), 0.0)


def smallest_sines(rows: FloatArray, owner: IntArray, twists: FloatArray, length: float) -> FloatArray:
    """Return the sine (k, n) of the angle of twists (k, 3) to the nearest great circle of each contact.

    Args:
        rows: Unit rows (m, 3).
        owner: Contact (m,) of each row, in increasing order, every contact at least once.
        twists: Nonzero twists (k, 3) in the chain frame.
        length: Characteristic length, m.
    """
    scaled = twists * [1.0, 1.0, length]
    scaled = scaled / np.abs(scaled).max(axis=1, keepdims=True)  # the square of a slow twist can be 0
    values = (scaled / np.linalg.norm(scaled, axis=1, keepdims=True)) @ rows.T
    return np.asarray(np.minimum.reduceat(values, np.searchsorted(owner, np.unique(owner)), axis=1))


def cor_polygon(rows: FloatArray, length: float, sense: int, window: Window | None) -> BaseGeometry:
    """Return the CORs of one sense that satisfy all rows (m, 3), inside `window`: a convex polygon.

    Raises:
        PushplanError: If the sense is not +1 or -1, or the window is empty.
    """
    if sense not in (1, -1):
        raise PushplanError(f"sense is {sense}; it must be +1 (counter-clockwise) or -1 (clockwise)")
    box = window_box(window, length)
    corners = shapely.get_coordinates(box)[:-1]
    normals = sense * np.stack([-rows[:, 1], rows[:, 0]], axis=1)
    offsets = sense * length * rows[:, 2]
    for normal, offset in zip(normals, offsets, strict=True):
        corners = _clipped(corners, corners @ normal + offset)
    polygon = shapely.Polygon(corners) if len(corners) > 2 else shapely.Polygon()
    return polygon if polygon.area > 1e-14 * box.area else shapely.Polygon()


def _clipped(corners: FloatArray, height: FloatArray) -> FloatArray:
    """Return the part (v, 2) of a convex polygon (u, 2) with a positive linear function `height` (u,)."""
    if not (height > 0.0).any():
        return np.empty((0, 2))
    parts = []
    for p, q, a, b in zip(corners, np.roll(corners, -1, axis=0), height, np.roll(height, -1), strict=True):
        if a >= 0.0:
            parts.append(p)
        if a * b < 0.0:
            parts.append(p + (q - p) * (a / (a - b)))
    return np.array(parts)


Window = tuple[float, float, float, float]
"""(xmin, ymin, xmax, ymax) in the chain frame, m."""


def cor_polygons(refined: RefinedMeridians, length: float, sense: int, window: Window | None) -> BaseGeometry:
    """Return the CORs of one sense inside `window`; see `StableSet.cor_region`.

    Raises:
        PushplanError: If the sense is not +1 or -1, or the window is empty.
    """
    if sense not in (1, -1):
        raise PushplanError(f"sense is {sense}; it must be +1 (counter-clockwise) or -1 (clockwise)")
    box = window_box(window, length)
    # Strips extend so far beyond the window that the missing parts inside it are rounding errors.
    reach = 1e6 * float(np.abs(shapely.get_coordinates(box)).max())
    strips = [shapely.Polygon(outline) for outline in _strips(refined, length, sense, reach)]
    return shapely.union_all([shapely.make_valid(strip) for strip in strips]).intersection(box)


def window_box(window: Window | None, length: float) -> shapely.Polygon:
    """Return the window (None: the default one) as a box.

    Raises:
        PushplanError: If the window is empty.
    """
    if window is None:
        half = 4.0 * length
        window = (-half, -half, half, half)
    ends = numbers(window, "window")
    if ends.shape != (4,) or not (np.isfinite(ends).all() and (ends[:2] < ends[2:]).all()):
        raise PushplanError(f"window is {window}; it must be (xmin, ymin, xmax, ymax) with xmin < xmax, ymin < ymax")
    return shapely.box(*window)


def _strips(refined: RefinedMeridians, length: float, sense: int, reach: float) -> list[FloatArray]:
    """Return the outlines (v, 2) of the stable CORs of one sense, bounded by `reach`."""
    parts = [part for run in _runs(refined) for part in _turning(run, sense)]
    return [_outline(part, length, sense, reach) for part in parts if len(part) > 1]


def _runs(refined: RefinedMeridians) -> list[FloatArray]:
    """Return sequences (r, 3) of longitude, lower and upper end that continue from meridian to meridian."""
    done: list[list[FloatArray]] = []
    live: list[list[FloatArray]] = []
    for block in _blocks(refined):
        pairs = _pairs([run[-1][-1] for run in live], block[0])
        continued = {i: block[:, j] for i, j in pairs}
        done += [run for i, run in enumerate(live) if i not in continued]
        grown = [[*run, continued[i]] for i, run in enumerate(live) if i in continued]
        taken = {j for _, j in pairs}
        live = grown + [[block[:, j]] for j in range(block.shape[1]) if j not in taken]
        live.sort(key=lambda run: float(run[-1][-1, 1]))
    return [np.concatenate(run) for run in done + live]


def _blocks(refined: RefinedMeridians) -> list[FloatArray]:
    """Return blocks (m, c, 3) of neighbouring meridians with the same number c of intervals."""
    rows = refined.meridians
    table = np.column_stack([rows.longitude, rows.lower, rows.upper])
    first = np.append(np.searchsorted(rows.longitude, refined.longitude), len(table))
    count = np.diff(first)
    edges = [0, *(np.flatnonzero(np.diff(count)) + 1), len(count)]
    return [table[first[a] : first[b]].reshape(b - a, count[a], 3) for a, b in pairwise(edges)]


def _pairs(old: list[FloatArray], new: FloatArray) -> list[tuple[int, int]]:
    """Return pairs of intervals that continue: in order, or by overlap if some of them begin, end or merge."""
    if len(old) == len(new):
        return [(j, j) for j in range(len(new))]
    overlap = np.array([[a[1] < b[2] and b[1] < a[2] for b in new] for a in old], dtype=np.bool_)
    overlap = overlap.reshape(len(old), len(new))
    single = overlap & (overlap.sum(axis=0) == 1)[None, :] & (overlap.sum(axis=1) == 1)[:, None]
    return [(int(i), int(j)) for i, j in np.argwhere(single)]


def _turning(run: FloatArray, sense: int) -> list[FloatArray]:
    """Return the parts (r, 3) of a run that turn with `sense`: longitude, lower and upper tan |latitude|.

    If an end crosses the equator between two meridians, a row is inserted at the crossing.
    """
    lon, low, high = run[:, 0], np.tan(run[:, 1]), np.tan(run[:, 2])
    if sense < 0:
        low, high = -high, -low
    rows = np.column_stack([lon, low, high])
    for column in (1, 2):
        rows = _with_crossings(rows, column)
    turning = np.maximum(rows, [-np.inf, 0.0, 0.0])
    inside = np.concatenate([[False], rows[:, 2] > 0.0, [False]])
    starts, stops = np.flatnonzero(~inside[:-1] & inside[1:]), np.flatnonzero(inside[:-1] & ~inside[1:])
    return [turning[max(a - 1, 0) : b + 1] for a, b in zip(starts, stops, strict=True)]


def _with_crossings(rows: FloatArray, column: int) -> FloatArray:
    """Return the rows with a new row at every longitude where `column` crosses 0 along a great circle."""
    a, b = rows[:-1], rows[1:]
    k = np.flatnonzero(a[:, column] * b[:, column] < 0.0)
    gap = b[k, 0] - a[k, 0]
    first, last = np.abs(a[k, column]), np.abs(b[k, column])
    at = np.arctan2(first * np.sin(gap), first * np.cos(gap) + last)
    share = np.column_stack([np.sin(gap - at), np.sin(at)]) / np.sin(gap)[:, None]
    new = share[:, :1] * a[k] + share[:, 1:] * b[k]
    new[:, 0], new[:, column] = a[k, 0] + at, 0.0
    return np.insert(rows, k + 1, new, axis=0)


def _outline(part: FloatArray, length: float, sense: int, reach: float) -> FloatArray:
    """Return the outline (v, 2) of consecutive rows of longitude, lower and upper tan |latitude|."""
    lon, low, high = part.T
    ray = sense * np.stack([-np.sin(lon), np.cos(lon)], axis=1)
    near, far = (np.minimum(length / np.maximum(end, 1e-300), reach) for end in (high, low))
    return np.concatenate([near[:, None] * ray, (far[:, None] * ray)[::-1]])
