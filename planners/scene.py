"""Collision scenes for the core: moving bodies and obstacles of a room as convex pieces."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pushplan.core import collision
from pushplan.core.collision import Scene, Shapes
from pushplan.geometry.convex import bounding_circle, convex_pieces, flatten, joined
from pushplan.mechanics.chain import Chain
from pushplan.util.arrays import FloatArray


def build_scene(
    chain: Chain,
    polygons: Iterable[FloatArray],
    circles: FloatArray,
    walls: tuple[float, float, float, float],
    clearance: float,
    until: float = math.inf,
) -> Scene:
    """Return the collision scene of a chain.

    Args:
        chain: Moving chain, including pusher and robot.
        polygons: Outlines (k, 2) of polygonal obstacles, world frame.
        circles: (c, 3) x, y and radius of round obstacles, world frame.
        walls: Workspace (xmin, ymin, xmax, ymax); infinite if there is none.
        clearance: Distance from all obstacles at checked poses, m, > 0.
        until: Value of `time.perf_counter` by which the scene must be built.

    Raises:
        OutOfTimeError: If cutting the obstacles into convex pieces takes too long.
    """
    body = list(convex_pieces([moving.outline for moving in chain.bodies]))
    standing = list(convex_pieces(list(polygons), until))
    return scene_of(body, standing, circles, np.array(walls, dtype=np.float64), clearance)


def scene_of(
    body: Sequence[FloatArray],
    polygons: Sequence[FloatArray],
    circles: FloatArray,
    walls: FloatArray,
    clearance: float,
    kept: float | None = None,
) -> Scene:
    """Return the scene of convex pieces, with the obstacles in the order of their tree."""
    kept = 0.5 * clearance if kept is None else kept
    bound = bounding_circle(np.concatenate(body))
    return Scene(flatten(body), bound, *standing_shapes(polygons, circles), walls, clearance, kept)


def standing_shapes(polygons: Sequence[FloatArray], circles: FloatArray) -> tuple[Shapes, FloatArray, FloatArray]:
    """Return convex obstacles and round ones, both in the order of their tree, and the tree; see `Scene`."""
    return collision.standing_shapes(*joined(polygons), circles)
