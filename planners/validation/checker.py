"""The independent check of a motion: shapely on a fine resampling, no code shared with the planners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pushplan.arrays import FloatArray, IntArray
from pushplan.geometry import se2
from pushplan.names import CLEARANCE_ROOM
from pushplan.scenario import CircleObstacle, PolygonObstacle, Scenario

SPACING = 0.002
"""No point of the body moves farther than this (m) between two poses that are checked."""

CIRCLE_SEGMENTS = 64
"""Segments per quarter of a round obstacle when candidates are looked for; its polygon contains the circle."""

ObjectArray = NDArray[np.object_]

BATCH = 20_000
"""Poses checked at a time, to bound the memory."""


@dataclass(frozen=True)
class Collision:
    """Where a motion comes too near to something.

    Attributes:
        pose: (x, y, theta) of the chain frame in the world.
        body: `robot`, `pusher` or the object's name.
        obstacle: Index of the obstacle, or None for the workspace's walls.
        gap: Distance that is left, m; 0 where they touch or overlap.
    """

    pose: tuple[float, float, float]
    body: str
    obstacle: int | None
    gap: float = 0.0

    def __str__(self) -> str:
        other = "a wall of the workspace" if self.obstacle is None else f"obstacles[{self.obstacle}]"
        x, y, theta = self.pose
        place = f"with the chain frame at ({x:.4f}, {y:.4f}) m, {np.degrees(theta):.2f} deg"
        if self.gap <= 0.0:
            return f"'{self.body}' meets {other} {place}"
        return f"'{self.body}' is {1e3 * self.gap:.3g} mm from {other} {place}"


def find_collision(scenario: Scenario, poses: FloatArray) -> Collision | None:
    """Return the first collision along poses (m, 3) of the chain frame, refined to `SPACING`, or None.

    It is one when a body comes nearer to something than the scenario's clearance, less `CLEARANCE_ROOM`.
    """
    dense = densify(poses, scenario.chain.reach, SPACING)
    for begin in range(0, len(dense), BATCH):
        found = _first_collision(scenario, dense[begin : begin + BATCH])
        if found is not None:
            return found
    return None


def densify(poses: FloatArray, reach: float, spacing: float) -> FloatArray:
    """Insert poses on the constant-twist motion between neighbours: no body point moves more than `spacing`."""
    if len(poses) < 2:
        return poses
    twists = _log(se2.relative(poses[:-1], poses[1:]))
    travel = np.hypot(twists[:, 0], twists[:, 1]) + np.abs(twists[:, 2]) * reach
    counts = np.maximum(1, np.ceil(travel / spacing)).astype(int)
    owner = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[owner]
    inner = se2.compose(poses[owner], se2.exp(twists[owner] * share[:, None]))
    return np.concatenate([inner, poses[-1:]])


def _log(pose: FloatArray) -> FloatArray:
    """Body twists (k, 3) whose exponential are the poses (k, 3); the inverse of `se2.exp`."""
    half = 0.5 * pose[:, 2]
    diagonal = 1.0 / np.where(
        np.abs(half) < 1e-6, 1.0 + half**2 / 3.0, np.tan(half) / np.where(half == 0, 1, half)
    )
    x = diagonal * pose[:, 0] + half * pose[:, 1]
    y = -half * pose[:, 0] + diagonal * pose[:, 1]
    return np.stack([x, y, pose[:, 2]], axis=1)


def _obstacles(scenario: Scenario) -> list[shapely.Geometry]:
    grown = 1.0 / np.cos(np.pi / (4 * CIRCLE_SEGMENTS))
    return [
        shapely.Point(o.center).buffer(o.radius * grown, quad_segs=CIRCLE_SEGMENTS)
        if isinstance(o, CircleObstacle)
        else shapely.Polygon(o.outline)
        for o in scenario.obstacles
    ]


def _first_collision(scenario: Scenario, poses: FloatArray) -> Collision | None:
    """The earliest collision among poses (m, 3), checked as they are."""
    obstacles = np.array(_obstacles(scenario), dtype=object)
    tree = shapely.STRtree(obstacles)
    required = scenario.clearance - CLEARANCE_ROOM
    hits: list[tuple[int, str, int | None, float]] = []
    for body in scenario.chain.bodies:
        corners = poses[:, None, :2] + se2.rotate(poses[:, 2:3], body.outline[None])
        placed: ObjectArray = np.asarray(shapely.polygons(corners))
        pairs = tree.query(placed, predicate="dwithin", distance=required)
        gaps = _gaps(scenario, placed[pairs[0]], pairs[1])
        pairs, gaps = pairs[:, gaps < required], gaps[gaps < required]
        if len(gaps):
            first = np.argmin(pairs[0])
            hits.append((int(pairs[0, first]), body.name, int(pairs[1, first]), float(gaps[first])))
        hits += [(i, body.name, None, max(gap, 0.0)) for i, gap in _outside(scenario, corners, required)]
    if not hits:
        return None
    index, name, obstacle, gap = min(hits, key=lambda hit: hit[0])
    x, y, theta = (float(value) for value in poses[index])
    return Collision((x, y, theta), name, obstacle, gap)


def _gaps(scenario: Scenario, bodies: ObjectArray, obstacles: IntArray) -> FloatArray:
    """Exact distances (k,) of placed bodies (k,) from the obstacles with given indices (k,), m; 0 on overlap."""
    shapes = [
        shapely.Polygon(o.outline) if isinstance(o, PolygonObstacle) else shapely.Point(o.center)
        for o in scenario.obstacles
    ]
    radii = np.array([0.0 if isinstance(o, PolygonObstacle) else o.radius for o in scenario.obstacles])
    away = shapely.distance(bodies, np.array(shapes, dtype=object)[obstacles])
    return np.asarray(np.maximum(away - radii[obstacles], 0.0))


def _outside(scenario: Scenario, corners: FloatArray, required: float) -> list[tuple[int, float]]:
    """Index of the first pose at which a corner (m, v, 2) comes too near to a wall, and its distance, if any."""
    area = scenario.workspace
    if area is None:
        return []
    low, high = np.array([area.xmin, area.ymin]), np.array([area.xmax, area.ymax])
    gaps = np.minimum(corners - low, high - corners).min(axis=(1, 2))
    out = gaps < required
    return [(int(np.argmax(out)), float(gaps[np.argmax(out)]))] if out.any() else []
