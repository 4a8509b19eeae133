"""Exact distances along a motion with shapely, and checks of the pusher's limits.

The searches share none of this code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from pushplan.geometry import se2
from pushplan.mechanics.chain import Body, LimitName, Limits
from pushplan.plans.path import PushPath
from pushplan.plans.trajectory import Trajectory
from pushplan.scenario.model import Scenario
from pushplan.scenario.parts import CircleObstacle, Obstacle, Workspace
from pushplan.util.arrays import BoolArray, FloatArray, IntArray, columns_of, distinct
from pushplan.util.names import CLEARANCE_ROOM

ObjectArray = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class Moving:
    """Bodies that move together.

    Attributes:
        names: (b,) names of the bodies.
        corners: (v, 2) corners of all outlines, in the moving frame, m.
        counts: (b,) number of corners of each body.
        middles: (b, 2) middles of circles around the bodies, in the moving frame, m.
        radii: (b,) radii of these circles, m.
    """

    names: tuple[str, ...]
    corners: FloatArray
    counts: IntArray
    middles: FloatArray
    radii: FloatArray

    @classmethod
    def of(cls, bodies: Sequence[Body]) -> Moving:
        """Return the moving set of some bodies."""
        outlines = [body.outline for body in bodies]
        middles = np.array([0.5 * (outline.min(axis=0) + outline.max(axis=0)) for outline in outlines])
        away = [float(np.hypot(*(o - middle).T).max()) for o, middle in zip(outlines, middles, strict=True)]
        counts = np.array([len(outline) for outline in outlines])
        return cls(tuple(body.name for body in bodies), np.concatenate(outlines), counts, middles, np.array(away))


@dataclass(frozen=True, eq=False)
class Standing:
    """Obstacles and objects at rest.

    Attributes:
        obstacles: (n,) all obstacles.
        shapes: (n,) polygons, or centres of round obstacles.
        radii: (n,) radii of round obstacles, m; 0 for polygons.
        tree: Search tree of the obstacles, with squares around round ones.
    """

    obstacles: tuple[Obstacle, ...]
    shapes: ObjectArray
    radii: FloatArray
    tree: shapely.STRtree

    @classmethod
    def of(cls, obstacles: tuple[Obstacle, ...]) -> Standing:
        """Return the set of some obstacles."""
        shapes, radii = _shapes(obstacles)
        around, disc = shapes.copy(), radii > 0.0
        around[disc] = shapely.buffer(shapes[disc], radii[disc], cap_style="square")
        return cls(obstacles, shapes, radii, shapely.STRtree(around))

    def near(self, shapes: ObjectArray, within: FloatArray | float) -> IntArray:
        """Return the indices (2, k) of pairs (given shape, obstacle) within a distance (m)."""
        return np.asarray(self.tree.query(shapes, predicate="dwithin", distance=within))

    def apart(self, bodies: ObjectArray, pairs: IntArray) -> FloatArray:
        """Return the distances (k,) of bodies from obstacles, for pairs of indices (2, k), m."""
        away = shapely.distance(bodies[pairs[0]], self.shapes[pairs[1]])
        return np.asarray(np.maximum(away - self.radii[pairs[1]], 0.0))


@dataclass(frozen=True, eq=False)
class Room:
    """Moving bodies, in one or several cases, and the obstacles that they must avoid.

    Attributes:
        moving: (c,) moving bodies, by case.
        walls: The workspace.
        standing: Obstacles of all cases.
        resting: Obstacles of some cases only.
        rests: (c, r) whether each of these is present, by case.
    """

    moving: tuple[Moving, ...]
    walls: Workspace | None
    standing: Standing
    resting: Standing = field(default_factory=lambda: Standing.of(()))
    rests: BoolArray = field(default_factory=lambda: np.zeros((1, 0), dtype=np.bool_))

    @classmethod
    def of(cls, scenario: Scenario) -> Room:
        """Return the room of a scenario, with a single case."""
        return cls((Moving.of(scenario.chain.bodies),), scenario.workspace, Standing.of(tuple(scenario.obstacles)))

    @cached_property
    def _bodies(self) -> Moving:
        """The moving bodies of all cases."""
        each = self.moving
        return Moving(
            tuple(name for one in each for name in one.names),
            *(
                np.concatenate(parts)
                for parts in zip(*((m.corners, m.counts, m.middles, m.radii) for m in each), strict=True)
            ),
        )

    @cached_property
    def _firsts(self) -> tuple[IntArray, IntArray, IntArray]:
        """First corners (b,) of the bodies; first bodies (c,) of the cases, and their numbers of bodies (c,)."""
        counts, bodies = self._bodies.counts, np.array([len(one.names) for one in self.moving])
        return np.cumsum(counts) - counts, np.cumsum(bodies) - bodies, bodies

    def gaps(self, poses: FloatArray, enough: float, case: IntArray | None = None) -> FloatArray:
        """Return the distances (m,) of the bodies at poses (m, 3) from all obstacles, m; 0 on overlap.

        Args:
            poses: (m, 3) poses of the moving frame.
            enough: Upper limit of the returned distances, m.
            case: (m,) case of each pose; None for the first one.
        """
        case = np.zeros(len(poses), dtype=int) if case is None else case
        _, first, count = self._firsts
        counts = count[case]
        pose = np.repeat(np.arange(len(poses)), counts)
        body = first[case[pose]] + np.arange(len(pose)) - np.repeat(np.cumsum(counts) - counts, counts)
        placed = poses[pose]
        places = placed[:, :2] + se2.rotate(placed[:, 2], self._bodies.middles[body])
        far = enough + self._bodies.radii[body]
        gaps = np.full(len(poses), enough)
        beside = self._wall_gaps(places) < far  # true for few bodies
        if beside.any():
            corners, owner = self._corners(placed[beside], body[beside])
            np.minimum.at(gaps, pose[beside][owner], self._wall_gaps(corners))
        points = np.asarray(shapely.points(places))
        for standing, rests in ((self.standing, None), (self.resting, self.rests)):
            if not standing.obstacles:
                continue
            pairs = standing.near(points, far)
            if rests is not None:
                pairs = pairs[:, rests[case[pose[pairs[0]]], pairs[1]]]
            near = distinct(pairs[0])
            which = np.stack([np.searchsorted(near, pairs[0]), pairs[1]])
            apart = standing.apart(self._polygons(placed[near], body[near]), which)
            np.minimum.at(gaps, pose[pairs[0]], apart)
        return np.asarray(np.maximum(gaps, 0.0))

    def nearest(self, pose: FloatArray, within: float, case: int = 0) -> tuple[float, str, Obstacle | None]:
        """Return the smallest distance at a pose (3,), its body and its obstacle (None: a wall).

        Some obstacle must be nearer than `within`, m.
        """
        _, first, count = self._firsts
        names, body = self.moving[case].names, first[case] + np.arange(count[case])
        placed = np.repeat(pose[None], len(body), axis=0)
        corners, owner = self._corners(placed, body)
        walls = self._wall_gaps(corners)
        found: list[tuple[float, str, Obstacle | None]] = []
        bodies = self._polygons(placed, body)
        for standing in (self.standing, self.resting):
            pairs = standing.near(bodies, within)
            if standing is self.resting:
                pairs = pairs[:, self.rests[case, pairs[1]]]
            gaps = standing.apart(bodies, pairs)
            found += [(float(gap), names[b], standing.obstacles[k]) for gap, b, k in zip(gaps, *pairs, strict=True)]
        found.append((max(float(walls.min()), 0.0), names[owner[walls.argmin()]], None))
        return min(found, key=lambda one: one[0])

    def _corners(self, poses: FloatArray, body: IntArray) -> tuple[FloatArray, IntArray]:
        """Return the corners (v, 2) of bodies (k,) at poses (k, 3), and the body of each corner (v,)."""
        counts = self._bodies.counts[body]
        owner = np.repeat(np.arange(len(body)), counts)
        own = self._firsts[0][body[owner]] + np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
        placed = poses[owner]
        return placed[:, :2] + se2.rotate(placed[:, 2], self._bodies.corners[own]), owner

    def _polygons(self, poses: FloatArray, body: IntArray) -> ObjectArray:
        """Return the polygons of bodies (k,) at poses (k, 3)."""
        corners, owner = self._corners(poses, body)
        return np.asarray(shapely.polygons(shapely.linearrings(corners, indices=owner)))

    def _wall_gaps(self, points: FloatArray) -> FloatArray:
        """Return distances (...) of points (..., 2) from the walls, m; negative outside, infinite without walls."""
        if self.walls is None:
            return np.full(points.shape[:-1], np.inf)
        low, high = (self.walls.xmin, self.walls.ymin), (self.walls.xmax, self.walls.ymax)
        near = np.minimum(points - low, high - points)
        return np.asarray(np.minimum(near[..., 0], near[..., 1]))


def _shapes(obstacles: Sequence[Obstacle]) -> tuple[ObjectArray, FloatArray]:
    """Return polygons, or centres and radii, of obstacles. All rings are built at once: there can be many."""
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
    """A motion: poses as a function of travel.

    Attributes:
        poses: (m, 3) poses along the motion, m > 0.
        twists: (m - 1, 3) twists whose exponentials lead from each pose to the next.
        travel: (m,) upper bound of the travel of all body points up to each pose, m.
    """

    poses: FloatArray
    twists: FloatArray
    travel: FloatArray

    @classmethod
    def through(cls, poses: FloatArray, reach: float) -> Motion:
        """Return the motion through poses, for a body with a reach (m) from the frame's origin."""
        return cls._of(poses, _log(se2.relative(poses[:-1], poses[1:])), reach)

    @classmethod
    def sampled(cls, trajectory: Trajectory, reach: float) -> Motion:
        """Return the motion through a trajectory's samples, with a constant twist between neighbours.

        Along one twist, few samples are needed: at most a radian is turned between two of them.
        """
        kept = trajectory.changes_at(trajectory.t)
        fastest = float(np.abs(trajectory.coefficients[:, 0, 2]).max(initial=1.0))
        kept[:: max(1, int(trajectory.sample_rate / fastest))] = True
        return cls.through(trajectory.poses_at(trajectory.t[kept]), reach)

    @classmethod
    def along(cls, path: PushPath, reach: float) -> Motion:
        """Return the motion along a path."""
        return cls._of(path.knots, path.twists * path.lengths[:, None], reach)

    @classmethod
    def joined(cls, motions: Sequence[Motion]) -> tuple[Motion, FloatArray]:
        """Return the sequence of motions, separated by rests, and the travels (c,) at which they begin."""
        rest = np.zeros((1, 3))
        twists = [twists for one in motions for twists in (one.twists, rest)]
        begins = np.cumsum([0.0, *(one.travel[-1] + 1.0 for one in motions)])[:-1]
        travel = [one.travel + begin for one, begin in zip(motions, begins, strict=True)]
        poses = np.concatenate([one.poses for one in motions])
        return cls(poses, np.concatenate(twists[:-1]), np.concatenate(travel)), begins

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


def _log(pose: FloatArray) -> FloatArray:
    """Return the body twists (k, 3) whose exponentials are poses (k, 3): the inverse of `se2.exp`."""
    half = 0.5 * pose[:, 2]
    diagonal = 1.0 / np.where(np.abs(half) < 1e-6, 1.0 + half**2 / 3.0, np.tan(half) / np.where(half == 0, 1, half))
    x = diagonal * pose[:, 0] + half * pose[:, 1]
    y = -half * pose[:, 0] + diagonal * pose[:, 1]
    return np.stack([x, y, pose[:, 2]], axis=1)


COARSE = 0.2
"""Maximum travel (m) of a body point between the first poses that are checked."""

SPACING = 0.002
"""Travel (m) of a body point between two checked poses below which no proof is needed."""


@dataclass(frozen=True)
class Collision:
    """A pose at which a motion is too near to something.

    Attributes:
        pose: (x, y, theta) of the chain frame in the world.
        body: `robot`, `pusher` or the object's name.
        obstacle: The obstacle; None for a wall of the workspace.
        gap: Remaining distance, m; 0 if they touch or overlap.
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
            return f"'{self.body}' touches {other} {place}"
        return f"'{self.body}' is {1e3 * self.gap:.3g} mm from {other} {place}"


def find_collision(scenario: Scenario, poses: FloatArray) -> Collision | None:
    """Return the first collision along poses (m, 3) of the chain frame, to `SPACING`; None if there is none.

    A collision is a distance below the scenario's clearance, less `CLEARANCE_ROOM`.

    Args:
        scenario: Scenario with the chain, the obstacles and the clearance.
        poses: (m, 3) poses with a constant twist between neighbours.
    """
    motion = Motion.through(poses, scenario.chain.reach)
    return find_collisions(Room.of(scenario), (motion,), scenario.clearance)[0]


def find_collisions(room: Room, motions: Sequence[Motion], clearance: float) -> list[Collision | None]:
    """Return `find_collision` for motions, each in its own case of a room, with a clearance (m)."""
    required = clearance - CLEARANCE_ROOM
    found: list[Collision | None] = []
    for case, (motion, at) in enumerate(zip(motions, _first_too_near(room, motions, required), strict=True)):
        if np.isinf(at):
            found.append(None)
            continue
        pose = motion.at(np.array([at]))[0]
        gap, body, obstacle = room.nearest(pose, required + SPACING, case)
        x, y, theta = (float(value) for value in pose)
        found.append(Collision((x, y, theta), body, obstacle, gap))
    return found


def _first_too_near(room: Room, motions: Sequence[Motion], required: float) -> FloatArray:
    """Return the travels (c,) at which motions are first nearer to something than required (m), to `SPACING`.

    They are infinite for motions without a collision. All intervals are halved together, because checking a few poses
    takes nearly as long as checking many.
    """
    motion, begins = Motion.joined(motions)
    wholes = [one.travel[-1] for one in motions]
    counts = [int(np.ceil(whole / COARSE)) + 1 for whole in wholes]
    s = np.concatenate([b + np.linspace(0.0, w, n) for b, w, n in zip(begins, wholes, counts, strict=True)])
    case = np.repeat(np.arange(len(motions)), counts)
    gaps = room.gaps(motion.at(s), COARSE + 2.0 * required, case)
    first = np.full(len(motions), np.inf)
    np.minimum.at(first, case[gaps < required], s[gaps < required])
    inner = case[:-1] == case[1:]
    ends, case = np.stack([s[:-1], s[1:], gaps[:-1], gaps[1:]])[:, inner], case[:-1][inner]
    while len(case):
        low, high, g, h = ends
        unproven = (g + h - (high - low) < 2.0 * required) & (high - low > SPACING) & (low < first[case])
        if not unproven.any():
            break
        (low, high, g, h), case = ends[:, unproven], case[unproven]
        middle = 0.5 * (low + high)
        m = room.gaps(motion.at(middle), 0.5 * (high - low).max() + 2.0 * required, case)
        np.minimum.at(first, case[m < required], middle[m < required])
        ends = np.hstack([np.stack([low, middle, g, m]), np.stack([middle, high, m, h])])
        case = np.concatenate([case, case])
    return first - begins


STEP, MOST = 4e-3, 250_000
"""Time between two checked instants, s, and their maximum number; long motions have wider steps."""

TOLERANCE = 0.01
"""Relative tolerance of a limit for finite differences, because speeds change within a step too."""


def excess(trajectory: Trajectory, limits: Limits) -> str:
    """Return which limit of speed or acceleration a trajectory exceeds, and when; empty if it keeps them all."""
    count = min(int(np.ceil(trajectory.duration / STEP)) + 1, MOST)
    if count < 3:
        return ""
    t = np.linspace(0.0, trajectory.duration, count)
    t = t[trajectory.changes_at(t)]
    h, twists = np.diff(t), columns_of(trajectory.twists_at(t))
    changes, (u, v, turn) = np.diff(twists) / h, 0.5 * (twists[:, :-1] + twists[:, 1:])  # jumps between pieces count
    speed = np.hypot(twists[0], twists[1])
    gain = np.diff(speed)
    found: dict[LimitName, FloatArray] = {
        "speed": np.where(twists[0] < 0.0, -speed, speed),
        # the velocity direction turns with the body
        "acceleration": np.copysign(np.hypot(changes[0] - turn * v, changes[1] + turn * u), gain),
        "angular_speed": twists[2],
        "angular_acceleration": changes[2],
    }
    steady = np.abs(gain) < TOLERANCE * h * np.abs(found["acceleration"])  # rounding determines no sign
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
    return f"{values[worst]:.4g} after {t[worst]:.2f} s; allowed: {-both[0]:.4g} to {both[1]:.4g}"
