"""Exact distances of the chain's bodies from everything in the way, by shapely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from pushplan.geometry import se2
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.scenario.parts import Obstacle, Workspace
from pushplan.util.arrays import FloatArray, IntArray

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
        circles = [_circle_around(self.corners[self.body == k]) for k in range(len(self.names))]
        return np.array([middle for middle, _ in circles]), np.array([radius for _, radius in circles])

    @cached_property
    def _circle(self) -> tuple[FloatArray, float]:
        """Middle (2,) and radius of a circle around all of them."""
        return _circle_around(self.corners)

    @cached_property
    def _rings(self) -> tuple[IntArray, IntArray]:
        """First corners (b,) of the bodies, and how many they have (b,)."""
        counts = np.bincount(self.body, minlength=len(self.names))
        return np.cumsum(counts) - counts, counts

    def gaps(self, poses: FloatArray, enough: float) -> FloatArray:
        """Return the distances (m,) of the bodies at poses (m, 3) from everything, m: 0 on overlap, capped."""
        middle, radius = self._circle
        places, far = poses[:, :2] + se2.rotate(poses[:, 2], middle), enough + radius
        close = self._wall_gaps(places) < far
        close[self.tree.query(shapely.points(places), predicate="dwithin", distance=far)[0]] = True
        gaps = np.full(len(poses), enough)
        if close.any():
            gaps[close] = self._close_gaps(poses[close], enough)
        return gaps

    def _close_gaps(self, poses: FloatArray, enough: float) -> FloatArray:
        """Return `gaps`, body by body."""
        middles, radii = self._circles
        places = poses[:, None, :2] + se2.rotate(poses[:, 2:3], middles)
        gaps = np.full(len(poses), enough)
        beside = (self._wall_gaps(places) - radii).min(axis=1) < enough  # few, as are bodies near obstacles
        corners = self._corners(poses[beside])
        gaps[beside] = self._wall_gaps(corners).min(axis=1, initial=enough)
        far = np.broadcast_to(enough + radii, places.shape[:2]).ravel()
        pairs = self.tree.query(shapely.points(places.reshape(-1, 2)), predicate="dwithin", distance=far)
        near, which = np.unique(pairs[0], return_inverse=True)
        apart = self._apart(self._bodies(poses, near), np.stack([which, pairs[1]]))
        np.minimum.at(gaps, pairs[0] // len(self.names), apart)
        return np.asarray(np.maximum(gaps, 0.0))

    def nearest(self, pose: FloatArray, within: float) -> tuple[float, str, int | None]:
        """Return the smallest distance at a pose (3,), whose it is, and from which obstacle (None: a wall).

        Something has to be nearer than `within`, m.
        """
        walls = self._wall_gaps(self._corners(pose[None]))[0]
        bodies = self._bodies(pose[None], np.arange(len(self.names)))
        pairs = self.tree.query(bodies, predicate="dwithin", distance=within)
        gaps = np.concatenate([self._apart(bodies, pairs), walls])
        i = int(np.argmin(gaps))
        if i < len(pairs[0]):
            return float(gaps[i]), self.names[pairs[0, i]], int(pairs[1, i])
        return max(float(gaps[i]), 0.0), self.names[self.body[i - len(pairs[0])]], None

    def _corners(self, poses: FloatArray) -> FloatArray:
        """The corners (m, v, 2) of the bodies at poses (m, 3)."""
        return np.asarray(poses[:, None, :2] + se2.rotate(poses[:, 2:3], self.corners[None]))

    def _bodies(self, poses: FloatArray, chosen: IntArray) -> ObjectArray:
        """The polygons (k,) of some bodies at poses (m, 3), counted on from pose to pose."""
        pose, body = np.divmod(chosen, len(self.names))
        firsts, counts = (each[body] for each in self._rings)
        owner = np.repeat(np.arange(len(chosen)), counts)
        corners = self.corners[np.arange(len(owner)) + np.repeat(firsts + counts - np.cumsum(counts), counts)]
        placed = poses[pose[owner]]
        rings = shapely.linearrings(placed[:, :2] + se2.rotate(placed[:, 2], corners), indices=owner)
        return np.asarray(shapely.polygons(rings))

    def _apart(self, bodies: ObjectArray, pairs: IntArray) -> FloatArray:
        """Distances (k,) of bodies from obstacles, by their indices (2, k), m."""
        away = shapely.distance(bodies[pairs[0]], self.shapes[pairs[1]])
        return np.asarray(np.maximum(away - self.radii[pairs[1]], 0.0))

    def _wall_gaps(self, points: FloatArray) -> FloatArray:
        """Distances (...) of points (..., 2) from the walls, m; negative beyond, infinite where there are none."""
        if self.walls is None:
            return np.full(points.shape[:-1], np.inf)
        low, high = (self.walls.xmin, self.walls.ymin), (self.walls.xmax, self.walls.ymax)
        near = np.minimum(points - low, high - points)
        return np.asarray(np.minimum(near[..., 0], near[..., 1]))


def _circle_around(points: FloatArray) -> tuple[FloatArray, float]:
    """Middle (2,) and radius of a circle around points (k, 2), m."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return middle, float(np.hypot(*(points - middle).T).max())


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
