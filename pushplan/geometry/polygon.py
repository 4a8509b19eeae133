"""Simple polygons: area moments, symmetries, penetration depths and contact segments."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from pushplan.errors import SupportError
from pushplan.geometry.se2 import rotate
from pushplan.util.arrays import FloatArray, frozen

MOST_SYMMETRIES = 12
"""Largest order of rotational symmetry that is checked."""


class AreaMoments(NamedTuple):
    """Area (m^2), centroid (2,) and central second moments (2, 2) (m^4) of a polygon."""

    area: float
    centroid: FloatArray
    second: FloatArray


def simple_polygon(outline: ArrayLike, name: str) -> FloatArray:
    """Return `outline` as a read-only counter-clockwise (v, 2) array.

    Raises:
        SupportError: If it is not a simple polygon with an area.
    """
    vertices = frozen(outline, (None, 2), name)
    if len(vertices) < 3:
        raise SupportError(f"{name} has {len(vertices)} vertices; a polygon needs at least 3")
    polygon = shapely.Polygon(vertices)
    if not polygon.is_valid or not polygon.area > 0.0:
        reason = shapely.is_valid_reason(polygon)
        why = "area 0" if reason == "Valid Geometry" else reason
        raise SupportError(f"{name} must be a simple polygon with an area, but: {why}")
    return frozen(vertices if polygon.exterior.is_ccw else vertices[::-1], (None, 2), name)


def area_moments(outline: FloatArray) -> AreaMoments:
    """Return area, centroid and central second moments of a counter-clockwise (v, 2) polygon."""
    anchor = outline[0]
    p = outline - anchor
    q = np.roll(p, -1, axis=0)
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    area = 0.5 * float(cross.sum())
    centroid = (cross @ (p + q)) / (6.0 * area)
    p, q = p - centroid, q - centroid
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    total = p + q
    outer = p[:, :, None] * p[:, None, :] + q[:, :, None] * q[:, None, :]
    outer += total[:, :, None] * total[:, None, :]
    return AreaMoments(area, anchor + centroid, np.einsum("e,eij->ij", cross, outer) / 24.0)


def symmetries(outline: FloatArray) -> list[FloatArray]:
    """Return the rotations about the centroid that map a simple polygon to itself: motions (3,), identity first."""
    centroid, count = area_moments(outline).centroid, len(outline)
    corners, same = outline - centroid, 1e-9 * np.ptp(outline)
    for n in range(min(count, MOST_SYMMETRIES), 1, -1):
        turned = rotate(2.0 * np.pi / n, corners)
        if count % n == 0 and np.abs(turned - np.roll(corners, -(count // n), axis=0)).max() <= same:
            angles = 2.0 * np.pi * np.arange(n) / n
            return [np.append(centroid - rotate(angle, centroid), angle) for angle in angles]
    return [np.zeros(3)]


def convex_hull(points: FloatArray) -> FloatArray:
    """Return the counter-clockwise corners (h, 2) of the convex hull of points (k, 2); h can be 1 or 2."""
    hull = shapely.MultiPoint(points).convex_hull
    if isinstance(hull, shapely.Polygon):
        corners = shapely.get_coordinates(hull)[:-1]
        return frozen(corners if hull.exterior.is_ccw else corners[::-1], (None, 2), "hull")
    return frozen(shapely.get_coordinates(hull), (None, 2), "hull")


SAME_POINT = 1e-6
"""Distance below which two corners are the same point, m."""

LEAST_AREA = 1e-6
"""Area below which a polygon counts as a line, m^2."""


def find_flaw(corners: FloatArray) -> str | None:
    """Return a phrase on the error of a polygon with corners (v, 2), indexed from 0; None if it is valid."""
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    if lengths.min() < SAME_POINT:
        i = int(lengths.argmin())
        return f"corners [{i}] and [{(i + 1) % len(corners)}] are the same point"
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid:
        return _crossing(corners)
    if polygon.area < LEAST_AREA:
        return f"has an area of {polygon.area * 1e6:.3g} mm^2, less than {LEAST_AREA * 1e6:g} mm^2"
    return None


def _crossing(corners: FloatArray) -> str:
    """Return a phrase with the two edges of an invalid polygon that meet, and their meeting point."""
    ends = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    edges = np.array([shapely.LineString(pair) for pair in ends], dtype=object)
    count = len(edges)
    for i in range(count):
        others = np.array([j for j in range(i + 1, count) if 1 < j - i < count - 1], dtype=np.int64)
        hits = others[shapely.intersects(edges[i], edges[others])]
        if len(hits):
            x, y = shapely.get_coordinates(shapely.intersection(edges[i], edges[hits[0]]))[0]
            return f"the edges after corners [{i}] and [{hits[0]}] cross at ({x:.6g}, {y:.6g})"
    return "an edge runs back along the previous one"


_MOST_WORK = 100_000
"""Largest number of pairs of triangles times directions that is checked for non-convex outlines."""


def overlap_depth(fixed: FloatArray, moving: FloatArray) -> float:
    """Return the shortest translation (m) along an edge's normal that separates two outlines (v, 2).

    It is the penetration depth of convex outlines, an upper bound of the depth for others, and 0 if they overlap by
    less than `TOUCH`.
    """
    first, second = shapely.Polygon(fixed), shapely.Polygon(moving)
    if not shapely.intersection(first, second).area > TOUCH * TOUCH:
        return 0.0
    directions = np.concatenate([_longest_first(fixed), -_longest_first(moving)])
    if all(p.convex_hull.area - p.area <= 1e-12 * p.area for p in (first, second)):
        depth = float(np.min((fixed @ directions.T).max(axis=0) - (moving @ directions.T).min(axis=0)))
    else:
        pieces = _triangles(fixed), _triangles(moving)
        most = max(4, _MOST_WORK // (len(pieces[0]) * len(pieces[1])))
        depth = min(_exit_distance(*pieces, direction) for direction in directions[:most])
    return depth if depth > TOUCH else 0.0


def exit_distance(fixed: FloatArray, moving: FloatArray, direction: FloatArray) -> float:
    """Return the distance (m) that `moving` must travel along the unit `direction` to separate from `fixed`."""
    return _exit_distance(_triangles(fixed), _triangles(moving), direction)


def outward_normals(outlines: FloatArray) -> FloatArray:
    """Return the unit normals (..., v, 2) of the edges that begin at corners (..., v, 2), counter-clockwise."""
    normals = _axes(outlines)
    return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))


def _longest_first(outline: FloatArray) -> FloatArray:
    """Return the outward unit normals of a counter-clockwise outline's edges, longest edge first."""
    lengths = np.linalg.norm(_axes(outline), axis=1)
    return outward_normals(outline)[np.argsort(-lengths, kind="stable")]


def _triangles(outline: FloatArray) -> FloatArray:
    """Return triangles (k, 3, 2), counter-clockwise, that cover an outline."""
    cover = shapely.orient_polygons(shapely.constrained_delaunay_triangles(shapely.Polygon(outline)))
    return np.array([shapely.get_coordinates(piece)[:3] for piece in shapely.get_parts(cover)])


def _exit_distance(fixed: FloatArray, moving: FloatArray, direction: FloatArray) -> float:
    """Return the smallest shift at which no two triangles overlap, from the intervals in which pairs overlap."""
    low, high = _overlapping_shifts(fixed, moving, direction)
    reached = 0.0
    for begin, end in sorted(zip(low, high, strict=True)):
        if begin <= reached:
            reached = max(reached, end)
    return reached


def _overlapping_shifts(
    fixed: FloatArray, moving: FloatArray, direction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the ends of the intervals of shifts along `direction` at which pairs of triangles overlap.

    Convex bodies are separate if and only if they are separate along a normal of one of their edges (separating
    axes).
    """
    low = np.full((len(fixed), len(moving)), -np.inf)
    high = np.full((len(fixed), len(moving)), np.inf)
    for axes, owner in ((_axes(fixed), 0), (_axes(moving), 1)):
        for k in range(3):
            axis = np.expand_dims(axes[:, k], 1 - owner)  # broadcasts over the other body's triangles
            top = (fixed[:, None] @ axis[..., None])[..., 0].max(axis=-1)
            bottom = (moving[None] @ axis[..., None])[..., 0].min(axis=-1)
            floor = (fixed[:, None] @ axis[..., None])[..., 0].min(axis=-1)
            ceiling = (moving[None] @ axis[..., None])[..., 0].max(axis=-1)
            low, high = _clip(low, high, axis @ direction, floor - ceiling, top - bottom)
    low, high = np.where(low < high, low, np.inf), np.where(low < high, high, -np.inf)
    return low[low < high], high[low < high]


def _clip(
    low: FloatArray, high: FloatArray, speed: FloatArray, least: FloatArray, most: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the intervals of shifts t reduced to least < t speed < most."""
    still = abs(speed) < 1e-12
    safe = np.where(still, 1.0, speed)
    a, b = np.minimum(least / safe, most / safe), np.maximum(least / safe, most / safe)
    inside = (least < 0.0) & (most > 0.0)
    a = np.where(still, np.where(inside, -np.inf, np.inf), a)
    b = np.where(still, np.where(inside, np.inf, -np.inf), b)
    return np.maximum(low, a), np.minimum(high, b)


def _axes(outlines: FloatArray) -> FloatArray:
    """Return the unscaled outward edge normals (..., v, 2) of counter-clockwise outlines (..., v, 2)."""
    edges = np.roll(outlines, -1, axis=-2) - outlines
    return np.stack([edges[..., 1], -edges[..., 0]], axis=-1)


TOUCH = 1e-6
"""Distance up to which bodies touch, and depth up to which they do not overlap, m."""

SHORTEST_CONTACT = 1e-4
"""Length below which a contact counts as a point, m."""


def find_touch(first: FloatArray, second: FloatArray) -> FloatArray | None:
    """Return the segments (k, 2, 2) along which two counter-clockwise outlines (v, 2) touch; None if they do not.

    Segments run from right to left of the normal from the first outline into the second, m. The array is empty if the
    outlines touch only at points. Pieces of contact on a straight line are one segment from end to end, because
    forces at the ends of this segment span the forces of all pieces.
    """
    if _gap(first, second) > TOUCH:
        return None
    pieces = _shared_pieces(first, second)
    return np.array([_hull(group) for group in _lines(pieces)]).reshape(-1, 2, 2)


def _gap(first: FloatArray, second: FloatArray) -> float:
    """Return the distance of two outlines, or a lower bound above `TOUCH`."""
    low, high = first.min(axis=0) - second.max(axis=0), second.min(axis=0) - first.max(axis=0)
    gap = float(max(low.max(), high.max()))
    return gap if gap > TOUCH else float(shapely.distance(shapely.Polygon(first), shapely.Polygon(second)))


def _shared_pieces(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the parts (k, 2, 2) of edges of `first` that coincide with opposite edges of `second`."""
    begin, edge = first, np.roll(first, -1, axis=0) - first
    length = np.linalg.norm(edge, axis=1)
    along = edge / length[:, None]
    ends = np.stack([np.roll(second, -1, axis=0), second])  # reversed, so that opposite edges have the same direction
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
    """Group pieces (k, 2, 2) that are on a straight line and have the same direction."""
    groups: list[list[FloatArray]] = []
    for piece in pieces:
        match = next((group for group in groups if _aligned(group[0], piece)), None)
        if match is None:
            groups.append([piece])
        else:
            match.append(piece)
    lines = [np.array(group) for group in groups]
    return [line for line in lines if np.linalg.norm(line[:, 1] - line[:, 0], axis=1).sum() > SHORTEST_CONTACT]


def _aligned(first: FloatArray, second: FloatArray) -> bool:
    """Return whether two pieces are on a line, within 2 `TOUCH`, and have the same direction."""
    ends = np.concatenate([first, second])
    direction = ends[np.argmax(np.linalg.norm(ends - first[0], axis=1))] - first[0]
    direction = direction / np.linalg.norm(direction)
    away = direction[0] * (ends - first[0])[:, 1] - direction[1] * (ends - first[0])[:, 0]
    return bool(abs(away).max() <= 2.0 * TOUCH and (first[1] - first[0]) @ (second[1] - second[0]) > 0.0)


def _hull(line: FloatArray) -> FloatArray:
    """Return the outermost ends (2, 2) of pieces on a line, in their direction."""
    ends = line.reshape(-1, 2)
    s = (ends - ends[0]) @ (ends[1] - ends[0])
    return ends[[int(s.argmin()), int(s.argmax())]]
