"""Exact distances of the chain's bodies from everything in the way, by shapely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from pushplan.basics.arrays import FloatArray, IntArray
from pushplan.geometry import se2
from pushplan.scenario import CircleObstacle, Scenario
from pushplan.scenario_parts import Obstacle, Workspace

ObjectArray = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class Room:
    """What moves and what it must not touch.

    Attributes:
        names: (b,) of the bodies.
        corners: (v, 2) of all bodies' outlines, chain frame, m.
        body: (v,) index of the body that each corner belongs to.
        shapes: (n,) obstacles as polygons, or as the centres of round ones.
        radii: (n,) of the round obstacles, m; 0 for polygons.
        tree: Of the obstacles, round ones as the squares around them.
        walls: The workspace.
    """

    names: tuple[str, ...]
    corners: FloatArray
    body: IntArray
    shapes: ObjectArray
    radii: FloatArray
    tree: shapely.STRtree
    walls: Workspace | None

    @classmethod
    def of(cls, scenario: Scenario) -> Room:
        """Return that of a scenario."""
        bodies = scenario.chain.bodies
        shapes, radii = _shapes(scenario.obstacles)
        around, disc = shapes.copy(), radii > 0.0
        around[disc] = shapely.buffer(shapes[disc], radii[disc], cap_style="square")
        return cls(
            tuple(body.name for body in bodies),
            np.concatenate([body.outline for body in bodies]),
            np.repeat(np.arange(len(bodies)), [len(body.outline) for body in bodies]),
            shapes,
            radii,
            shapely.STRtree(around),
            scenario.workspace,
        )

    def only(self, bodies: Sequence[int]) -> Room:
        """Return it with some of the bodies, by their indices, alone."""
        kept = np.isin(self.body, bodies)
        body = np.searchsorted(bodies, self.body[kept])
        return replace(
            self, names=tuple(self.names[i] for i in bodies), corners=self.corners[kept], body=body
        )

    @cached_property
    def _circles(self) -> tuple[FloatArray, FloatArray]:
        """Middles (b, 2) and radii (b,) of circles around the bodies, chain frame, m."""
        outlines = [self.corners[self.body == k] for k in range(len(self.names))]
        middles = np.array([0.5 * (outline.min(axis=0) + outline.max(axis=0)) for outline in outlines])
        away = np.hypot(*(self.corners - middles[self.body]).T)
        return middles, np.array([away[self.body == k].max() for k in range(len(self.names))])

    def gaps(self, poses: FloatArray, enough: float) -> FloatArray:
        """Return the distances (m,) of the bodies at poses (m, 3) from everything, m: 0 on overlap, capped."""
        corners = self._corners(poses)
        gaps = self._wall_gaps(corners).min(axis=1, initial=enough)
        pairs = self._near(poses, enough)
        near, which = np.unique(pairs[0], return_inverse=True)  # few as a rule: polygons take long to make
        bodies = self._bodies(corners, near)
        np.minimum.at(gaps, pairs[0] // len(self.names), self._apart(bodies, np.stack([which, pairs[1]])))
        return np.asarray(np.maximum(gaps, 0.0))

    def nearest(self, pose: FloatArray, within: float) -> tuple[float, str, int | None]:
        """Return the smallest distance at a pose (3,), whose it is, and from which obstacle (None: a wall).

        Something has to be nearer than `within`, m.
        """
        corners = self._corners(pose[None])
        bodies = self._bodies(corners, np.arange(len(self.names)))
        walls = self._wall_gaps(corners)[0]
        pairs = self.tree.query(bodies, predicate="dwithin", distance=within)
        gaps = np.concatenate([self._apart(bodies, pairs), walls])
        i = int(np.argmin(gaps))
        if i < len(pairs[0]):
            return float(gaps[i]), self.names[pairs[0, i]], int(pairs[1, i])
        return max(float(gaps[i]), 0.0), self.names[self.body[i - len(pairs[0])]], None

    def _corners(self, poses: FloatArray) -> FloatArray:
        """The corners (m, v, 2) of the bodies at poses (m, 3)."""
        return np.asarray(poses[:, None, :2] + se2.rotate(poses[:, 2:3], self.corners[None]))

    def _near(self, poses: FloatArray, within: float) -> IntArray:
        """Pairs (2, k) of bodies at poses (m, 3), counted on from pose to pose, and obstacles that may be so near."""
        middles, radii = self._circles
        places = poses[:, None, :2] + se2.rotate(poses[:, 2:3], middles[None])
        points, far = shapely.points(places.reshape(-1, 2)), np.tile(within + radii, len(poses))
        return np.asarray(self.tree.query(points, predicate="dwithin", distance=far))

    def _bodies(self, corners: FloatArray, chosen: IntArray) -> ObjectArray:
        """The polygons (k,) of some bodies at poses, counted on from pose to pose, from all corners (m, v, 2)."""
        ring = np.arange(len(corners))[:, None] * len(self.names) + self.body
        number = np.full(len(corners) * len(self.names), -1)
        number[chosen] = np.arange(len(chosen))
        owner = number[ring]
        order = np.argsort(owner[owner >= 0], kind="stable")
        rings = shapely.linearrings(corners[owner >= 0][order], indices=owner[owner >= 0][order])
        return np.asarray(shapely.polygons(rings))

    def _apart(self, bodies: ObjectArray, pairs: IntArray) -> FloatArray:
        """Distances (k,) of bodies from obstacles, by their indices (2, k), m."""
        away = shapely.distance(bodies[pairs[0]], self.shapes[pairs[1]])
        return np.asarray(np.maximum(away - self.radii[pairs[1]], 0.0))

    def _wall_gaps(self, corners: FloatArray) -> FloatArray:
        """Distances (m, v) of corners (m, v, 2) from the walls, m; negative beyond, infinite where there are none."""
        if self.walls is None:
            return np.full(corners.shape[:2], np.inf)
        low, high = (self.walls.xmin, self.walls.ymin), (self.walls.xmax, self.walls.ymax)
        return np.asarray(np.minimum(corners - low, high - corners).min(axis=2))


def _shapes(obstacles: Sequence[Obstacle]) -> tuple[ObjectArray, FloatArray]:
    """Polygons, or centres and radii, of obstacles; all rings are made at once, as there may be thousands."""
    radii = np.array([o.radius if isinstance(o, CircleObstacle) else 0.0 for o in obstacles])
    shapes: ObjectArray = np.empty(len(obstacles), dtype=object)
    outlines = [o.outline for o in obstacles if not isinstance(o, CircleObstacle)]
    if outlines:
        ring = np.repeat(np.arange(len(outlines)), [len(outline) for outline in outlines])
        shapes[radii == 0.0] = shapely.polygons(shapely.linearrings(np.concatenate(outlines), indices=ring))
    centers = [o.center for o in obstacles if isinstance(o, CircleObstacle)]
    if centers:
        shapes[radii > 0.0] = shapely.points(np.array(centers))
    return shapes, radii
