"""Paths through narrow gaps: poses aligned with the gaps on both sides, joined by steering paths."""

from __future__ import annotations

import heapq
import math
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import shapely

from pushplan.core.collision import Scene, separations
from pushplan.core.problem import STRAIGHT, TURN_WEIGHT, Problem, connect
from pushplan.geometry import se2
from pushplan.planners.search.session import Session
from pushplan.util.arrays import FloatArray

NARROW = 1.25
"""Maximum width of a bottleneck, in widths of the body. Random trees find wider gaps themselves."""

MOST_GAPS = 32
"""Maximum number of gaps, narrowest first."""

BESIDE = 0.1
"""Distance of the aligned poses from a gap, before and behind it, in lengths of the body."""

FACING = 0.05
"""Extra distance from a gap up to which corners belong to its faces, in widths of the body."""

LOOKS = 16
"""Number of poses checked on each side of a gap's middle."""


class Extent(NamedTuple):
    """Extent of the body along and across its straight push, chain frame: direction (rad) and bounds (m)."""

    direction: float
    back: float
    front: float
    right: float
    left: float

    @property
    def width(self) -> float:
        """Width across the push, m."""
        return self.left - self.right

    @classmethod
    def of(cls, problem: Problem) -> Extent:
        """Return the extent of a problem's body."""
        push = problem.families[0, STRAIGHT]
        direction = math.atan2(push[1], push[0])
        along = np.array([math.cos(direction), math.sin(direction)])
        corners = problem.scene.body.corners[:, :2]
        ahead, aside = corners @ along, corners @ np.array([-along[1], along[0]])
        return cls(direction, ahead.min(), ahead.max(), aside.min(), aside.max())


class Gap(NamedTuple):
    """A gap: middle (2,), m; unit vector (2,) through it; begin and end of its faces along that vector, m."""

    middle: FloatArray
    through: FloatArray
    begin: float
    end: float


def gaps_in(scene: Scene, least: float, most: float, facing: float) -> list[Gap]:
    """Return the gaps between pairs of obstacles or walls with nothing in between, narrowest first.

    Args:
        scene: Obstacles and walls.
        least: Minimum width, m.
        most: Maximum width, m.
        facing: Extra distance from a gap up to which corners belong to its faces, m.
    """
    corners, starts = scene.obstacles.corners[:, :2], scene.obstacles.starts
    outlines = np.split(corners, starts[1:-1]) if len(starts) > 1 else []
    xmin, ymin, xmax, ymax = scene.walls
    if np.isfinite(scene.walls).all():
        box = np.array([[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax]])
        outlines += [box[[k, (k + 1) % 4]] for k in range(4)]
    outlines += list(scene.circles[:, None, :2])
    radii = np.concatenate([np.zeros(len(outlines) - len(scene.circles)), scene.circles[:, 2]])
    shapes = _shapes(outlines)
    tree = shapely.STRtree(shapes)
    first, second = tree.query(shapes, "dwithin", most + 2.0 * radii.max(initial=0.0))
    first, second = first[first < second], second[first < second]
    apart = shapely.distance(shapes[first], shapes[second]) > least  # false for most pairs: neighbours in a wall
    first, second = first[apart], second[apart]
    lines = shapely.get_coordinates(shapely.shortest_line(shapes[first], shapes[second])).reshape(-1, 2, 2)
    across = lines[:, 1] - lines[:, 0]
    length = np.hypot(across[:, 0], across[:, 1])
    widths = length - radii[first] - radii[second]
    unit = across / np.maximum(length, 1e-300)[:, None]
    middles = lines[:, 0] + (radii[first] + 0.5 * widths)[:, None] * unit
    narrow = np.flatnonzero((widths > least) & (widths < most))
    points = shapely.points(middles[narrow])
    gap, near = tree.query(points, "dwithin", 0.5 * least + radii.max(initial=0.0))
    between = shapely.distance(points[gap], shapes[near]) - radii[near] < 0.5 * least
    narrow = np.delete(narrow, gap[between])
    gaps = []
    for k in narrow[np.argsort(widths[narrow], kind="stable")][:MOST_GAPS]:
        through = np.array([unit[k, 1], -unit[k, 0]])
        sides = ((first[k], lines[k, 0], unit[k]), (second[k], lines[k, 1], -unit[k]))
        faces = [_face(outlines[n] - place, outward, through, facing) for n, place, outward in sides]
        gaps.append(Gap(middles[k], through, max(face[0] for face in faces), min(face[1] for face in faces)))
    return gaps


def _shapes(outlines: list[FloatArray]) -> Any:
    """Return outlines (k, 2) as points, segments or polygons, for one, two or more corners."""
    counts = np.array([len(outline) for outline in outlines], dtype=np.int64)
    shapes = np.empty(len(outlines), dtype=object)
    for kind, of_kind in ((0, counts == 1), (1, counts == 2), (2, counts > 2)):
        rows = np.flatnonzero(of_kind)
        if not len(rows):
            continue
        corners = np.concatenate([outlines[row] for row in rows])
        numbers = np.repeat(np.arange(len(rows)), counts[rows])
        if kind == 0:
            shapes[rows] = shapely.points(corners)
        elif kind == 1:
            shapes[rows] = shapely.linestrings(corners, indices=numbers)
        else:
            shapes[rows] = shapely.polygons(shapely.linearrings(corners, indices=numbers))
    return shapes


def _face(outline: FloatArray, across: FloatArray, through: FloatArray, facing: float) -> tuple[float, float]:
    """Return the begin and end of an outline's face at a gap, along the vector through the gap, m."""
    along = np.append(outline[-(outline @ across) < facing] @ through, 0.0)
    return float(along.min()), float(along.max())


def aligned_poses(problem: Problem, known: dict[tuple[float, ...], list[Gap]] | None = None) -> FloatArray:
    """Return free poses (n, 2, 3) before and behind the bottlenecks, with the straight push along the gap.

    Each bottleneck counts in both directions. One with a blocked middle has no poses.

    Args:
        problem: Push problem.
        known: Cache of gaps by search parameters. New gaps are added.
    """
    scene, extent = problem.scene, Extent.of(problem)
    least, most = extent.width + 2.0 * scene.clearance, NARROW * extent.width
    beside = BESIDE * (extent.front - extent.back)
    found: dict[tuple[float, ...], FloatArray] = {}
    known, key = {} if known is None else known, (least, most, FACING * extent.width)
    if key not in known:
        known[key] = gaps_in(scene, *key)
    for gap in known[key]:
        for sense in (1.0, -1.0):
            ahead = sense * gap.through
            begin, end = (gap.begin, gap.end) if sense > 0.0 else (-gap.end, -gap.begin)
            before, behind = begin - beside - extent.front, end + beside - extent.back
            pair = _free_ends(scene, gap.middle, ahead, extent, before, behind)
            if pair is not None:  # pieces of one obstacle share some gaps
                found[tuple(np.round(pair, 6).ravel())] = pair
    return np.array(list(found.values())).reshape(-1, 2, 3)


def _free_ends(
    scene: Scene, middle: FloatArray, ahead: FloatArray, extent: Extent, before: float, behind: float
) -> FloatArray | None:
    """Return the first and last pose (2, 3) of the free middle part of a push through a gap; None if blocked."""
    theta = math.atan2(ahead[1], ahead[0]) - extent.direction
    aside = 0.5 * (extent.right + extent.left) * np.array([-ahead[1], ahead[0]])
    along = np.linspace(before, behind, 2 * LOOKS + 1)[:, None]
    poses = np.column_stack([middle - aside + along * ahead, np.full(len(along), theta)])
    blocked = separations(scene, poses, 2.0 * scene.clearance) < scene.clearance
    if blocked[LOOKS]:
        return None
    first = int(np.flatnonzero(blocked[:LOOKS]).max(initial=-1)) + 1
    last = LOOKS + int(np.argmax(np.append(blocked[LOOKS:], True))) - 1
    return poses[[first, last]]


WORDS = 8
"""Number of steering paths that count as one iteration. Each takes 1 to 5 us."""


class _Way(NamedTuple):
    """An edge to a pose, known or still to compute. Edges sort by the estimated cost (m) from start to goal."""

    promise: float
    number: int
    origin: int
    target: int
    arcs: FloatArray | None


class Ways:
    """Best-first search on a graph of start, aligned poses at bottlenecks and goal.

    A steering path between two poses is computed when its edge leaves the queue.

    Args:
        session: Session of the search.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        found = aligned_poses(session.problem, session.common.room).reshape(-1, 3)
        self._poses = np.concatenate([session.start[None], found, session.problem.goal[None]])
        self._to_goal = _least(self._poses, session.problem.goal)
        self._paths: dict[int, FloatArray] = {}
        self._numbers = count()
        self._queue: list[_Way] = []
        if len(found):
            self._reach(0, np.zeros((0, 4)))

    def run(self, tries: int) -> None:
        """Try at most `tries` steering paths, until a path reaches the goal or no edge is left."""
        session, words, goal = self._session, 0, len(self._poses) - 1
        while self._queue and words < tries and not session.finished:
            way = heapq.heappop(self._queue)
            if way.target in self._paths:
                continue
            if way.arcs is None:
                words += 1
                self._connect(way)
                continue
            path = np.concatenate([self._paths[way.origin], way.arcs])
            if way.target == goal:
                session.offer(path)
                self._queue = []
                break
            self._reach(way.target, path)
        session.spent(words, words // WORDS)

    def _reach(self, node: int, path: FloatArray) -> None:
        """Store the arcs (k, 4) of the path to a node and queue the edges from it."""
        self._paths[node] = path
        least = _least(self._poses, self._poses[node])
        for target in range(1, len(self._poses)):
            if target not in self._paths:
                self._keep(node, target, float(least[target]))

    def _keep(self, origin: int, target: int, cost: float, arcs: FloatArray | None = None) -> None:
        promise = float(self._paths[origin][:, 3].sum()) + cost + float(self._to_goal[target])
        heapq.heappush(self._queue, _Way(promise, next(self._numbers), origin, target, arcs))

    def _connect(self, way: _Way) -> None:
        """Compute the collision-free steering path of an edge."""
        problem = self._session.problem
        _, _, arcs = connect(problem.scene, problem.families, self._poses[way.origin], self._poses[way.target])
        if arcs is not None:
            self._keep(way.origin, way.target, float(arcs[:, 3].sum()), arcs)


def _least(poses: FloatArray, pose: FloatArray) -> FloatArray:
    """Return the costs (n,) of straight travel and the smallest turn between poses (n, 3) and a pose (3,), m."""
    errors = se2.pose_errors(poses, pose)
    return np.asarray(errors[:, 0] + TURN_WEIGHT * errors[:, 1])
