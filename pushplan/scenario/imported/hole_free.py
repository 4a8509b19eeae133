"""Regions with holes as polygons without holes, of a bounded number of corners: what obstacles can be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from pushplan.geometry.simple import LEAST_AREA, SAME_POINT, find_flaw
from pushplan.scenario.schema.types import MOST_CORNERS
from pushplan.util.arrays import FloatArray

_GRID = 10.0 * SAME_POINT
"""Spacing of the points on which outlines are put where theirs are too near to one another, m."""


def hole_free(region: shapely.Geometry) -> Iterator[FloatArray]:
    """Yield counter-clockwise outlines (v, 2) that cover a region; pieces below 1 mm^2 are left out.

    A polygon with a hole is cut in two along a line through the hole, one with too many corners in its middle.
    """
    pending = list(shapely.get_parts(region))
    while pending:
        part = pending.pop()
        if not isinstance(part, shapely.Polygon) or part.is_empty:
            continue
        if part.interiors or len(part.exterior.coords) > MOST_CORNERS:
            pending += _halves(part)
            continue
        outline = _without_repeats(shapely.get_coordinates(shapely.orient_polygons(part).exterior)[:-1])
        if len(outline) > 2 and find_flaw(outline) is None:
            yield outline
        elif part.area >= LEAST_AREA:
            # Corners nearer than SAME_POINT were taken together, and edges cross now. On a grid they do not.
            pending += shapely.get_parts(
                shapely.set_precision(part.buffer(_GRID, join_style="mitre"), _GRID)
            ).tolist()


def covering(region: shapely.Geometry, tolerance: float) -> shapely.Geometry:
    """Return a region with fewer corners that covers `region`; it reaches at most three times `tolerance` farther.

    What is left out lies within about the tolerance of the new edges; growing by as much covers it again. A
    polygon of the region for which it does not stays as it is. Each is looked at on its own: from thousands of
    corners to a whole map is a long way.
    """
    parts = shapely.get_parts(region)
    simple = shapely.simplify(parts, tolerance)
    corners, owner = shapely.get_coordinates(parts, return_index=True)
    reach = np.zeros(len(parts))
    np.maximum.at(reach, owner, shapely.distance(shapely.points(corners), simple[owner]))
    missed = np.flatnonzero(reach <= tolerance)
    while len(missed):
        grown = shapely.buffer(simple[missed], reach[missed], join_style="mitre", mitre_limit=2.0)
        covers = shapely.covers(grown, parts[missed])
        parts[missed[covers]] = grown[covers]
        reach[missed] = np.maximum(1.2 * reach[missed], 1e-3 * tolerance)
        missed = missed[~covers & (reach[missed] <= tolerance)]
    return shapely.union_all(parts)


def _halves(polygon: shapely.Polygon) -> list[shapely.Geometry]:
    """Cut through the first hole's middle, or else through the polygon's, across its longer side."""
    xmin, ymin, xmax, ymax = (polygon.interiors[0] if polygon.interiors else polygon).bounds
    whole = polygon.bounds
    if xmax - xmin >= ymax - ymin:
        x = 0.5 * (xmin + xmax)
        sides = shapely.box(whole[0], whole[1], x, whole[3]), shapely.box(x, whole[1], whole[2], whole[3])
    else:
        y = 0.5 * (ymin + ymax)
        sides = shapely.box(whole[0], whole[1], whole[2], y), shapely.box(whole[0], y, whole[2], whole[3])
    return [part for side in sides for part in shapely.get_parts(polygon & side)]


def _without_repeats(outline: FloatArray) -> FloatArray:
    """Return an outline without corners that are the same point as the one before."""
    far = np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1) > SAME_POINT
    distinct: FloatArray = outline[far]
    return distinct
