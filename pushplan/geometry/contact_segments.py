"""Where two outlines touch: along a line, at single points, or not at all."""

from __future__ import annotations

import numpy as np
import shapely

from pushplan.util.arrays import FloatArray

TOUCH = 1e-6
"""Distance up to which bodies touch, and depth up to which they do not overlap, m."""

SHORTEST_CONTACT = 1e-4
"""Length below which a contact counts as a point, m."""


def find_touch(first: FloatArray, second: FloatArray) -> FloatArray | None:
    """Return along which segments two counter-clockwise outlines (v, 2) in one frame touch, or None if they do not.

    Segments (k, 2, 2), one per straight line, go from right to left of the normal that points from the first outline
    into the second, m; there are none where the outlines touch at points only. Pieces of contact on one straight line
    count as one segment from end to end: forces at the ends of that segment span the forces of all of them.
    """
    if _gap(first, second) > TOUCH:
        return None
    pieces = _shared_pieces(first, second)
    return np.array([_hull(group) for group in _lines(pieces)]).reshape(-1, 2, 2)


def _gap(first: FloatArray, second: FloatArray) -> float:
    """Return the distance of two outlines, or a lower bound of it that is above `TOUCH`."""
    low, high = first.min(axis=0) - second.max(axis=0), second.min(axis=0) - first.max(axis=0)
    apart = float(max(low.max(), high.max()))
    return (
        apart if apart > TOUCH else float(shapely.distance(shapely.Polygon(first), shapely.Polygon(second)))
    )


def _shared_pieces(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the parts (k, 2, 2) of edges of `first` on which edges of `second` lie, facing the other way."""
    begin, edge = first, np.roll(first, -1, axis=0) - first
    length = np.linalg.norm(edge, axis=1)
    along = edge / length[:, None]
    ends = np.stack([np.roll(second, -1, axis=0), second])  # reversed, so that facing edges run the same way
    offset = ends[:, None] - begin[:, None]  # (2, edges of first, edges of second, 2)
    s = np.einsum("efgi,fi->efg", offset, along)
    h = along[:, None, 0] * offset[..., 1] - along[:, None, 1] * offset[..., 0]
    low, high = np.maximum(s[0], 0.0), np.minimum(s[1], length[:, None])
    run = np.where(s[1] > s[0], s[1] - s[0], 1.0)
    slope = (h[1] - h[0]) / run
    away = np.maximum(abs(h[0] + slope * (low - s[0])), abs(h[0] + slope * (high - s[0])))
    f, g = np.nonzero((s[1] > s[0]) & (high - low > TOUCH) & (away <= TOUCH))
    spans = np.stack([low[f, g], high[f, g]], axis=1)
    return np.asarray(begin[f, None] + spans[..., None] * along[f, None], dtype=np.float64)


def _lines(pieces: FloatArray) -> list[FloatArray]:
    """Group pieces (k, 2, 2) that lie on one straight line and face the same way."""
    groups: list[list[FloatArray]] = []
    for piece in pieces:
        home = next((group for group in groups if _aligned(group[0], piece)), None)
        if home is None:
            groups.append([piece])
        else:
            home.append(piece)
    lines = [np.array(group) for group in groups]
    return [
        line for line in lines if np.linalg.norm(line[:, 1] - line[:, 0], axis=1).sum() > SHORTEST_CONTACT
    ]


def _aligned(first: FloatArray, second: FloatArray) -> bool:
    """Tell whether the ends of both pieces lie on one line, to 2 `TOUCH`, and the pieces run the same way."""
    ends = np.concatenate([first, second])
    direction = ends[np.argmax(np.linalg.norm(ends - first[0], axis=1))] - first[0]
    direction = direction / np.linalg.norm(direction)
    away = direction[0] * (ends - first[0])[:, 1] - direction[1] * (ends - first[0])[:, 0]
    return bool(abs(away).max() <= 2.0 * TOUCH and (first[1] - first[0]) @ (second[1] - second[0]) > 0.0)


def _hull(line: FloatArray) -> FloatArray:
    """Return the outermost ends (2, 2) of pieces on one line, in the direction in which they run."""
    ends = line.reshape(-1, 2)
    s = (ends - ends[0]) @ (ends[1] - ends[0])
    return ends[[int(s.argmin()), int(s.argmax())]]
