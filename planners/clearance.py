"""Exact distances along a motion by shapely, and the pusher's limits; no code shared with the searches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from pushplan.geometry import se2
from pushplan.mechanics.chain import LimitName, Limits
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import CircleObstacle, Scenario
from pushplan.scenario.parts import Obstacle, Workspace
from pushplan.util.arrays import FloatArray, IntArray
from pushplan.util.names import CLEARANCE_ROOM

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
        return replace(self, names=tuple(self.names[i] for i in bodies), corners=self.corners[kept], body=body)

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


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses by travel.

    Attributes:
        poses: (m, 3) that it passes through, m > 0.
        twists: (m - 1, 3) whose exponentials lead from each pose to the next.
        travel: (m,) that no point of the body exceeds until each pose, m.
    """

    poses: FloatArray
    twists: FloatArray
    travel: FloatArray

    @classmethod
    def through(cls, poses: FloatArray, reach: float) -> Motion:
        """Return the motion of a body that reaches so far (m) from the frame's origin."""
        return cls._of(poses, _log(se2.relative(poses[:-1], poses[1:])), reach)

    @classmethod
    def along(cls, path: PushPath, reach: float) -> Motion:
        """Return the motion along a path."""
        return cls._of(path.knots, path.twists * path.lengths[:, None], reach)

    @classmethod
    def _of(cls, poses: FloatArray, twists: FloatArray, reach: float) -> Motion:
        steps = np.hypot(twists[:, 0], twists[:, 1]) + np.abs(twists[:, 2]) * reach
        return cls(poses, twists, np.concatenate([[0.0], np.cumsum(steps)]))

    def at(self, travel: FloatArray) -> FloatArray:
        """Return the poses (k, 3) at travels (k,), m."""
        if len(self.poses) == 1:
            return np.repeat(self.poses, len(travel), axis=0)
        i = np.clip(np.searchsorted(self.travel, travel, side="right") - 1, 0, len(self.twists) - 1)
        step = self.travel[i + 1] - self.travel[i]
        share = (travel - self.travel[i]) / np.where(step > 0.0, step, 1.0)
        return se2.compose(self.poses[i], se2.exp(self.twists[i] * share[:, None]))


def densify(poses: FloatArray, reach: float, spacing: float) -> FloatArray:
    """Insert poses on the constant-twist motion between neighbours: no body point moves more than `spacing`."""
    if len(poses) < 2:
        return poses
    motion = Motion.through(poses, reach)
    counts = np.maximum(1, np.ceil(np.diff(motion.travel) / spacing)).astype(int)
    owner = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[owner]
    inner = se2.compose(poses[owner], se2.exp(motion.twists[owner] * share[:, None]))
    return np.concatenate([inner, poses[-1:]])


def _log(pose: FloatArray) -> FloatArray:
    """Body twists (k, 3) whose exponential are the poses (k, 3); the inverse of `se2.exp`."""
    half = 0.5 * pose[:, 2]
    diagonal = 1.0 / np.where(np.abs(half) < 1e-6, 1.0 + half**2 / 3.0, np.tan(half) / np.where(half == 0, 1, half))
    x = diagonal * pose[:, 0] + half * pose[:, 1]
    y = -half * pose[:, 0] + diagonal * pose[:, 1]
    return np.stack([x, y, pose[:, 2]], axis=1)


COARSE = 0.2
"""No point of the body moves farther than this (m) between the first poses that are looked at."""

SPACING = 0.002
"""Where nothing is proven, no point of the body moves farther than this (m) between two poses looked at."""


@dataclass(frozen=True)
class Collision:
    """Where a motion comes too near to something.

    Attributes:
        pose: (x, y, theta) of the chain frame in the world.
        body: `robot`, `pusher` or the object's name.
        obstacle: What is met, or None for the workspace's walls.
        gap: Distance that is left, m; 0 where they touch or overlap.
    """

    pose: tuple[float, float, float]
    body: str
    obstacle: Obstacle | None
    gap: float = 0.0

    def __str__(self) -> str:
        other = "a wall of the workspace" if self.obstacle is None else str(self.obstacle)
        x, y, theta = self.pose
        place = f"with the chain frame at ({x:.4f}, {y:.4f}) m, {np.degrees(theta):.2f} deg"
        if self.gap <= 0.0:
            return f"'{self.body}' meets {other} {place}"
        return f"'{self.body}' is {1e3 * self.gap:.3g} mm from {other} {place}"


def find_collision(scenario: Scenario, poses: FloatArray) -> Collision | None:
    """Return the first collision along poses (m, 3) of the chain frame, to `SPACING`, or None.

    It is one when a body comes nearer to something than the scenario's clearance, less `CLEARANCE_ROOM`.

    Args:
        scenario: What moves, what is in the way, and how far to keep from it.
        poses: Between neighbours the twist is constant.
    """
    return collision_along(scenario, Motion.through(poses, scenario.chain.reach))


def collision_along(scenario: Scenario, motion: Motion, room: Room | None = None) -> Collision | None:
    """Return `find_collision` of a motion in a `room`; None stands for the scenario's."""
    required = scenario.clearance - CLEARANCE_ROOM
    room = Room.of(scenario) if room is None else room
    at = _first_too_near(room, motion, required)
    if at is None:
        return None
    pose = motion.at(np.array([at]))[0]
    gap, body, obstacle = room.nearest(pose, required + SPACING)
    x, y, theta = (float(value) for value in pose)
    return Collision((x, y, theta), body, None if obstacle is None else scenario.obstacles[obstacle], gap)


def _first_too_near(room: Room, motion: Motion, required: float) -> float | None:
    """Return the travel at which a motion first comes nearer to something than required (m), to `SPACING`."""
    whole = motion.travel[-1]
    s = np.linspace(0.0, whole, int(np.ceil(whole / COARSE)) + 1)
    gaps = room.gaps(motion.at(s), COARSE + 2.0 * required)
    first = s[gaps < required].min(initial=np.inf)
    ends = np.stack([s[:-1], s[1:], gaps[:-1], gaps[1:]])
    while ends.shape[1]:
        low, high, g, h = ends
        unproven = (g + h - (high - low) < 2.0 * required) & (high - low > SPACING) & (low < first)
        low, high, g, h = ends[:, unproven]
        middle = 0.5 * (low + high)
        m = room.gaps(motion.at(middle), 0.5 * (high - low).max(initial=0.0) + 2.0 * required)
        first = middle[m < required].min(initial=first)
        ends = np.hstack([np.stack([low, middle, g, m]), np.stack([middle, high, m, h])])
    return None if np.isinf(first) else float(first)


STEP, MOST = 4e-3, 250_000
"""Time between two poses looked at, s, and how many are looked at: those of longer motions are farther apart."""

TOLERANCE = 0.01
"""Share of a limit that differences may seem to exceed it by; speeds change within a step, too."""


def excess(trajectory: Trajectory, limits: Limits) -> str:
    """Return which limit of speed or acceleration a trajectory exceeds, and when; empty if it keeps them all."""
    count = min(int(np.ceil(trajectory.duration / STEP)) + 1, MOST)
    if count < 3:
        return ""
    t = np.linspace(0.0, trajectory.duration, count)
    h = t[1]
    poses = trajectory.poses_at(t)  # angles run on
    rates = np.diff(poses, axis=0) / h
    changes = np.diff(rates, axis=0) / h
    heading = poses[:-1, 2]
    ahead = np.cos(heading) * rates[:, 0] + np.sin(heading) * rates[:, 1]
    speed = np.hypot(rates[:, 0], rates[:, 1])
    gain = np.diff(speed)
    found: dict[LimitName, FloatArray] = {
        "speed": np.where(ahead < 0.0, -speed, speed),
        "acceleration": np.copysign(np.hypot(changes[:, 0], changes[:, 1]), gain),
        "angular_speed": rates[:, 2],
        "angular_acceleration": changes[:, 2],
    }
    steady = np.abs(gain) < TOLERANCE * h * np.abs(found["acceleration"])  # rounding tells no sign
    found["acceleration"][steady] = np.abs(found["acceleration"][steady])
    for name, values in found.items():
        words = _beyond(values, limits.both(name), t)
        if words:
            return f"the motion exceeds the pusher's {name.replace('_', ' ')}: {words}"
    return ""


def _beyond(values: FloatArray, both: tuple[float, float], t: FloatArray) -> str:
    share = np.maximum(-values / both[0], values / both[1])
    worst = int(np.argmax(share))
    if share[worst] <= 1.0 + TOLERANCE:
        return ""
    return f"{values[worst]:.4g} after {t[worst]:.2f} s, allowed are {-both[0]:.4g} to {both[1]:.4g}"
