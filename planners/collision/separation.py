"""Compiled collision checks of the rigid chain against the obstacles: separation and swept arcs.

A swept arc is proven free by conservative advancement (Mirtich 1996): from a pose whose separation from
every obstacle is d, no point of the body can touch anything before it has travelled d.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pushplan.compiled import inlined, no_refcount
from pushplan.compiled.scratch import scratch
from pushplan.util.arrays import FloatArray, IntArray

EXACT_BELOW = 0.01
"""Separations under this (m), or under twice the clearance, are refined from the bound that separating axes give to
the exact distance."""

DEPTH = 128
"""Room for intervals of an arc still to be looked at; each is at most half of the one below it."""


class Shapes(NamedTuple):
    """Convex polygons, flattened.

    Attributes:
        corners: (v, 4) counter-clockwise corners and the outward unit normal of the edge that begins there.
        starts: (q + 1,) index of each polygon's first corner.
        bounds: (q, 3) centre and radius of a circle around each polygon.
    """

    corners: FloatArray
    starts: IntArray
    bounds: FloatArray


class Scene(NamedTuple):
    """What moves and what stands still.

    Attributes:
        body: Convex pieces of pusher and objects in the chain frame.
        body_bound: (3,) centre and radius of a circle around the body, chain frame.
        obstacles: Convex pieces of the polygonal obstacles, world frame.
        circles: (c, 3) centre and radius of the round obstacles, world frame.
        tree: (t, 9) boxes around groups of obstacles, a tree in preorder; see `obstacle_tree`.
        walls: (4,) workspace (xmin, ymin, xmax, ymax); infinite where there is none.
        clearance: Distance (m) from everything at the poses that are looked at.
        kept: Distance (m), smaller, that is proven between these poses.
    """

    body: Shapes
    body_bound: FloatArray
    obstacles: Shapes
    circles: FloatArray
    tree: FloatArray
    walls: FloatArray
    clearance: float
    kept: float


@no_refcount
def _axis_separation(
    a: FloatArray, a0: int, a1: int, b: FloatArray, b0: int, b1: int, c: float, s: float, x: float, y: float
) -> float:
    """Largest separation along the edge normals of polygon a (moved by the pose) from polygon b."""
    best = -np.inf
    for i in range(a0, a1):
        nx = c * a[i, 2] - s * a[i, 3]
        ny = s * a[i, 2] + c * a[i, 3]
        offset = nx * (x + c * a[i, 0] - s * a[i, 1]) + ny * (y + s * a[i, 0] + c * a[i, 1])
        nearest = np.inf
        for j in range(b0, b1):
            nearest = min(nearest, nx * b[j, 0] + ny * b[j, 1])
        best = max(best, nearest - offset)
    return best


@no_refcount
def _point_segment(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Squared distance of a point from a segment."""
    ex, ey = bx - ax, by - ay
    t = ((px - ax) * ex + (py - ay) * ey) / (ex * ex + ey * ey)
    t = min(1.0, max(0.0, t))
    dx, dy = px - ax - t * ex, py - ay - t * ey
    return dx * dx + dy * dy


@no_refcount
def _corner_distance(
    a: FloatArray, a0: int, a1: int, b: FloatArray, b0: int, b1: int, c: float, s: float, x: float, y: float
) -> float:
    """Smallest squared distance from a corner of a (moved by the pose) to an edge of b."""
    best = np.inf
    for i in range(a0, a1):
        px = x + c * a[i, 0] - s * a[i, 1]
        py = y + s * a[i, 0] + c * a[i, 1]
        for j in range(b0, b1):
            k = j + 1 if j + 1 < b1 else b0
            best = min(best, _point_segment(px, py, b[j, 0], b[j, 1], b[k, 0], b[k, 1]))
    return best


@no_refcount
def _polygon_separation(
    a: FloatArray, a0: int, a1: int, b: FloatArray, b0: int, b1: int, c: float, s: float, x: float, y: float,
    exact_below: float,
) -> float:  # fmt: skip
    """Distance of two convex polygons, or a lower bound while that is above `exact_below`; <= 0 on overlap."""
    forward = _axis_separation(a, a0, a1, b, b0, b1, c, s, x, y)
    if forward >= exact_below:
        return forward
    # The other way round: the inverse pose R^T (-t) takes b into the frame of a.
    ix, iy = -(c * x + s * y), s * x - c * y
    separation = max(forward, _axis_separation(b, b0, b1, a, a0, a1, c, -s, ix, iy))
    if separation <= 0.0 or separation >= exact_below:
        return separation
    # No edge normal separates them by their distance: then two corners are nearest, or a corner and an edge.
    nearest = min(
        _corner_distance(a, a0, a1, b, b0, b1, c, s, x, y),
        _corner_distance(b, b0, b1, a, a0, a1, c, -s, ix, iy),
    )
    return math.sqrt(nearest)


@inlined
def _disc_separation(
    a: FloatArray, a0: int, a1: int, cx: float, cy: float, r: float, c: float, s: float, x: float, y: float
) -> float:
    """Distance of a convex polygon (moved by the pose) from a disc; <= 0 on overlap."""
    px = c * (cx - x) + s * (cy - y)
    py = -s * (cx - x) + c * (cy - y)
    inside = -np.inf
    nearest = np.inf
    for i in range(a0, a1):
        k = i + 1 if i + 1 < a1 else a0
        inside = max(inside, a[i, 2] * (px - a[i, 0]) + a[i, 3] * (py - a[i, 1]))
        nearest = min(nearest, _point_segment(px, py, a[i, 0], a[i, 1], a[k, 0], a[k, 1]))
    return inside - r if inside <= 0.0 else math.sqrt(nearest) - r


@inlined
def _wall_separation(body: FloatArray, walls: FloatArray, c: float, s: float, x: float, y: float) -> float:
    """Distance of the body from the workspace's walls; negative outside."""
    best = np.inf
    for i in range(body.shape[0]):
        px = x + c * body[i, 0] - s * body[i, 1]
        py = y + s * body[i, 0] + c * body[i, 1]
        best = min(best, px - walls[0], py - walls[1], walls[2] - px, walls[3] - py)
    return best


@inlined
def _body_to_polygon(
    scene: Scene, o: int, cx: float, cy: float, c: float, s: float, x: float, y: float, enough: float
) -> float:
    """Separation of the body, around (cx, cy), from obstacle polygon o, as far as it is below `enough`."""
    body, obstacles = scene.body, scene.obstacles
    dx, dy = cx - obstacles.bounds[o, 0], cy - obstacles.bounds[o, 1]
    reach = enough + scene.body_bound[2] + obstacles.bounds[o, 2]
    if dx * dx + dy * dy >= reach * reach:
        return enough
    exact_below = max(EXACT_BELOW, 2.0 * scene.clearance)
    best = enough
    for p in range(body.starts.shape[0] - 1):
        dx = x + c * body.bounds[p, 0] - s * body.bounds[p, 1] - obstacles.bounds[o, 0]
        dy = y + s * body.bounds[p, 0] + c * body.bounds[p, 1] - obstacles.bounds[o, 1]
        reach = best + body.bounds[p, 2] + obstacles.bounds[o, 2]
        if dx * dx + dy * dy < reach * reach:
            d = _polygon_separation(
                body.corners, body.starts[p], body.starts[p + 1],
                obstacles.corners, obstacles.starts[o], obstacles.starts[o + 1], c, s, x, y, exact_below,
            )  # fmt: skip
            best = min(best, d)
    return best


@inlined
def _body_to_disc(
    scene: Scene, o: int, cx: float, cy: float, c: float, s: float, x: float, y: float, enough: float
) -> float:
    """Separation of the body, around (cx, cy), from round obstacle o, as far as it is below `enough`."""
    body, disc = scene.body, scene.circles
    dx, dy = cx - disc[o, 0], cy - disc[o, 1]
    reach = enough + scene.body_bound[2] + disc[o, 2]
    if dx * dx + dy * dy >= reach * reach:
        return enough
    best = enough
    for p in range(body.starts.shape[0] - 1):
        first, last = body.starts[p], body.starts[p + 1]
        d = _disc_separation(body.corners, first, last, disc[o, 0], disc[o, 1], disc[o, 2], c, s, x, y)
        best = min(best, d)
    return best


@no_refcount
def separation(scene: Scene, x: float, y: float, theta: float, enough: float) -> float:
    """Return a lower bound (m) on the distance of the body at a pose from everything, capped at `enough`."""
    c, s = math.cos(theta), math.sin(theta)
    cx = x + c * scene.body_bound[0] - s * scene.body_bound[1]
    cy = y + s * scene.body_bound[0] + c * scene.body_bound[1]
    best, walls = enough, scene.walls
    if min(cx - walls[0], cy - walls[1], walls[2] - cx, walls[3] - cy) < enough + scene.body_bound[2]:
        best = min(best, _wall_separation(scene.body.corners, walls, c, s, x, y))
    i = 0
    while i < scene.tree.shape[0]:
        box = scene.tree[i]
        dx, dy = max(box[0] - cx, cx - box[2], 0.0), max(box[1] - cy, cy - box[3], 0.0)
        # Preorder: box[4] is where the boxes inside this one end, so that a miss skips all of them.
        reach = best + scene.body_bound[2]
        if dx * dx + dy * dy >= reach * reach:
            i = int(box[4])
            continue
        for o in range(int(box[5]), int(box[6])):
            best = _body_to_polygon(scene, o, cx, cy, c, s, x, y, best)
        for o in range(int(box[7]), int(box[8])):
            best = _body_to_disc(scene, o, cx, cy, c, s, x, y, best)
        i += 1
    return best


@inlined
def _top_speed(scene: Scene, vx: float, vy: float, omega: float) -> float:
    """Largest speed of any point of the body under a body twist; convex, so found at a corner."""
    best = 0.0
    for i in range(scene.body.corners.shape[0]):
        px, py = vx - omega * scene.body.corners[i, 1], vy + omega * scene.body.corners[i, 0]
        best = max(best, px * px + py * py)
    return math.sqrt(best)


@no_refcount
def step(
    x: float, y: float, theta: float, vx: float, vy: float, omega: float, length: float
) -> tuple[float, float, float]:
    """Return the pose after moving along a constant body twist for `length` (exact exponential)."""
    half = 0.5 * omega * length
    # On a circle, the chord of an arc of angle 2 half points along half: |chord| = length sin(half) / half.
    chord = length if abs(half) < 1e-8 else length * math.sin(half) / half
    c, s = chord * math.cos(theta + half), chord * math.sin(theta + half)
    return x + c * vx - s * vy, y + s * vx + c * vy, theta + 2.0 * half


@no_refcount
def sweep_is_free(
    scene: Scene, x: float, y: float, theta: float, vx: float, vy: float, omega: float, length: float
) -> bool:
    """Return whether the body keeps clear of everything along an arc: proven, never merely sampled.

    Every pose looked at has `scene.clearance`, every one between has `scene.kept` at least: a separation d at s
    covers all s' with |s' - s| <= (d - kept) / (top speed of the body). Intervals are looked at in the
    middle first, where a collision shows soonest. An arc that comes closer than `scene.clearance` may be refused.
    """
    top = _top_speed(scene, vx, vy, omega)
    left = scratch(DEPTH, 2)
    left[0, 0], left[0, 1] = 0.0, length
    n = 1
    while n > 0:
        n -= 1
        begin, end = left[n, 0], left[n, 1]
        middle = 0.5 * (begin + end)
        px, py, pt = step(x, y, theta, vx, vy, omega, middle)
        # More than it takes to cover the whole interval need not be known.
        gap = separation(scene, px, py, pt, 0.5 * (end - begin) * top + 2.0 * scene.clearance)
        if gap < scene.clearance:
            return False
        covered = (gap - scene.kept) / top
        if middle - covered > begin:
            left[n, 0], left[n, 1] = begin, middle - covered
            left[n + 1, 0], left[n + 1, 1] = middle + covered, end
            n += 2
    return True
